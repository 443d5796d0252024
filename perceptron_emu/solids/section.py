"""The laser in one plane of the sheet: which pieces of the solids it reaches first, exactly."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from geometry.compiled import kernel

Array = NDArray[np.float64]

GRID_RAD = 2e-3  # breakpoints at least this close, so that bodies that interpenetrate are told apart


@kernel
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


@kernel
def lit_in_planes(triangles, normals, planes, shades, shading, origin, fan_rad):  # type: ignore[no-untyped-def]
    """The pieces of triangles (T, 3, 3) [mm] that the laser reaches first in the planes of constant x (K,).

    normals: at the triangles' corners (T, 3, 3). shades: segments (K, S, 2, 2) as (y, z) in each plane that only
    cast shadows, where shading (K, S) says so. origin: the emitter's (y, z).
    Returns ends (n, 2, 3) [mm], normals there (n, 2, 3), triangle numbers (n,).
    """
    grid = _grid(fan_rad)
    ends, normal, face = np.empty((256, 2, 3)), np.empty((256, 2, 3)), np.empty(256, np.int64)
    n = 0
    for k in range(len(planes)):
        cut, turned, owner = cut_plane(triangles, normals, planes[k])
        solids = len(cut)
        segments = np.concatenate((cut, shades[k][shading[k]]))
        which, where = _first_reached(segments, origin, grid)
        if n + len(which) > len(face):
            more = max(2 * len(face), n + len(which))
            ends, normal, face = _longer(ends, more), _longer(normal, more), _longer_int(face, more)
        for i in range(len(which)):
            w = which[i]
            if w >= solids:
                continue
            for e in range(2):
                ends[n, e, 0] = planes[k]
                for a in range(2):
                    ends[n, e, 1 + a] = cut[w, 0, a] + where[i, e] * (cut[w, 1, a] - cut[w, 0, a])
                for a in range(3):
                    normal[n, e, a] = turned[w, 0, a] + where[i, e] * (turned[w, 1, a] - turned[w, 0, a])
            face[n] = owner[w]
            n += 1
    return ends[:n].copy(), normal[:n].copy(), face[:n].copy()


@kernel
def _longer(values, size):  # type: ignore[no-untyped-def]
    out = np.empty((size, values.shape[1], values.shape[2]))
    out[: len(values)] = values
    return out


@kernel
def _longer_int(values, size):  # type: ignore[no-untyped-def]
    out = np.empty(size, np.int64)
    out[: len(values)] = values
    return out


@kernel
def _grid(fan_rad):  # type: ignore[no-untyped-def]
    return np.linspace(-fan_rad / 2, fan_rad / 2, int(fan_rad / GRID_RAD) + 2)


@kernel
def _first_reached(ends, origin, grid):  # type: ignore[no-untyped-def]
    """The pieces of segments (n, 2, 2) as (y, z) [mm] that rays from the origin (2,) reach first within the fan about
    +z.

    grid: angles that the fan is cut at in any case, from edge to edge.
    Returns which segment (m,) and where along it the piece lies (m, 2), in [0, 1]. Source: the angular sweep of planar
    visibility (Suri & O'Rourke 1986): between two neighbouring ends the nearest segment does not change.
    """
    n = len(ends)
    angle, breaks = np.empty((n, 2)), np.empty(2 * n + len(grid))
    breaks[: len(grid)] = grid
    count = len(grid)
    for i in range(n):
        first = math.atan2(ends[i, 0, 0] - origin[0], ends[i, 0, 1] - origin[1])
        second = math.atan2(ends[i, 1, 0] - origin[0], ends[i, 1, 1] - origin[1])
        angle[i, 0], angle[i, 1] = min(first, second), max(first, second)
        if angle[i, 1] - angle[i, 0] > math.pi:  # passes behind the emitter
            angle[i] = 10.0
        for a in angle[i]:
            if grid[0] <= a <= grid[-1]:
                breaks[count] = a
                count += 1
    breaks = np.sort(breaks[:count])
    by_start = np.argsort(angle[:, 0], kind="mergesort")
    which, where = np.empty(len(breaks), np.int64), np.empty((len(breaks), 2))
    m = _sweep(ends, origin, angle, breaks, by_start, which, where)
    return which[:m], where[:m]


@kernel
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


@kernel(inline=True)
def _reach(segment, origin, angle):  # type: ignore[no-untyped-def]
    """Distance along the ray at the angle to the segment's line, and the place on it."""
    ry, rz = math.sin(angle), math.cos(angle)
    ey, ez = segment[1, 0] - segment[0, 0], segment[1, 1] - segment[0, 1]
    py, pz = segment[0, 0] - origin[0], segment[0, 1] - origin[1]
    det = ry * ez - rz * ey
    if det == 0:
        return -1.0, 0.0
    return (py * ez - pz * ey) / det, (py * rz - pz * ry) / det
