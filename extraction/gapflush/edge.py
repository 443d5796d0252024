"""A panel's edge: a straight face that bends away from the sensor along a circle tangent to it, fitted in one."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from extraction.config import GapFlushConfig
from extraction.gapflush.faces import PanelFace, fit_line
from geometry.ties import first_least

if TYPE_CHECKING:
    from scipy.optimize import OptimizeResult

Array = NDArray[np.float64]
Indices = NDArray[np.intp]

_FEWEST_BEND_POINTS = 3  # a circle tangent to the face has two unknowns, and one to spare
_SCALE = (0.01, 0.05, 0.5, 0.5)  # of angle [rad], offset, tangent, radius [mm]: the size of their steps
_MOST_SKIPPED = 3  # stray points in a row that do not end a bend
_SAME_COST = 1e-6  # in σ: of start values as good as each other the first is taken
KNOWN_MM = 1e-4  # σ of a radius that is told: a certificate's
_GRID = 16  # start values of radius, and of where the bend begins


@dataclass(frozen=True, eq=False)
class PanelEdge:
    """One panel at its edge, by p = (angle, offset, tangent, radius) in the frame of its face.

    origin: (y, z) of that frame (2,); its axis s runs along the face towards the gap, its axis d away from the sensor.
    side: +1 for the left panel, whose gap lies towards +y, -1 for the right one.
    parameters: angle of the face against the first estimate [rad], offset of the face at s = 0, where the bend begins,
    radius [mm] (4,); covariance (4, 4). radius 0: a sharp edge, at the tangent.
    face: indices of the face's points near its end.
    used: indices of the profile's points in the fit. arc_rad: how much of the bend was seen. chi2_per_dof: of the fit.
    """

    origin: Array
    direction: Array
    side: float
    parameters: Array
    covariance: Array
    face: Indices
    used: Indices
    arc_rad: float
    chi2_per_dof: float

    def face_direction(self, p: Array) -> Array:
        """Unit direction (2,) of the face towards +y."""
        turn = self.side * p[0]
        c, s = np.cos(turn), np.sin(turn)
        return np.asarray(np.array([[c, -s], [s, c]]) @ self.direction)

    def tangent_point(self, p: Array) -> Array:
        """Where the face ends and the bend begins (2,)."""
        along = self.face_direction(p)
        return np.asarray(self.origin + self.side * p[2] * along + p[1] * _normal(along))

    def centre(self, p: Array) -> Array:
        """Centre of the bend (2,)."""
        return np.asarray(self.tangent_point(p) + p[3] * _normal(self.face_direction(p)))

    def bend_point(self, p: Array, turn_rad: float) -> Array:
        """The point of the bend (2,) where the surface has turned so far from its face."""
        along = self.face_direction(p)
        away = np.sin(turn_rad) * self.side * along - np.cos(turn_rad) * _normal(along)
        return np.asarray(self.centre(p) + p[3] * away)

    def sharp_point(self, p: Array) -> Array:
        """Where the face, extended, meets the line square to it at the bend's end (2,)."""
        return np.asarray(self.tangent_point(p) + self.side * p[3] * self.face_direction(p))

    def extreme_point(self, p: Array, towards: Array) -> Array:
        """The point of the bend furthest along the unit vector ``towards`` (2,)."""
        return np.asarray(self.centre(p) + p[3] * towards)


def fit_edge(
    yz: Array,
    cov: Array,
    face: PanelFace,
    side: float,
    tolerance: float,
    config: GapFlushConfig,
    last: int | None = None,
    fixed: float | None = None,
) -> tuple[PanelEdge, Indices]:
    """The edge of the panel with that face, on its side towards the gap (+1: the left panel).

    Weighted robust least squares over the last ``face_length_mm`` of the face and the points of the bend, as far as
    ``max_arc_deg``. A face without points of a bend has a sharp edge at its last point, half a step on. last: index of
    the last point that can be the panel's own. fixed: a radius that is known. Returned with the indices of the points
    after the face, in order.
    """
    near = _near_end(yz, face, side, tolerance, config)
    origin, direction = fit_line(yz[near])
    frame = PanelFace(origin, direction, face.first, face.last)
    sd = np.column_stack([side * (yz - origin) @ direction, frame.depth(yz)])
    turned = np.array([side * direction, frame.normal])
    cov = turned @ cov @ turned.T
    bend = _bend_points(sd, face, side, tolerance, config, last)
    if len(bend) >= 2:  # the first points of a bend still count as face
        fit = _fit_bend(sd, cov, near, bend, config, fixed)
        if fit is not None:
            return PanelEdge(origin, direction, side, *fit), bend
    sharp = _sharp(sd, cov, near, bend)
    return PanelEdge(origin, direction, side, *sharp), bend


