"""Labels without any guess: two faces of the pillar, each three spots in line (N-localizers that share a rod)."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from itertools import product

import numpy as np
from numpy.typing import NDArray

from geometry.ties import ascending
from jig_cad import Jig

Array = NDArray[np.float64]
IntArray = NDArray[np.intp]

UPRIGHT = 0.02  # share of its length by which a rod may lie out of x: its anchors' tolerance, never a diagonal
SAME_MM = 1e-6  # anchors so near to each other are one hole

SAME_MISFIT = 1e-6  # in units of what the tolerance allows
_SIGNS = np.array([[1.0, 1.0], [1.0, -1.0], [-1.0, 1.0], [-1.0, -1.0]])


@dataclass(frozen=True, eq=False)
class PillarFace:
    """Two rods and the diagonal between them, as indices of the jig's strings.

    x0, x1: heights [mm] at which the diagonal meets the first and the second rod. width: between the rods [mm].
    """

    rods: tuple[int, int]
    diagonal: int
    x0: float
    x1: float
    width: float

    def turned(self) -> PillarFace:
        """The same face, seen from its other rod."""
        return PillarFace((self.rods[1], self.rods[0]), self.diagonal, self.x1, self.x0, self.width)


@dataclass(frozen=True, eq=False)
class Triples:
    """Ordered triples of spots in line: ends i, j, the middle one k at the fraction f of the way, length l [mm]."""

    i: IntArray
    j: IntArray
    k: IntArray
    f: Array
    length: Array


def faces(jig: Jig) -> list[PillarFace]:
    """The faces whose rods and diagonal the jig has: two strings along x, and one from an anchor of each to the other.

    The strings' names say nothing here.
    """
    out = []
    for k in range(len(jig.strings)):
        first, second = jig.start_index[k], jig.end_index[k]
        for u, v in product(_rods_at(jig, first), _rods_at(jig, second)):
            if k in (u, v) or u == v:
                continue
            apart = jig.starts[v, 1:] - jig.starts[u, 1:]
            width = float(np.linalg.norm(apart))
            out.append(PillarFace((u, v), k, float(jig.anchors_mm[first, 0]), float(jig.anchors_mm[second, 0]), width))
    return out


def _rods_at(jig: Jig, anchor: int) -> list[int]:
    """The strings along x, as drawn, that end at the anchor."""
    drawn = jig.nominal_anchors_mm
    starts, ends = drawn[jig.start_index], drawn[jig.end_index]
    along = ends - starts
    upright = np.linalg.norm(along[:, 1:], axis=1) < UPRIGHT * np.abs(along[:, 0])
    here = [np.linalg.norm(p - drawn[anchor], axis=1) < SAME_MM for p in (starts, ends)]
    return [int(s) for s in np.flatnonzero(upright & (here[0] | here[1]))]


@lru_cache(maxsize=64)
def face_pairs(jig: Jig) -> tuple[tuple[PillarFace, PillarFace], ...]:
    """Pairs of faces, both turned so that their first rod is the one they share."""
    out: list[tuple[PillarFace, PillarFace]] = []
    known = faces(jig)
    for n, one in enumerate(known):
        for other in known[n + 1 :]:
            for a in (one, one.turned()):
                out.extend((a, b) for b in (other, other.turned()) if a.rods[0] == b.rods[0])
    return tuple(out)


def collinear_triples(yz_mm: Array, min_mm: float, max_mm: float, tolerance_mm: float) -> Triples:
    """All ordered triples of the spots (N, 2): ends min_mm … max_mm apart, the third between, in line to tolerance."""
    d = yz_mm[None, :] - yz_mm[:, None]  # (i, j)
    length = np.linalg.norm(d, axis=-1)
    ends = (length > max(min_mm, 0.0)) & (length < max_mm)
    i, j = np.nonzero(ends)
    unit = d[i, j] / length[i, j, None]
    to_k = yz_mm[None, :, :] - yz_mm[i, None, :]  # (pairs, k)
    along = np.sum(to_k * unit[:, None, :], -1)
    across = to_k[..., 1] * unit[:, None, 0] - to_k[..., 0] * unit[:, None, 1]
    between = (along > 0.5 * tolerance_mm) & (along < length[i, j, None] - 0.5 * tolerance_mm)
    pair, k = np.nonzero(between & (np.abs(across) < tolerance_mm) & (np.arange(len(yz_mm)) != i[:, None]))
    keep = k != j[pair]
    pair, k = pair[keep], k[keep]
    return Triples(i[pair], j[pair], k, along[pair, k] / length[i[pair], j[pair]], length[i[pair], j[pair]])


def five_spot_labels(
    yz_mm: Array, jig: Jig, orientation: float, tolerance_mm: float, max_tilt_rad: float, limit: int
) -> IntArray:
    """Assignments (H, S) of spots to strings, -1 where none, best first: five spots that two faces explain.

    yz_mm: spots as axis points (N, 2), within ``tolerance_mm`` of it. orientation: sign of x_jig · x_sensor.
    """
    found: list[tuple[Array, IntArray]] = []
    pairs = face_pairs(jig)
    if len(yz_mm) < 5 or not pairs:
        return np.zeros((0, len(jig.strings)), dtype=np.intp)
    widths = [face.width for pair in pairs for face in pair]
    longest = max(widths) / np.cos(max_tilt_rad)
    triples = collinear_triples(yz_mm, min(widths) - tolerance_mm - jig.tolerance_mm, longest, tolerance_mm)
    for one, two in pairs:
        found.append(_match(triples, yz_mm, one, two, jig, orientation, tolerance_mm))
    misfit = np.concatenate([m for m, _ in found])
    labels = np.concatenate([lab for _, lab in found])
    return labels[ascending(misfit, SAME_MISFIT)[:limit]]


def _match(
    t: Triples, yz_mm: Array, one: PillarFace, two: PillarFace, jig: Jig, orientation: float, tolerance_mm: float
) -> tuple[Array, IntArray]:
    a, b = _sharing_first(t)
    cross = _cross(yz_mm[t.j[a]] - yz_mm[t.i[a]], yz_mm[t.j[b]] - yz_mm[t.i[b]])
    base = np.array([jig.starts[r, 1:] for r in (one.rods[0], one.rods[1], two.rods[1])])
    turn = _cross(base[1] - base[0], base[2] - base[0])
    keep = (cross * turn * orientation > 0) & (t.j[a] != t.k[b]) & (t.k[a] != t.j[b]) & (t.k[a] != t.k[b])
    a, b = a[keep], b[keep]
    third = np.linalg.norm(yz_mm[t.j[a]] - yz_mm[t.j[b]], axis=-1)
    width3 = float(np.linalg.norm(base[2] - base[1]))
    misfit = _misfit(t, a, b, one, two, third, width3, tolerance_mm)
    keep = misfit < 1
    a, b, misfit = a[keep], b[keep], misfit[keep]
    labels = np.full((len(a), len(jig.strings)), -1, dtype=np.intp)
    labels[:, one.rods[0]], labels[:, one.rods[1]], labels[:, one.diagonal] = t.i[a], t.j[a], t.k[a]
    labels[:, two.rods[1]], labels[:, two.diagonal] = t.j[b], t.k[b]
    return misfit, labels


def _misfit(
    t: Triples,
    a: IntArray,
    b: IntArray,
    one: PillarFace,
    two: PillarFace,
    third: Array,
    width3: float,
    tolerance_mm: float,
) -> Array:
    """Largest disagreement of five points with the jig, in units of what ``tolerance_mm`` allows; best of four signs.

    Heights over the shared rod's crossing: u = ±√(l² - width²) of the other rods'. The diagonals' crossings stand at
    known heights, so that both faces give the shared rod's (the paper's Eq. 7), and the third side must fit u₂ - u₁.
    """
    u, du = zip(*(_rise(t.length[n], face.width, tolerance_mm) for n, face in ((a, one), (b, two))), strict=True)
    h = [face.x0 + t.f[n] * (face.x1 - face.x0) for n, face in ((a, one), (b, two))]
    climb = abs(one.x1 - one.x0)
    best = np.full(len(a), np.inf)
    df = [tolerance_mm / t.length[a], tolerance_mm / t.length[b]]
    for s1, s2 in _SIGNS:
        u1, u2 = s1 * u[0], s2 * u[1]
        height = np.abs((h[0] - t.f[a] * u1) - (h[1] - t.f[b] * u2))
        allowed = t.f[a] * du[0] + t.f[b] * du[1] + climb * (df[0] + df[1]) + np.abs(u1) * df[0] + np.abs(u2) * df[1]
        side = np.abs(third**2 - width3**2 - (u2 - u1) ** 2)
        allowed_side = 2 * third * tolerance_mm + 2 * np.abs(u2 - u1) * (du[0] + du[1]) + (du[0] + du[1]) ** 2
        best = np.minimum(best, np.maximum(height / allowed, side / allowed_side))
    return best


def _rise(length: Array, width: float, tolerance_mm: float) -> tuple[Array, Array]:
    """√(l² - width²), 0 where noise leaves it imaginary, and how far ``tolerance_mm`` in l moves it."""
    rise = np.sqrt(np.maximum(length**2 - width**2, 0.0))
    high = np.sqrt(np.maximum((length + tolerance_mm) ** 2 - width**2, 0.0))
    low = np.sqrt(np.maximum((length - tolerance_mm) ** 2 - width**2, 0.0))
    return rise, np.maximum(high - rise, rise - low)


def _sharing_first(t: Triples) -> tuple[IntArray, IntArray]:
    """All ordered pairs of triples with the same first end and different second ends."""
    if len(t.i) == 0:
        return t.i, t.i
    order = np.argsort(t.i, kind="stable")
    _, counts = np.unique(t.i[order], return_counts=True)
    start = np.concatenate([[0], np.cumsum(counts)[:-1]])
    a = [np.repeat(order[s : s + n], n) for s, n in zip(start, counts, strict=True)]
    b = [np.tile(order[s : s + n], n) for s, n in zip(start, counts, strict=True)]
    left, right = np.concatenate(a), np.concatenate(b)
    different = t.j[left] != t.j[right]
    return left[different], right[different]


def _cross(a: Array, b: Array) -> Array:
    return np.asarray(a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0])
