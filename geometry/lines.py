"""Straight lines in space and where they cross the laser plane."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]


def cross_plane_x0(points: ArrayLike, directions: ArrayLike) -> tuple[Array, Array]:
    """Where lines cross the plane x = 0, the laser sheet of {P}.

    Parameters
    ----------
    points, directions : (..., 3)
        A point [mm] of each line and its direction, of any length.

    Returns
    -------
    crossing : (..., 3) array
        [mm]; NaN for a line parallel to the plane.
    s : (...) array
        With crossing = point + s · direction.
    """
    p, d = np.asarray(points, dtype=float), np.asarray(directions, dtype=float)
    parallel = np.abs(d[..., 0]) <= 1e-12 * np.linalg.norm(d, axis=-1)
    s = np.where(parallel, np.nan, -p[..., 0] / np.where(parallel, 1.0, d[..., 0]))
    return p + s[..., None] * d, s


def distance_to_line(points: ArrayLike, line_points: ArrayLike, unit_directions: ArrayLike) -> Array:
    """The perpendicular distance of points from lines.

    Parameters
    ----------
    points : (..., 3)
        [mm]
    line_points : (..., 3)
        A point of each line [mm].
    unit_directions : (..., 3)
        Of length 1; not checked.

    Returns
    -------
    (...) array
        [mm]
    """
    offset = np.asarray(points, dtype=float) - np.asarray(line_points, dtype=float)
    return np.asarray(np.linalg.norm(np.cross(offset, np.asarray(unit_directions, dtype=float)), axis=-1))
