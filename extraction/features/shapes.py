"""Circles and lines of the laser plane, one by one and many at once, as a search by random samples asks for them.

They are fitted by distance, with weights; what three or two points give is exact.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

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
        found = Circles.through(yz_mm[None])
        return found[0] if len(found) else None

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
        found = Lines.through(yz_mm[None])
        return found[0] if len(found) else None

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


@dataclass(frozen=True, eq=False)
class Circles:
    """M circles: centres (M, 2) and radii (M,) [mm]."""

    centre_mm: Array
    radius_mm: Array

    @classmethod
    def through(cls, yz_mm: Array) -> Circles:
        """Through three points each (M, 3, 2), in order; those whose points lie on a line are left out."""
        (ay, az), (by, bz) = (yz_mm[:, 1] - yz_mm[:, 0]).T, (yz_mm[:, 2] - yz_mm[:, 0]).T
        area = 2 * (ay * bz - az * by)
        aa, bb = ay * ay + az * az, by * by + bz * bz
        over = np.where(area == 0, np.nan, area)
        away = np.column_stack([bz * aa - az * bb, ay * bb - by * aa]) / over[:, None]
        radius = np.hypot(*away.T)
        proper = np.isfinite(radius) & (radius > 0)
        return cls((yz_mm[:, 0] + away)[proper], radius[proper])

    def __len__(self) -> int:
        """How many."""
        return len(self.radius_mm)

    def __getitem__(self, k: int) -> Circle:
        """One of them."""
        return Circle(self.centre_mm[k], float(self.radius_mm[k]))

    def only(self, which: Mask) -> Circles:
        """Those chosen (M,)."""
        return Circles(self.centre_mm[which], self.radius_mm[which])

    def near(self, yz_mm: Array, distance_mm: float) -> Mask:
        """Which points (N, 2) lie nearer than a distance to each circle (M, N)."""
        y, z = yz_mm.T[:, None] - self.centre_mm.T[:, :, None]
        square = y * y + z * z
        inner = np.maximum(self.radius_mm - distance_mm, 0.0)
        low = np.where(self.radius_mm > distance_mm, inner**2, -1.0)  # within a tiny circle all is near
        high = (self.radius_mm + distance_mm) ** 2
        return np.asarray((square > low[:, None]) & (square < high[:, None]))


@dataclass(frozen=True, eq=False)
class Lines:
    """M straight lines: a point of each (M, 2) and unit directions (M, 2), towards +y."""

    origin_mm: Array
    direction: Array

    @classmethod
    def through(cls, yz_mm: Array) -> Lines:
        """Through two points each (M, 2, 2), in order; those whose points are one are left out."""
        step = yz_mm[:, 1] - yz_mm[:, 0]
        length = np.hypot(*step.T)
        proper = length > 0
        step, length = step[proper], length[proper]
        towards_y = (step[:, 0] > 0) | ((step[:, 0] == 0) & (step[:, 1] > 0))
        return cls(yz_mm[proper, 0], step / np.where(towards_y, length, -length)[:, None])

    def __len__(self) -> int:
        """How many."""
        return len(self.direction)

    def __getitem__(self, k: int) -> Line:
        """One of them."""
        return Line(self.origin_mm[k], self.direction[k])

    def only(self, which: Mask) -> Lines:
        """Those chosen (M,)."""
        return Lines(self.origin_mm[which], self.direction[which])

    def near(self, yz_mm: Array, distance_mm: float) -> Mask:
        """Which points (N, 2) lie nearer than a distance to each line (M, N)."""
        y, z = yz_mm.T[:, None] - self.origin_mm.T[:, :, None]
        return np.asarray(np.abs(z * self.direction[:, :1] - y * self.direction[:, 1:]) < distance_mm)


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
