"""The laser in one plane of the sheet: which pieces of the solids it reaches first, exactly."""

from __future__ import annotations

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

Array = NDArray[np.float64]

GRID_RAD = 2e-3  # breakpoints at least this close, so that bodies that interpenetrate are told apart


@njit(cache=True)
def cut_plane(triangles, normals, x):  # type: ignore[no-untyped-def]
    """Where triangles (T, 3, 3) [mm] cut the plane of constant x: ends (n, 2, 2) as (y, z) [mm], normals there (n, 2, 3), triangle numbers (n,)."""
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


@njit(cache=True)
def first_reached(ends, origin, fan_rad):  # type: ignore[no-untyped-def]
    """The pieces of segments (n, 2, 2) as (y, z) [mm] that rays from the origin (2,) reach first within the fan about +z.

    Returns which segment (m,) and where along it the piece lies (m, 2), in [0, 1]. Source: the angular sweep of planar visibility.
    """
    n = len(ends)
    low, high = np.empty(n), np.empty(n)
    for i in range(n):
        a = math.atan2(ends[i, 0, 0] - origin[0], ends[i, 0, 1] - origin[1])
        b = math.atan2(ends[i, 1, 0] - origin[0], ends[i, 1, 1] - origin[1])
        low[i], high[i] = min(a, b), max(a, b)
        if high[i] - low[i] > math.pi:  # passes behind the emitter
            low[i], high[i] = 10.0, 10.0
    grid = int(fan_rad / GRID_RAD) + 2
    breaks = np.empty(2 * n + grid)
    breaks[:n], breaks[n : 2 * n] = low, high
    breaks[2 * n :] = np.linspace(-fan_rad / 2, fan_rad / 2, grid)
    breaks.sort()
    by_start = np.argsort(low)
    active = np.empty(n, np.int64)
    n_active, following = 0, 0
    which, where = np.empty(len(breaks), np.int64), np.empty((len(breaks), 2))
    m = 0
    for k in range(len(breaks) - 1):
        a, b = breaks[k], breaks[k + 1]
        if a < -fan_rad / 2 or b > fan_rad / 2 or b - a < 1e-12:
            continue
        middle = (a + b) / 2
        while following < n and low[by_start[following]] < middle:
            active[n_active] = by_start[following]
            n_active, following = n_active + 1, following + 1
        best, best_distance, kept = -1, np.inf, 0
        for j in range(n_active):
            i = active[j]
            if high[i] <= middle:
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
    return which[:m], where[:m]


@njit(cache=True, inline="always")
def _reach(segment, origin, angle):  # type: ignore[no-untyped-def]
    """Distance along the ray at the angle to the segment's line, and the place on it."""
    ry, rz = math.sin(angle), math.cos(angle)
    ey, ez = segment[1, 0] - segment[0, 0], segment[1, 1] - segment[0, 1]
    py, pz = segment[0, 0] - origin[0], segment[0, 1] - origin[1]
    det = ry * ez - rz * ey
    if det == 0:
        return -1.0, 0.0
    return (py * ez - pz * ey) / det, (py * rz - pz * ry) / det
