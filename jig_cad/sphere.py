"""A ball, and several balls in one frame: every point of the stripe lies a radius from a centre."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from geometry import InputError, Pose, SectionKind, Shape, Surface, nearest_rotation

Array = NDArray[np.float64]
Index = NDArray[np.intp]

_USUAL_MM = 40.0  # a diameter to begin with where none is known
_CENTRE_STEPS = 12  # Gauss and Newton from the algebraic centre; it settles in four to six
_ON_A_LINE = 1e-6  # share of the balls' spread


@dataclass(frozen=True, eq=False)
class Sphere(Surface):
    """A ball about the origin of its own frame; no turn of it shows.

    Parameters
    ----------
    diameter_mm : float
        As stated, or to begin with where it is estimated.
    diameter_sigma_mm : float
        Of the diameter stated: 0 where it is exact, infinite where nothing is known of it.
    """

    diameter_mm: float = _USUAL_MM
    diameter_sigma_mm: float = 0.0
    name: str = ""

    kind = "sphere"
    section: SectionKind | None = "circle"
    features: tuple[str, ...] = ("sphere",)
    freedom: tuple[bool, ...] = (True, True, True, False, False, False)

    def __post_init__(self) -> None:
        """InputError where a number can not be a ball's."""
        _check_diameter("the ball's diameter_mm", self.diameter_mm)
        if not self.diameter_sigma_mm >= 0:
            raise InputError(f"the ball's diameter_sigma_mm = {self.diameter_sigma_mm:g}: must be 0 or positive")

    @property
    def shape(self) -> Shape:  # type: ignore[override] # an attribute of the base
        """The diameter [mm]."""
        return Shape(("diameter_mm",), np.array([self.diameter_sigma_mm]))

    @property
    def known(self) -> bool:
        """Whether anything is known of the diameter."""
        return bool(np.isfinite(self.diameter_sigma_mm))

    def shaped(self, shape: Array) -> Sphere:
        """The ball with another diameter."""
        return replace(self, diameter_mm=max(self.diameter_mm + float(shape[0]), 1e-3))

    def by_shape(self, points_mm: Array, feature: Index) -> Array:
        """Half a diameter is a radius."""
        return np.full((len(points_mm), 1, 1), -0.5)

    def offset(self, points_mm: Array, feature: Index) -> tuple[Array, Array]:
        """Distance (N, 1) from the surface, positive outside, and its gradient (N, 1, 3)."""
        length = np.linalg.norm(points_mm, axis=-1, keepdims=True)
        direction = points_mm / np.maximum(length, 1e-9)
        return length - self.diameter_mm / 2, direction[:, None, :]

    def at_place(self, T_base_target: Pose, sensors_mm: Array) -> dict[str, object]:
        """Centre and diameter."""
        return {"centre_mm": T_base_target.t, "diameter_mm": self.diameter_mm}

    def place(self, points_mm: Array, feature: Index) -> Pose | None:
        """The centre, by least squares."""
        centre = sphere_centre(points_mm, self.diameter_mm / 2)
        return None if centre is None else Pose(np.eye(3), centre)


