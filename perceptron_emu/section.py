"""The laser in one plane of the sheet: which pieces of the solids it reaches first, exactly."""

from __future__ import annotations

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

Array = NDArray[np.float64]

GRID_RAD = 2e-3  # breakpoints at least this close, so that bodies that interpenetrate are told apart


@njit(cache=True, error_model="numpy")
def cut_plane(triangles, normals, x):  # type: ignore[no-untyped-def]
    """Where triangles (T, 3, 3) [mm] cut the plane of constant x: ends (n, 2, 2) as (y, z) [mm], normals there (n, 2,
    3), triangle numbers (n,).
    """
    count = 0
    for i in range(len(triangles)):
        lo = min(triangles[i, 0, 0], triangles[i, 1, 0], triangles[i, 2, 0])
        hi = max(triangles[i, 0, 0], triangles[i, 1, 0], triangles[i, 2, 0])
        count += lo < x <= hi
    ends, normal, owner = np.empty((count, 2, 2)), np.empty((count, 2, 3)), np.empty(count, np.int64)
    n = 0
    for i in range(len(triangles)):
        t = triangles[i]
        found = 0
        for a in range(3):
            b = (a + 1) % 3
            if (t[a, 0] < x) != (t[b, 0] < x):
                s = (x - t[a, 0]) / (t[b, 0] - t[a, 0])
                for k in range(2):
                    ends[n, found, k] = t[a, 1 + k] + s * (t[b, 1 + k] - t[a, 1 + k])
                for k in range(3):
                    normal[n, found, k] = normals[i, a, k] + s * (normals[i, b, k] - normals[i, a, k])
                found += 1
        if found == 2:
            owner[n] = i
            n += 1
    return ends[:n], normal[:n], owner[:n]


def first_reached(ends: Array, origin: Array, fan_rad: float) -> tuple[NDArray[np.int64], Array]:
    """The pieces of segments (n, 2, 2) as (y, z) [mm] that rays from the origin (2,) reach first within the fan about
    +z.

    Returns which segment (m,) and where along it the piece lies (m, 2), in [0, 1]. Source: the angular sweep of planar
    visibility (Suri & O'Rourke 1986): between two neighbouring ends the nearest segment does not change.
    """
    towards = ends - origin
    angle = np.sort(np.arctan2(towards[..., 0], towards[..., 1]), axis=1)
    angle[angle[:, 1] - angle[:, 0] > np.pi] = 10.0  # passes behind the emitter
    grid = np.linspace(-fan_rad / 2, fan_rad / 2, int(fan_rad / GRID_RAD) + 2)
    breaks = np.sort(np.concatenate([angle.ravel(), grid]))
    breaks = breaks[(breaks >= grid[0]) & (breaks <= grid[-1])]
    by_start = np.argsort(angle[:, 0], kind="stable")
    which, where = np.empty(len(breaks), np.int64), np.empty((len(breaks), 2))
    m = _sweep(ends, np.array(origin), angle, breaks, by_start, which, where)
    return which[:m], where[:m]


@njit(cache=True, error_model="numpy")
def _sweep(ends, origin, angle, breaks, by_start, which, where):  # type: ignore[no-untyped-def]
    """Fill which and where from the angular order; the number of pieces."""
    active = np.empty(len(ends), np.int64)
    n_active, following, m = 0, 0, 0
    for k in range(len(breaks) - 1):
        a, b = breaks[k], breaks[k + 1]
        if b - a < 1e-12:
            continue
        middle = (a + b) / 2
        while following < len(ends) and angle[by_start[following], 0] < middle:
            active[n_active] = by_start[following]
            n_active, following = n_active + 1, following + 1
        best, best_distance, kept = -1, np.inf, 0
        for j in range(n_active):
            i = active[j]
            if angle[i, 1] <= middle:
                continue
            active[kept] = i
            kept += 1
            distance = _reach(ends[i], origin, middle)[0]
            if 0 < distance < best_distance:
                best, best_distance = i, distance
        n_active = kept
        if best < 0:
            continue
        from_, to = _reach(ends[best], origin, a)[1], _reach(ends[best], origin, b)[1]
        if m > 0 and which[m - 1] == best and abs(where[m - 1, 1] - from_) < 1e-9:
            where[m - 1, 1] = to
        else:
            which[m], where[m, 0], where[m, 1] = best, from_, to
            m += 1
    return m


@njit(cache=True, error_model="numpy", inline="always")
def _reach(segment, origin, angle):  # type: ignore[no-untyped-def]
    """Distance along the ray at the angle to the segment's line, and the place on it."""
    ry, rz = math.sin(angle), math.cos(angle)
    ey, ez = segment[1, 0] - segment[0, 0], segment[1, 1] - segment[0, 1]
    py, pz = segment[0, 0] - origin[0], segment[0, 1] - origin[1]
    det = ry * ez - rz * ey
    if det == 0:
        return -1.0, 0.0
    return (py * ez - pz * ey) / det, (py * rz - pz * ry) / det