def _fit_bend(
    sd: Array, cov: Array, near: Indices, bend: Indices, config: GapFlushConfig, fixed: float | None
) -> tuple[Array, Array, Indices, Indices, float, float] | None:
    """Parameters, covariance, points used, arc and χ² of face and bend in one; None where no bend remains."""
    every, end = np.concatenate([near, bend]), float(sd[near, 0].max())
    max_arc = np.deg2rad(config.max_arc_deg)
    spread = _sigma(np.zeros(4), sd[every], cov[every])
    best = _solve(_best_of_grid(sd[every], spread, end, config, fixed), sd[every], spread, end, config, fixed)
    for _ in range(4):  # leave out what lies beyond the arc, weigh the rest across the curve
        low_enough = sd[every, 1] - best.x[1] <= best.x[3] * (1 - np.cos(max_arc)) + 2 * config.tolerance_mm
        used = every[(_arc(best.x, sd[every]) <= max_arc) & low_enough]
        if np.sum(_arc(best.x, sd[used]) > 0) < _FEWEST_BEND_POINTS:
            return None
        spread = _sigma(best.x, sd[used], cov[used])
        best = _solve(best.x, sd[used], spread, end, config, fixed)
    freedom = max(len(used) - 4, 1)
    chi2 = float(np.sum(_off(best.x, sd[used], spread) ** 2)) / freedom
    covariance = np.linalg.pinv(best.jac.T @ best.jac) * max(chi2, 1.0)
    return best.x, covariance, near, np.sort(used), float(_arc(best.x, sd[used]).max()), chi2


def _best_of_grid(sd: Array, sigma: Array, end: float, config: GapFlushConfig, fixed: float | None) -> Array:
    """Start values: the best of a grid of radii and of places where the bend begins, the face as it is."""
    radii = np.geomspace(0.1, config.max_radius_mm, _GRID) if fixed is None else np.array([fixed])
    trials = [
        np.array([0.0, 0.0, end - back * radius, radius]) for radius in radii for back in np.linspace(-0.2, 1.0, _GRID)
    ]
    costs = [float(np.sum(np.minimum(np.abs(_off(p, sd, sigma)), 20.0))) for p in trials]
    return trials[first_least(costs, _SAME_COST)]


def _solve(
    start: Array, sd: Array, sigma: Array, end: float, config: GapFlushConfig, fixed: float | None
) -> OptimizeResult:
    from scipy.optimize import least_squares  # a third of a second, and most commands need none of it

    top = config.max_radius_mm
    low, high = [-0.5, -1.0, end - 2 * top, 0.01], [0.5, 1.0, end + top, top]
    start = np.clip(start, np.add(low, 1e-6), np.subtract(high, 1e-6))
    return least_squares(
        _off_and_known, start, bounds=(low, high), args=(sd, sigma, fixed), loss="soft_l1", f_scale=2.0, x_scale=_SCALE
    )


def _off_and_known(p: Array, sd: Array, sigma: Array, fixed: float | None) -> Array:
    """`_off`, and the radius where it is known."""
    off = _off(p, sd, sigma)
    return off if fixed is None else np.append(off, (p[3] - fixed) / KNOWN_MM)


def _turned(p: Array, sd: Array) -> Array:
    """Places along and below the face (N, 2) in its own frame."""
    c, s = np.cos(p[0]), np.sin(p[0])
    return np.column_stack([c * sd[:, 0] + s * sd[:, 1], c * sd[:, 1] - s * sd[:, 0] - p[1]])


