"""The laser in one plane of the sheet: which pieces of the solids it reaches first, exactly."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from geometry.compiled import kernel

Array = NDArray[np.float64]
Index = NDArray[np.int64]

GRID_RAD = 2e-3  # breakpoints at least this close, so that bodies that interpenetrate are told apart

SAME_RAD = 1e-12  # breaks that rounding alone tells apart
BEHIND_RAD = 10.0  # the angle given to what no ray about +z reaches


class Shades(NamedTuple):
    """What only casts shadows in K planes of constant x.

    Parameters
    ----------
    ends : Array
        Segments (K, S, 2, 2) as (y, z) [mm].
    there : NDArray
        Whether each is there (K, S).
    """

    ends: Array
    there: NDArray[np.bool_]


class LaserRays(NamedTuple):
    """The laser in a plane of constant x.

    Parameters
    ----------
    origin : Array
        The emitter's (y, z) (2,) [mm].
    fan_rad : float
        Full angle of the fan about +z.
    """

    origin: Array
    fan_rad: float


class SheetPieces(NamedTuple):
    """Straight pieces of surface that the laser reaches first, each in one plane of the sheet.

    Parameters
    ----------
    ends : Array
        (n, 2, 3) [mm] in {P}.
    normals : Array
        Shading normals at the ends (n, 2, 3).
    face : NDArray
        The triangle (n,).
    """

    ends: Array
    normals: Array
    face: Index


class Segments(NamedTuple):
    """Segments (n, 2, 2) as (y, z) [mm], the angles (n, 2) between which rays meet each, and their order by the
    first.
    """

    ends: Array
    angle: Array
    by_start: Index


class Reached(NamedTuple):
    """Pieces of segments: which segment (m,), and where along it the piece begins and ends (m, 2), in [0, 1]."""

    which: Index
    where: Array


class _Fan(NamedTuple):
    """Angles that the fan is cut at in any case, from edge to edge (G,), and the rays midway between them: sine and
    cosine (G − 1, 2).
    """

    angle: Array
    middle: Array


class _Breaks(NamedTuple):
    """Angles of the fan in order (B,), and of which of its steps each begins one that nothing else cuts (−1: none)."""

    angle: Array
    step: Index


@kernel
def _cut_plane(triangles: Array, normals: Array, spans: Array, x: float) -> tuple[Array, Array, Index]:
    """Where triangles (T, 3, 3) [mm] cut the plane of constant x: ends (n, 2, 2) as (y, z) [mm], normals there (n, 2,
    3), triangle numbers (n,). spans: least and largest x of each (T, 2).
    """
    count = 0
    for i in range(len(triangles)):
        count += spans[i, 0] < x <= spans[i, 1]
    ends, normal, owner = np.empty((count, 2, 2)), np.empty((count, 2, 3)), np.empty(count, np.int64)
    n = 0
    for i in range(len(triangles)):
        if not spans[i, 0] < x <= spans[i, 1]:  # else it has a corner on either side, and two of its edges cross
            continue
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
        owner[n] = i
        n += 1
    return ends, normal, owner


@kernel
def _spans(triangles: Array) -> Array:
    """Least and largest x of triangles (T, 2)."""
    out = np.empty((len(triangles), 2))
    for i in range(len(triangles)):
        a, b, c = triangles[i, 0, 0], triangles[i, 1, 0], triangles[i, 2, 0]
        out[i, 0], out[i, 1] = min(a, b, c), max(a, b, c)
    return out


@kernel
def lit_in_planes(triangles: Array, normals: Array, planes: Array, shades: Shades, rays: LaserRays) -> SheetPieces:
    """The pieces of triangles that the laser reaches first in planes of constant x. Compiled.

    Parameters
    ----------
    triangles : Array
        Corners (T, 3, 3) [mm] in {P}.
    normals : Array
        For shading, at the corners (T, 3, 3).
    planes : Array
        x (K,) [mm].
    shades : Shades
        What else casts shadows in each plane.
    rays : LaserRays
        The emitter and its fan.

    Returns
    -------
    SheetPieces
        In the order of planes and angles.
    """
    fan, spans = _grid(rays.fan_rad), _spans(triangles)
    ends, normal, face = np.empty((256, 2, 3)), np.empty((256, 2, 3)), np.empty(256, np.int64)
    n = 0
    for k in range(len(planes)):
        cut, turned, owner = _cut_plane(triangles, normals, spans, planes[k])
        solids = len(cut)
        which, where = _first_reached(np.concatenate((cut, shades.ends[k][shades.there[k]])), rays.origin, fan)
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
    return SheetPieces(ends[:n].copy(), normal[:n].copy(), face[:n].copy())


@kernel
def _longer(values: Array, size: int) -> Array:
    n, rows, columns = values.shape
    out = np.empty((size, rows, columns))
    for i in range(n):
        for r in range(rows):
            for c in range(columns):
                out[i, r, c] = values[i, r, c]
    return out


@kernel
def _longer_int(values: Index, size: int) -> Index:
    out = np.empty(size, np.int64)
    for i in range(len(values)):
        out[i] = values[i]
    return out


@kernel
def _grid(fan_rad: float) -> _Fan:
    angle = np.linspace(-fan_rad / 2, fan_rad / 2, int(fan_rad / GRID_RAD) + 2)
    middle = np.empty((len(angle) - 1, 2))
    for k in range(len(middle)):
        at = (angle[k] + angle[k + 1]) / 2
        middle[k, 0], middle[k, 1] = math.sin(at), math.cos(at)
    return _Fan(angle, middle)


@kernel
def _first_reached(ends: Array, origin: Array, fan: _Fan) -> Reached:
    """The pieces of segments (n, 2, 2) as (y, z) [mm] that rays from the origin (2,) reach first within the fan about
    +z.

    Source: the angular sweep of planar visibility (Suri & O'Rourke 1986): between two neighbouring ends the nearest
    segment does not change.
    """
    n, grid = len(ends), fan.angle
    angle, own, count = np.empty((n, 2)), np.empty(2 * n), 0
    for i in range(n):
        first = math.atan2(ends[i, 0, 0] - origin[0], ends[i, 0, 1] - origin[1])
        second = math.atan2(ends[i, 1, 0] - origin[0], ends[i, 1, 1] - origin[1])
        angle[i, 0], angle[i, 1] = min(first, second), max(first, second)
        if angle[i, 1] - angle[i, 0] > math.pi:  # passes behind the emitter
            angle[i] = BEHIND_RAD
        for a in angle[i]:
            if grid[0] <= a <= grid[-1]:
                own[count] = a
                count += 1
    by_start = np.argsort(angle[:, 0], kind="mergesort")
    return _sweep(Segments(ends, angle, by_start), _merged(np.sort(own[:count]), grid), fan.middle, origin)


@kernel
def _merged(own: Array, grid: Array) -> _Breaks:
    """Two sorted lists of angles as one."""
    angle, step = np.empty(len(own) + len(grid)), np.empty(len(own) + len(grid), np.int64)
    i, n = 0, 0
    for k in range(len(grid)):
        while i < len(own) and own[i] < grid[k]:
            angle[n], step[n] = own[i], -1
            i, n = i + 1, n + 1
        uncut = i == len(own) or (k + 1 < len(grid) and own[i] >= grid[k + 1])
        angle[n], step[n] = grid[k], k if uncut else -1
        n += 1
    while i < len(own):
        angle[n], step[n] = own[i], -1
        i, n = i + 1, n + 1
    return _Breaks(angle, step)


@kernel
def _sweep(segments: Segments, breaks: _Breaks, rays: Array, origin: Array) -> Reached:
    """From one break of the fan to the next: what is reached first there.

    rays: midway in the steps of the fan that nothing cuts. Where one segment alone is met nothing is compared, and a
    piece's ends are worked out once it is whole.
    """
    ends, angle, by_start = segments
    count = len(breaks.angle)
    which, where = np.empty(count, np.int64), np.empty((count, 2))
    active = np.empty(len(ends), np.int64)
    n_active, following, m = 0, 0, 0
    open_, begin, end = -1, 0.0, 0.0  # the piece that may go on
    for k in range(count - 1):
        a, b = breaks.angle[k], breaks.angle[k + 1]
        if b - a < SAME_RAD:
            continue
        middle = (a + b) / 2
        while following < len(ends) and angle[by_start[following], 0] < middle:
            active[n_active] = by_start[following]
            n_active, following = n_active + 1, following + 1
        kept = 0
        for j in range(n_active):
            if angle[active[j], 1] > middle:
                active[kept] = active[j]
                kept += 1
        n_active = kept
        best = active[0] if n_active == 1 else -1
        if n_active > 1:
            best_distance, step = np.inf, breaks.step[k]
            if step >= 0:
                ry, rz = rays[step, 0], rays[step, 1]
            else:
                ry, rz = math.sin(middle), math.cos(middle)
            for j in range(n_active):
                distance = _distance(ends[active[j]], origin, ry, rz)
                if 0 < distance < best_distance:
                    best, best_distance = active[j], distance
        if best == open_ and best >= 0:
            end = b
            continue
        if open_ >= 0:
            m = _append(
                Reached(which, where), m, open_, _reach(ends[open_], origin, begin), _reach(ends[open_], origin, end)
            )
        open_, begin, end = best, a, b
    if open_ >= 0:
        m = _append(
            Reached(which, where), m, open_, _reach(ends[open_], origin, begin), _reach(ends[open_], origin, end)
        )
    return Reached(which[:m], where[:m])


@kernel
def _append(reached: Reached, m: int, segment: int, from_: float, to: float) -> int:
    """Put a piece on place m; how many there are then."""
    reached.which[m], reached.where[m, 0], reached.where[m, 1] = segment, from_, to
    return m + 1


@kernel(inline=True)
def _distance(segment: Array, origin: Array, ry: float, rz: float) -> float:
    """Distance along the ray (ry, rz) to the segment's line; -1 where they are parallel."""
    ey, ez = segment[1, 0] - segment[0, 0], segment[1, 1] - segment[0, 1]
    det = ry * ez - rz * ey
    if det == 0:
        return -1.0
    distance: float = ((segment[0, 0] - origin[0]) * ez - (segment[0, 1] - origin[1]) * ey) / det
    return distance


@kernel
def _reach(segment: Array, origin: Array, angle: float) -> float:
    """The place on the segment's line that the ray at the angle meets, in units of the segment."""
    ry, rz = math.sin(angle), math.cos(angle)
    ey, ez = segment[1, 0] - segment[0, 0], segment[1, 1] - segment[0, 1]
    py, pz = segment[0, 0] - origin[0], segment[0, 1] - origin[1]
    det = ry * ez - rz * ey
    place: float = 0.0 if det == 0 else (py * rz - pz * ry) / det
    return place
