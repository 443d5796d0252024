"""Labels without any guess for any set of lines: planes that may cut the jig, and who explains the spots.

A sheet cuts the strings at points whose mutual distances depend on the plane alone: two slopes and a height. A grid of
planes covers all that the largest tilt allows, each with what its distances may be anywhere in its cell. Spots go to
one string after another; a partial assignment lives while some plane explains all its distances (Grimson &
Lozano-Pérez 1987, with the planes as a common explanation in place of separate gates). The number of assignments that
live on is bounded, and so is the time. Which of them is true, and whether any is, the evidence decides afterwards.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from geometry import Pose
from geometry.ties import ascending, first_least_of_each
from jig_cad import Jig

Array = NDArray[np.float64]
IntArray = NDArray[np.intp]
Mask = NDArray[np.bool_]
Words = NDArray[np.uint64]

CELL_MM = 5.0  # between planes, along x where the jig is widest: half of it is a cell's reach
SLOPE_STEP = (0.1, 0.5)  # between planes, least and most: for wide jigs the cells grow, for narrow ones they end
LEVELS = 18  # heights of planes over the jig's extent
CURVED = 1.2  # of the first-order reach of a cell, for what the second order adds
BEYOND = 0.05  # share of its length by which a string may be crossed beyond its anchors
FOUND = 5  # strings that determine a pose and leave a check of it
MOST_MISSING = 2  # strings passed over on the way to five
MOST_SPOTS = 20  # best score first; the number of assignments grows with its fifth power
MOST_PARTIAL = 20_000  # assignments that live on from string to string
MOST_RANKED = 4_000  # assignments whose planes are compared point by point
SAME_NATS, SAME_MM2 = 1e-6, 1e-6  # assignments nearer than this are equal, and the first is taken
CHUNK = 2_000  # assignments extended at a time, for the memory's sake


@dataclass(frozen=True, eq=False)
class Assignments:
    """Labellings (H, S), -1 where none, best first, and a pose T_sensor_jig (H) near which each may fit."""

    labels: IntArray
    T_sensor_jig: Pose


@dataclass(frozen=True, eq=False)
class _Planes:
    """Planes (G) that cut five strings or more, for the strings searched (S).

    normal, e1, e2 (G, 3): right-handed axes in {J}. points (G, S, 3): crossings in {J}, NaN where there is none.
    distance, reach (G, S, S): between crossings, and how far that may change within the plane's cell.
    """

    normal: Array
    e1: Array
    e2: Array
    points: Array
    distance: Array
    reach: Array


def any_labels(
    yz_mm: Array, log_odds: Array, jig: Jig, tolerance_mm: float, max_tilt_rad: float, limit: int
) -> Assignments:
    """Assignments of five spots to strings that some plane within the largest tilt explains.

    Parameters
    ----------
    yz_mm : (N, 2) spots as axis points, within ``tolerance_mm`` of it, best score first.
    log_odds : (N,) of being a string's spot.
    max_tilt_rad : largest angle between the jig's axis and the plane's normal.
    limit : of assignments returned.
    """
    spots, odds = yz_mm[:MOST_SPOTS], log_odds[:MOST_SPOTS]
    count = len(jig.strings)
    none = Assignments(np.zeros((0, count), dtype=np.intp), Pose(np.zeros((0, 3, 3)), np.zeros((0, 3))))
    if len(spots) < FOUND or count < FOUND:
        return none
    planes = _planes(jig, max_tilt_rad)
    if len(planes.normal) == 0:
        return none
    labels, alive = _search(spots, odds, planes, tolerance_mm)
    if len(labels) == 0:
        return none
    return _ranked(labels, alive, spots, planes, count, limit)


def first_images(assigned: Assignments, jig: Jig) -> Assignments:
    """Every labelling by the first, in the order of its spots, of those that the jig's symmetries make of it; once."""
    labels, T = assigned.labels.copy(), assigned.T_sensor_jig
    R, t = T.R.copy(), T.t.copy()
    for symmetry in jig.symmetries:
        image = assigned.labels[:, [jig.strings.index(symmetry.renaming[s]) for s in jig.strings]]
        rows = np.arange(len(labels))
        differ = np.argmax(image != labels, axis=1)
        less = np.flatnonzero(image[rows, differ] < labels[rows, differ])
        turned = T[less] @ symmetry.pose
        labels[less], R[less], t[less] = image[less], turned.R, turned.t
    once = np.sort(np.unique(labels, axis=0, return_index=True)[1])
    return Assignments(labels[once], Pose(R[once], t[once]))


