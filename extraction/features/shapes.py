"""Circles and lines of the laser plane, as scikit-image's RANSAC asks for them: ``from_estimate`` and ``residuals``.

They are fitted by distance, with weights; what three or two points give is exact.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

_STEPS = 30  # of Gauss and Newton; an arc that has not settled by then is no arc
_SETTLED_MM = 1e-10
_MOST_RADII = 1e6  # of the points' spread: a larger circle is a line to the last digit


@dataclass(frozen=True, eq=False)
class Circle:
    """A circle in (y, z): centre (2,) and radius [mm]."""

    centre_mm: Array
    radius_mm: float

    @classmethod
    def through(cls, yz_mm: Array) -> Circle | None:
        """Through three points (3, 2); None where they lie on a line."""
        a, b = yz_mm[1] - yz_mm[0], yz_mm[2] - yz_mm[0]
        area = 2 * (a[0] * b[1] - a[1] * b[0])
        if area == 0:
            return None
        away = np.array([b[1] * (a @ a) - a[1] * (b @ b), a[0] * (b @ b) - b[0] * (a @ a)]) / area
        radius = float(np.hypot(*away))
        return cls(yz_mm[0] + away, radius) if np.isfinite(radius) and radius > 0 else None

    @classmethod
    def fit(cls, yz_mm: Array, weight: Array) -> Circle | None:
        """By distance, begun from the algebraic circle."""
        start = _algebraic_circle(yz_mm, weight)
        return None if start is None else _geometric_circle(start, yz_mm, weight)

    def residuals(self, yz_mm: Array) -> Array:
        """Distances from the circle, positive outside."""
        return np.asarray(np.hypot(*(yz_mm - self.centre_mm).T) - self.radius_mm)

    def normals(self, yz_mm: Array) -> Array:
        """Away from the centre."""
        out = yz_mm - self.centre_mm
        return np.asarray(out / np.maximum(np.hypot(*out.T), 1e-12)[:, None])

    def arc_rad(self, yz_mm: Array) -> float:
        """The angle that points of the circle span, seen from its centre: the turn without the largest gap."""
        angle = np.sort(np.arctan2(*(yz_mm - self.centre_mm).T[::-1]))
        gaps = np.diff(np.append(angle, angle[0] + 2 * np.pi))
        return float(2 * np.pi - gaps.max())


@dataclass(frozen=True, eq=False)
class Line:
    """A straight line in (y, z): a point of it (2,) and its unit direction (2,), towards +y."""

    origin_mm: Array
    direction: Array

    @classmethod
    def through(cls, yz_mm: Array) -> Line | None:
        """Through two points (2, 2); None where they are one."""
        step = yz_mm[1] - yz_mm[0]
        length = float(np.hypot(*step))
        if length == 0:
            return None
        towards_y = step[0] > 0 or (step[0] == 0 and step[1] > 0)
        return cls(yz_mm[0], step / length if towards_y else -step / length)

    @classmethod
    def fit(cls, yz_mm: Array, weight: Array) -> Line | None:
        """By perpendicular distance."""
        share = weight / np.sum(weight)
        centre = share @ yz_mm
        off = yz_mm - centre
        _, vectors = np.linalg.eigh((off * share[:, None]).T @ off)
        direction = vectors[:, 1]
        towards_y = direction[0] > 0 or (direction[0] == 0 and direction[1] > 0)
        return cls(centre, direction if towards_y else -direction)

    def residuals(self, yz_mm: Array) -> Array:
        """Distances from the line, positive where z is larger."""
        return np.asarray((yz_mm - self.origin_mm) @ self.normal)

    def normals(self, yz_mm: Array) -> Array:
        """The line's one normal."""
        return np.broadcast_to(self.normal, yz_mm.shape)

    @property
    def normal(self) -> Array:
        """Unit normal (2,), towards +z."""
        return np.array([-self.direction[1], self.direction[0]])

    def along(self, yz_mm: Array) -> Array:
        """Places (N,) [mm] of points along the line, from its origin."""
        return np.asarray((yz_mm - self.origin_mm) @ self.direction)

    def meets(self, other: Line) -> Array | None:
        """Where two lines cross (2,); None where they are parallel."""
        across = np.column_stack([self.direction, -other.direction])
        if abs(np.linalg.det(across)) < 1e-9:
            return None
        s = np.linalg.solve(across, other.origin_mm - self.origin_mm)
        return np.asarray(self.origin_mm + s[0] * self.direction)


def _algebraic_circle(yz: Array, weight: Array) -> Circle | None:
    """From |p|² = 2 c·p + k, linear in centre and k; exact for three points."""
    middle = yz.mean(axis=0)
    p = yz - middle
    spread = float(np.sqrt(np.mean(np.sum(p**2, axis=1))))
    if spread <= 0:
        return None
    p = p / spread
    rows = np.column_stack([2 * p, np.ones(len(p))])
    root = np.sqrt(weight)
    solution, _, rank, _ = np.linalg.lstsq(rows * root[:, None], np.sum(p**2, axis=1) * root, rcond=1e-12)
    square = solution[2] + solution[:2] @ solution[:2]
    if rank < 3 or not 0 < square < _MOST_RADII**2:
        return None
    return Circle(middle + spread * solution[:2], spread * float(np.sqrt(square)))


def _geometric_circle(start: Circle, yz: Array, weight: Array) -> Circle | None:
    """Gauss and Newton on the distances; None where they do not settle."""
    centre, radius, root = start.centre_mm, start.radius_mm, np.sqrt(weight)
    for _ in range(_STEPS):
        away = yz - centre
        distance = np.hypot(*away.T)
        if np.any(distance <= 0):
            return None
        rows = np.column_stack([-away / distance[:, None], -np.ones(len(yz))])
        step = np.linalg.lstsq(rows * root[:, None], -(distance - radius) * root, rcond=None)[0]
        centre, radius = centre + step[:2], radius + float(step[2])
        if not 0 < radius < _MOST_RADII * start.radius_mm:
            return None
        if np.max(np.abs(step)) < _SETTLED_MM * max(1.0, radius):
            return Circle(centre, radius)
    return None