@dataclass(frozen=True, eq=False)
class Balls(Surface):
    """Balls that stand fast to one another, with their centres (N, 3) in one frame.

    Where all centres lie on one line, the turn about it stays open, and their frame's x runs along it.
    """

    names: tuple[str, ...]
    centres_mm: Array = field(repr=False)
    diameters_mm: Array = field(repr=False)
    name: str = ""

    kind = "balls"
    section: SectionKind | None = "circle"

    @staticmethod
    def of(balls: Mapping[str, tuple[float, Sequence[float]]], name: str = "") -> Balls:
        """Of diameters and centres [mm] by name, in any frame; two or more on a line are given x along it."""
        names = tuple(balls)
        centres = np.array([balls[n][1] for n in names], dtype=float).reshape(-1, 3)
        diameters = np.array([balls[n][0] for n in names], dtype=float)
        if len(names) < 2:
            raise InputError('balls need two or more [[ball]]: one alone is kind = "sphere"')
        for n, diameter in zip(names, diameters, strict=True):
            _check_diameter(f"ball {n}: diameter_mm", diameter)
        apart = np.linalg.norm(centres[:, None] - centres, axis=-1)
        touch = apart < (diameters[:, None] + diameters) / 2 - 1e-9
        i, j = np.triu_indices(len(names), 1)
        if np.any(bad := touch[i, j]):
            k = int(np.argmax(bad))
            raise InputError(
                f"balls {names[i[k]]} and {names[j[k]]} stand {apart[i[k], j[k]]:g} mm apart, less than their radii "
                "together: check centre_mm"
            )
        middle = centres.mean(axis=0)
        spread, axes = np.linalg.svd(centres - middle)[1:]
        if len(spread) < 2 or spread[1] < _ON_A_LINE * spread[0]:
            centres = (centres - middle) @ nearest_rotation(axes.T * np.sign(np.linalg.det(axes)))
        return Balls(names, centres, diameters, name)

    @property
    def features(self) -> tuple[str, ...]:  # type: ignore[override] # an attribute of the base
        """The balls."""
        return self.names

    @property
    def on_a_line(self) -> bool:
        """Whether all centres lie on the x axis."""
        return bool(np.all(np.abs(self.centres_mm[:, 1:]) < _ON_A_LINE * np.ptp(self.centres_mm)))

    @property
    def freedom(self) -> tuple[bool, ...]:  # type: ignore[override] # an attribute of the base
        """All but the turn about the line of their centres, where they have one."""
        return (True, True, True, not self.on_a_line, True, True)

    def offset(self, points_mm: Array, feature: Index) -> tuple[Array, Array]:
        """Distance (N, 1) from each point's own ball, positive outside, and its gradient (N, 1, 3)."""
        away = points_mm - self.centres_mm[feature]
        length = np.linalg.norm(away, axis=-1, keepdims=True)
        return length - self.diameters_mm[feature, None] / 2, (away / np.maximum(length, 1e-9))[:, None, :]

    def at_place(self, T_base_target: Pose, sensors_mm: Array) -> dict[str, object]:
        """Each ball's name, centre and diameter."""
        centres = T_base_target @ self.centres_mm
        balls = zip(self.names, centres, self.diameters_mm.tolist(), strict=True)
        return {"balls": [{"name": n, "centre_mm": c, "diameter_mm": d} for n, c, d in balls]}

    def place(self, points_mm: Array, feature: Index) -> Pose | None:
        """Each ball's centre by least squares, and the rigid motion onto them."""
        found = {}
        for k in np.unique(feature):
            centre = sphere_centre(points_mm[feature == k], self.diameters_mm[k] / 2)
            if centre is not None:
                found[int(k)] = centre
        if len(found) < 2:
            return None
        own, there = self.centres_mm[list(found)], np.array(list(found.values()))
        return rigid_motion(own, there)


def sphere_centre(points_mm: Array, radius_mm: float) -> Array | None:
    """Centre (3,) of a sphere of known radius through points (N, 3), by least squares; None where none follows."""
    if len(points_mm) < 4:
        return None
    middle = points_mm.mean(axis=0)
    p = points_mm - middle
    rows = np.column_stack([2 * p, np.ones(len(p))])
    # points of nearly one plane leave the side open: the least step from their middle, then by distance
    solution = np.linalg.lstsq(rows, np.sum(p**2, axis=1), rcond=1e-6)[0]
    starts = [solution[:3]]
    normal = np.linalg.svd(p, full_matrices=False)[2][2]
    depth = np.sqrt(max(radius_mm**2 - float(np.mean(np.sum(p**2, axis=1))), 0.0))
    starts += [depth * normal, -depth * normal]
    best: tuple[float, Array] | None = None
    for start in starts:
        c = start
        for _ in range(_CENTRE_STEPS):
            away = p - c
            length = np.maximum(np.linalg.norm(away, axis=1), 1e-9)
            step = np.linalg.lstsq(-away / length[:, None], -(length - radius_mm), rcond=1e-9)[0]
            c = c + step * min(1.0, radius_mm / max(float(np.linalg.norm(step)), 1e-9))
        cost = float(np.sum((np.linalg.norm(p - c, axis=1) - radius_mm) ** 2))
        if best is None or cost < best[0] * (1 - 1e-9):
            best = cost, c
    return None if best is None else middle + best[1]


def rigid_motion(own: Array, there: Array) -> Pose:
    """The motion (least squares) that carries points (N, 3) onto others."""
    a, b = own.mean(axis=0), there.mean(axis=0)
    R = nearest_rotation((there - b).T @ (own - a))
    return Pose(R, b - R @ a)


def _check_diameter(what: str, value: float) -> None:
    if not (np.isfinite(value) and value > 0):
        raise InputError(f"{what} = {value:g}: must be a positive, finite number of millimetres")