def _off(p: Array, sd: Array, sigma: Array) -> Array:
    """Signed distances (N,) from face or bend, positive towards the inside of the part, over σ."""
    s, d = _turned(p, sd).T
    circle = p[3] - np.hypot(s - p[2], d - p[3])
    return np.asarray(np.where(s <= p[2], d, circle) / sigma)


def _arc(p: Array, sd: Array) -> Array:
    """Angle (N,) of points around the bend's centre from where it begins, 0 on the face, up to π [rad]."""
    s, d = _turned(p, sd).T
    return np.asarray(np.where(s <= p[2], 0.0, np.arctan2(s - p[2], p[3] - d)))


def _sigma(p: Array, sd: Array, cov: Array) -> Array:
    """Standard deviation (N,) of points across the curve, at least a third of the usual one."""
    angle = _arc(p, sd)
    across = np.column_stack([np.sin(angle), -np.cos(angle)])
    sigma = np.sqrt(np.maximum(np.einsum("ni,nij,nj->n", across, cov, across), 0.0))
    return np.asarray(np.maximum(sigma, max(float(np.median(sigma)) / 3, 1e-6)))


def _near_end(yz: Array, face: PanelFace, side: float, tolerance: float, config: GapFlushConfig) -> Indices:
    """Indices of the face's last ``face_length_mm`` before the gap, without stray points.

    A wide tolerance takes a bend's first points for face: where they may lie, none is stray for being off it.
    """
    end = yz[face.last if side > 0 else face.first]
    index = np.arange(face.first, face.last + 1)
    before = np.abs((yz[index] - end) @ face.direction)
    on_line = np.abs(face.depth(yz[index])) <= 3 * max(float(np.median(np.abs(face.depth(yz[index])))), 1e-6)
    bent = before <= np.sqrt(2 * config.max_radius_mm * tolerance)
    return np.asarray(index[(before <= config.face_length_mm) & (on_line | bent)], dtype=np.intp)


def _bend_points(
    sd: Array, face: PanelFace, side: float, tolerance: float, config: GapFlushConfig, last: int | None
) -> Indices:
    """Indices of the points that follow the face's end without a break, as far as a bend can reach."""
    end_index = (len(sd) - 1 if side > 0 else 0) if last is None else last
    ahead = np.arange(face.last + 1, end_index + 1) if side > 0 else np.arange(face.first - 1, end_index - 1, -1)
    here = sd[face.last if side > 0 else face.first]
    end, out, skipped = here[0], [], 0
    for k in ahead:
        if sd[k, 0] - end > config.max_radius_mm or skipped > _MOST_SKIPPED:
            break
        follows = np.hypot(*(sd[k] - here)) <= config.max_step_mm
        if follows and -tolerance < sd[k, 1] < config.max_radius_mm:
            out.append(k)
            here, skipped = sd[k], 0
        else:
            skipped += 1
    return np.array(out, dtype=np.intp)


def _sharp(sd: Array, cov: Array, near: Indices, bend: Indices) -> tuple[Array, Array, Indices, Indices, float, float]:
    """As `_fit_bend`, for an edge without a bend: it lies between the last point and the next, missing one.

    One or two points that leave the face do not make a bend, but widen σ by what they reach.
    """
    s, sigma = sd[near, 0], np.sqrt(np.maximum(cov[near, 1, 1], 1e-12))
    pitch, last = float(np.median(np.diff(np.sort(s)))), float(s.max())
    reach = max(last, float(sd[bend, 0].max(initial=last)))
    j = np.column_stack([s, np.ones_like(s)]) / sigma[:, None]
    chi2 = float(np.sum((sd[near, 1] / sigma) ** 2)) / max(len(s) - 2, 1)
    covariance = np.zeros((4, 4))
    covariance[:2, :2] = np.linalg.inv(j.T @ j) * max(chi2, 1.0)
    covariance[2, 2] = (pitch**2 + (reach - last) ** 2) / 12
    return np.array([0.0, 0.0, reach + pitch / 2, 0.0]), covariance, near, near, 0.0, chi2


def _normal(direction: Array) -> Array:
    return np.array([-direction[1], direction[0]])
