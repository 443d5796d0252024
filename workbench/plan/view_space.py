"""The views that a sensor may take of a jig: their six parameters, bounds, and what can be measured of them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from geometry import NoAnswerError, Pose, Sensor, cross_plane_x0, exp_so3, field_of_view, inside_polygon
from jig_cad import Jig
from workbench.plan.clearance import sensor_clearance_mm

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]
Index = NDArray[np.intp]

ROLL = 2  # the parameter that may go round


@dataclass(frozen=True)
class ViewLimits:
    """Which views are asked for.

    tilt_deg: largest turn about the pillar and up or down. roll_deg: largest turn about the sensor's own depth axis.
    height: where up the pillar the sheet may aim, as parts of its height. sideways: how far beside the sheet's middle
    that may be seen, as parts of the jig's side. nearest_wide: the nearest depth is where the field of view is as
    wide as that many sides of the jig; deepest: the farthest, as a multiple of the nearest. margin_px: strip along the
    image's border kept free. separation_mm: least distance between two strings' points as emitter and camera see them.
    clearance_mm: least distance of the line from emitter to camera from the jig's solids. end_mm: least distance of a
    point from its string's ends. mounting_deg: how far the sensor may be turned from where it is believed to be; all of
    the above must hold all the same.
    """

    tilt_deg: float = 32.0
    roll_deg: float = 35.0
    height: tuple[float, float] = (0.3, 0.7)
    sideways: float = 0.1
    nearest_wide: float = 1.15
    deepest: float = 1.5
    margin_px: float = 15.0
    separation_mm: float = 2.5
    clearance_mm: float = 60.0
    end_mm: float = 6.0
    mounting_deg: float = 3.0


@dataclass
class Tally:
    """How many views were tried, and why views were refused."""

    tried: int = 0
    refused: dict[str, int] = field(default_factory=dict)

    def refuse(self, why: str, mask: Mask) -> None:
        """Count the views of ``mask`` as refused for ``why``."""
        self.refused[why] = self.refused.get(why, 0) + int(np.sum(mask))

    def text(self) -> str:
        """``of 960 views tried, 500 out of the field of view, …``."""
        parts = [f"{n} {why}" for why, n in sorted(self.refused.items(), key=lambda item: -item[1]) if n]
        return f"of {self.tried} views tried: " + ", ".join(parts)


@dataclass(frozen=True, eq=False)
class ViewSpace:
    """Six parameters of a view and their bounds (6,): turns about the jig's x, then y, then the sensor's own z [rad],
    the height aimed at over the jig's, where it is seen sideways over the jig's side, and at which depth [mm].

    polygon: the field of view (V, 2). turns: what the mounting may be off by; a view must hold at all of them.
    """

    sensor: Sensor
    jig: Jig
    limits: ViewLimits
    polygon: Array
    low: Array
    high: Array
    turns: tuple[Pose, ...]

    @staticmethod
    def of(sensor: Sensor, jig: Jig, limits: ViewLimits) -> ViewSpace:
        """The space of the views within ``limits``; NoAnswerError where the sensor sees no jig of this size."""
        polygon = field_of_view(sensor, limits.margin_px)
        nearest, farthest = _depth_range(polygon, limits.nearest_wide * jig.side_mm, limits.deepest)
        tilt, roll = np.deg2rad(limits.tilt_deg), np.deg2rad(limits.roll_deg)
        low = np.array([-tilt, -tilt, -roll, limits.height[0], -limits.sideways, nearest])
        high = np.array([tilt, tilt, roll, limits.height[1], limits.sideways, farthest])
        return ViewSpace(sensor, jig, limits, polygon, low, high, _turns(limits.mounting_deg))

    def draw(self, count: int, rng: np.random.Generator) -> Array:
        """Parameters (count, 6), uniform within the bounds."""
        return np.column_stack([rng.uniform(a, b, count) for a, b in zip(self.low, self.high, strict=True)])

    def bounded(self, parameters: Array) -> Array:
        """Parameters (N, 6) brought within the bounds; a roll that may take any value goes round."""
        out = np.clip(parameters, self.low, self.high)
        if self.high[ROLL] >= np.pi:
            out[:, ROLL] = np.mod(parameters[:, ROLL] + np.pi, 2 * np.pi) - np.pi
        return np.asarray(out)

    def poses(self, parameters: Array) -> Pose:
        """T_sensor_jig (N) of parameters (N, 6)."""
        about_x, about_y, about_z, height, sideways, depth = parameters.T
        ex, ey, ez = np.eye(3)
        R = exp_so3(about_x[:, None] * ex) @ exp_so3(about_y[:, None] * ey) @ exp_so3(about_z[:, None] * ez)
        none = np.zeros(len(parameters))
        aim = self.jig.foot_mm + np.column_stack([height * self.jig.height_mm, none, none])
        seen_at = np.column_stack([none, sideways * self.jig.side_mm, depth])
        return Pose(R, aim - (R @ seen_at[..., None])[..., 0]).inverse()

    def measurable(self, T_sensor_jig: Pose, tally: Tally) -> Index:
        """Which views (N) show every string well inside the field of view and apart from the others, at every turn."""
        kept = np.arange(len(T_sensor_jig), dtype=np.intp)
        for turn in self.turns:
            kept = kept[self._measurable(turn @ T_sensor_jig[kept], tally)]
        return kept

    def _measurable(self, T_sensor_jig: Pose, tally: Tally) -> Mask:
        jig, limits = self.jig, self.limits
        starts = T_sensor_jig @ jig.starts[None]
        points, along = cross_plane_x0(starts, (T_sensor_jig.R[:, None] @ jig.directions[..., None])[..., 0])
        still = np.all((along > limits.end_mm) & (along < jig.lengths - limits.end_mm), axis=1)
        tally.refuse("with a string beyond its ends", ~still)
        tests: dict[str, Callable[[Index], Mask]] = {
            "out of the field of view": lambda i: self._inside(points[i]),
            "with two strings too near each other": lambda i: (
                _separation(self.sensor, points[i]) > limits.separation_mm
            ),
            "with the sensor too near the jig": lambda i: (
                sensor_clearance_mm(self.sensor, jig, T_sensor_jig[i]) > limits.clearance_mm
            ),
        }
        for why, test in tests.items():
            here = np.flatnonzero(still)  # a view is refused once, for the first test it fails
            good = test(here)
            tally.refuse(why, ~good)
            still[here] = good
        return np.asarray(still)

    def _inside(self, points: Array) -> Mask:
        return np.asarray(np.all(inside_polygon(np.nan_to_num(points[..., 1:], nan=1e9), self.polygon), axis=1))


def _depth_range(polygon: Array, width: float, deepest: float) -> tuple[float, float]:
    """Depths [mm] at which the field of view is as wide as the jig needs, and not far beyond: near is precise."""
    z = np.linspace(polygon[:, 1].min(), polygon[:, 1].max(), 200)
    y = np.linspace(polygon[:, 0].min(), polygon[:, 0].max(), 401)
    inside = inside_polygon(np.stack(np.broadcast_arrays(y[None, :], z[:, None]), -1), polygon)
    wide = z[inside.sum(axis=1) * (y[1] - y[0]) >= width]
    if len(wide) == 0:
        raise NoAnswerError(f"the sensor's field of view is nowhere {width:.0f} mm wide, as this jig needs")
    return float(wide[0]), float(min(wide[-1], deepest * wide[0]))


def _turns(mounting_deg: float) -> tuple[Pose, ...]:
    """No turn, and turns of the sensor by ``mounting_deg`` either way about each of its axes."""
    if mounting_deg == 0:
        return (Pose.identity(),)
    axes = np.concatenate([np.eye(3), -np.eye(3)]) * np.deg2rad(mounting_deg)
    return (Pose.identity(), *(Pose(exp_so3(w), np.zeros(3)) for w in axes))


def _separation(sensor: Sensor, points: Array) -> Array:
    """Least distance (N) [mm] of any two points (N, S, 3) across the rays of the emitter and of the camera.

    Two strings of one face of the pillar stand behind each other wherever that face points at the emitter.
    """
    least = np.full(len(points), np.inf)
    for source in sensor.viewpoints_mm:
        ray = points - source
        distance = np.linalg.norm(ray, axis=-1, keepdims=True)
        unit = ray / distance
        across = np.linalg.norm(np.cross(unit[:, :, None], unit[:, None]), axis=-1) * distance
        least = np.minimum(least, np.min(across + np.eye(points.shape[1]) * 1e9, axis=(1, 2)))
    return least
