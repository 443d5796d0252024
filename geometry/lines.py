"""Straight lines in space and where they cross the laser plane."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]


def cross_plane_x0(points: ArrayLike, directions: ArrayLike) -> tuple[Array, Array]:
    """Where lines cross the plane x = 0.

    points, directions: (..., 3) [mm], any frame whose x = 0 is the laser plane; directions of any length.
    Returns the crossing points (..., 3), NaN for a line parallel to the plane, and s with p = point + s · direction.
    """
    p, d = np.asarray(points, dtype=float), np.asarray(directions, dtype=float)
    parallel = np.abs(d[..., 0]) <= 1e-12 * np.linalg.norm(d, axis=-1)
    s = np.where(parallel, np.nan, -p[..., 0] / np.where(parallel, 1.0, d[..., 0]))
    return p + s[..., None] * d, s


def distance_to_line(points: ArrayLike, line_points: ArrayLike, unit_directions: ArrayLike) -> Array:
    """Perpendicular distance (...) [mm] of points (..., 3) from lines through (..., 3) along unit vectors (..., 3)."""
    offset = np.asarray(points, dtype=float) - np.asarray(line_points, dtype=float)
    return np.asarray(np.linalg.norm(np.cross(offset, np.asarray(unit_directions, dtype=float)), axis=-1))