@lru_cache(maxsize=8)
def _planes(jig: Jig, max_tilt_rad: float) -> _Planes:
    """The grid of planes; of more than FOUND + MOST_MISSING strings the first."""
    used = slice(FOUND + MOST_MISSING)
    starts, along = jig.starts[used], (jig.ends - jig.starts)[used]
    axis = jig.axis
    first = np.cross(axis, [0.0, 1.0, 0.0] if abs(axis[1]) < 0.6 else [0.0, 0.0, 1.0])
    first = first / np.linalg.norm(first)
    across = np.stack([first, np.cross(axis, first)])
    anchors = jig.anchors_mm[jig.used_anchors]
    middle = anchors.mean(axis=0)
    height = (anchors - middle) @ axis
    step = np.ptp(height) / LEVELS
    levels = np.linspace(height.min(), height.max(), LEVELS + 1)
    sideways = np.linalg.norm((anchors - middle) @ across.T, axis=1)
    tilt = float(np.clip(CELL_MM / np.max(sideways), *SLOPE_STEP))
    slopes = _slopes(np.tan(max_tilt_rad), tilt)
    g = np.repeat(slopes, len(levels), axis=0)
    h = np.tile(levels, len(slopes))

    def cut(g: Array, h: Array) -> tuple[Array, Array]:
        """Crossings (..., S, 3) of the planes, and how far along each string they lie (..., S)."""
        normal = axis - g @ across
        with np.errstate(divide="ignore", invalid="ignore"):
            share = ((normal @ middle + h)[..., None] - normal @ starts.T) / (normal @ along.T)
        return starts + share[..., None] * along, share

    points, share = cut(g, h)
    inside = (share > -BEYOND) & (share < 1 + BEYOND)
    keep = inside.sum(axis=1) >= FOUND
    g, h, points = g[keep], h[keep], np.where(inside[keep, :, None], points[keep], np.nan)
    half = [tilt / 2, tilt / 2, step / 2]
    moves = [_apart(cut(g + d[:2], h + d[2])[0]) - _apart(cut(g - d[:2], h - d[2])[0]) for d in np.diag(half)]
    reach = CURVED / 2 * sum(np.abs(m) for m in moves)
    normal = axis - g @ across
    normal = normal / np.linalg.norm(normal, axis=1, keepdims=True)
    e1 = across[0] - (normal @ across[0])[:, None] * normal
    e1 = e1 / np.linalg.norm(e1, axis=1, keepdims=True)
    return _Planes(normal, e1, np.cross(normal, e1), points, _apart(points), np.asarray(reach))


def _slopes(largest: float, step: float) -> Array:
    """Slopes (K, 2) of planes against the jig's cross-section, on a square grid within a disc."""
    line = step * np.arange(-np.ceil(largest / step), np.ceil(largest / step) + 1)
    grid = np.stack(np.meshgrid(line, line, indexing="ij"), -1).reshape(-1, 2)
    return np.asarray(grid[np.linalg.norm(grid, axis=1) <= largest + step / 2])


def _apart(points: Array) -> Array:
    return np.asarray(np.linalg.norm(points[..., :, None, :] - points[..., None, :, :], axis=-1))


def _search(spots: Array, odds: Array, planes: _Planes, tolerance_mm: float) -> tuple[IntArray, Words]:
    """Assignments (H, S) of FOUND spots, and the planes (H, W) that explain each, a bit a plane."""
    strings, n = planes.points.shape[1], len(spots)
    crossed = np.isfinite(planes.points[..., 0])
    gates = _gates(spots, planes, tolerance_mm)
    opened = {pair: np.any(gate, axis=2) for pair, gate in gates.items()}
    missing = min(strings - FOUND, MOST_MISSING)
    labels = np.full((1, 0), -1, dtype=np.intp)
    alive = _packed(np.ones((1, len(crossed)), dtype=bool))
    for s in range(strings):
        own = _packed(crossed[None, :, s])
        out_labels, out_alive = [np.zeros((0, s + 1), dtype=np.intp)], [alive[:0]]
        for k in range(0, len(labels), CHUNK):
            part, live = labels[k : k + CHUNK], alive[k : k + CHUNK]
            full = np.sum(part >= 0, axis=1) == FOUND
            passed = np.flatnonzero(full | (np.sum(part < 0, axis=1) < missing))
            pairs = np.broadcast_to(~full[:, None], (len(part), n)).copy()
            for t in range(s):  # what a gate of its own rules out needs no look at the planes
                pairs &= opened[t, s][part[:, t]]
            row, spot = np.nonzero(pairs)
            explained = live[row] & own
            for t in reversed(range(s)):
                explained &= gates[t, s][part[row, t], spot]
                living = np.flatnonzero(np.any(explained, axis=1))
                row, spot, explained = row[living], spot[living], explained[living]
            skipped = np.full(len(passed), -1)
            out_labels += [np.column_stack([part[row], spot]), np.column_stack([part[passed], skipped])]
            out_alive += [explained, live[passed]]
        labels, alive = np.concatenate(out_labels), np.concatenate(out_alive)
        likely = _likeliest(labels, odds, MOST_PARTIAL)
        labels, alive = labels[likely], alive[likely]
    full = np.flatnonzero(np.sum(labels >= 0, axis=1) == FOUND)
    full = full[_likeliest(labels[full], odds, MOST_RANKED)]
    return labels[full], alive[full]


def _likeliest(labels: IntArray, odds: Array, most: int) -> IntArray:
    """The ``most`` assignments of the likeliest spots, in their order."""
    if len(labels) <= most:
        return np.arange(len(labels))
    worth = np.sum(np.where(labels >= 0, odds[labels], 0.0), axis=1)
    return np.sort(ascending(-worth, SAME_NATS)[:most])


def _gates(spots: Array, planes: _Planes, tolerance_mm: float) -> dict[tuple[int, int], Words]:
    """Which planes explain spot i on string t beside spot j on string s: by (t, s), (N + 1, N, W); i = N is no spot."""
    n, d = len(spots), _apart(spots)
    i, j = np.triu_indices(n, 1)
    out = {}
    for s in range(planes.points.shape[1]):
        for t in range(s):
            miss = np.abs(d[i, j][:, None] - planes.distance[:, t, s])  # NaN, and so no gate, where one is not crossed
            bits = _packed(miss <= planes.reach[:, t, s] + 2 * tolerance_mm)
            gate = np.zeros((n + 1, n, bits.shape[1]), dtype=np.uint64)
            gate[i, j] = gate[j, i] = bits
            gate[n] = ~np.uint64(0)
            out[t, s] = gate
    return out


def _packed(mask: Mask) -> Words:
    """Bits of the last axis, in words of 64, filled up with zeros."""
    size = mask.shape[-1]
    padded = np.zeros((*mask.shape[:-1], -(-size // 64) * 64), dtype=bool)
    padded[..., :size] = mask
    return np.packbits(padded, axis=-1).view(np.uint64)


def _ranked(labels: IntArray, alive: Words, spots: Array, planes: _Planes, strings: int, limit: int) -> Assignments:
    """The assignments whose spots lie best on one of their planes, seen from either side, with the pose of that."""
    bits = np.unpackbits(alive.view(np.uint8), axis=-1)[:, : len(planes.normal)].astype(bool)
    h, g = np.nonzero(bits)
    chosen = np.argsort(labels < 0, axis=1, kind="stable")[:, :FOUND]
    chosen.sort(axis=1)
    points = planes.points[g[:, None], chosen[h]]  # (K, 5, 3)
    found = spots[np.take_along_axis(labels, chosen, axis=1)[h]]
    centre, seen_at = points.mean(axis=1), found.mean(axis=1)
    flat = np.einsum("kpi,kji->kpj", points - centre[:, None], np.stack([planes.e1[g], planes.e2[g]], axis=1))
    v, w = flat[..., 0] + 1j * flat[..., 1], _complex(found - seen_at[:, None])
    turn = np.stack([np.sum(w * np.conj(v), axis=1), np.sum(w * v, axis=1)], axis=1)  # from the one side, the other
    size = np.sum(np.abs(v) ** 2 + np.abs(w) ** 2, axis=1)
    misfit = size[:, None] - 2 * np.abs(turn)
    side = first_least_of_each(misfit, SAME_MM2)
    least = misfit[np.arange(len(h)), side]
    order = ascending(least, SAME_MM2)
    order = order[np.argsort(h[order], kind="stable")]
    best = order[np.unique(h[order], return_index=True)[1]]  # the best plane of every assignment
    best = best[ascending(least[best], SAME_MM2)[:limit]]
    k, s = g[best], side[best]
    e2 = planes.e2[k] * np.where(s == 0, 1.0, -1.0)[:, None]
    phase = turn[best, s] / np.maximum(np.abs(turn[best, s]), 1e-12)
    y = phase.real[:, None] * planes.e1[k] - phase.imag[:, None] * e2
    z = phase.imag[:, None] * planes.e1[k] + phase.real[:, None] * e2
    R = np.stack([np.cross(y, z), y, z], axis=-1)
    origin = centre[best] - seen_at[best, :1] * y - seen_at[best, 1:] * z
    out = np.full((len(best), strings), -1, dtype=np.intp)
    out[:, : labels.shape[1]] = labels[h[best]]
    return Assignments(out, Pose(R, origin).inverse())


def _complex(yz: Array) -> NDArray[np.complex128]:
    return np.asarray(yz[..., 0] + 1j * yz[..., 1])
