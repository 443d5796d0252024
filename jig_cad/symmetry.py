"""Which proper rotations carry a set of strings onto itself: points alone can not tell the poses that they join."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import combinations, permutations

import numpy as np
from numpy.typing import NDArray

from geometry import Pose, Symmetry, nearest_rotation

Array = NDArray[np.float64]
Index = NDArray[np.intp]

SLACK_MM = 0.05  # beside the tolerance: what a measured spot leaves undecided anyhow
_SAME_MM = 1e-6  # anchors so near to each other are one hole
_MOST_ANCHORS = 24  # of more anchors the triples are too many to be mapped; no such jig is known


def symmetries_of(
    anchors_mm: Array, strings: Sequence[str], start: Index, end: Index, tolerance_mm: float
) -> tuple[Symmetry, ...]:
    """The motions, identity left out, under which every string falls on a string, end on end.

    Parameters
    ----------
    anchors_mm : (A, 3) as drawn.
    start, end : (S,) the strings' anchors.
    tolerance_mm : ends that come this near to each other are taken to be one: a jig that is regular but for its
        tolerance is told from its turned self by nothing.
    """
    points, ends = _places(anchors_mm, np.stack([start, end], axis=1))
    base = _widest_triple(points) if len(points) <= _MOST_ANCHORS else None
    if base is None:
        return ()
    near = tolerance_mm + SLACK_MM
    found: dict[tuple[int, ...], Symmetry] = {}
    for image in _alike(points, base, near):
        order = _carried(_motion(points[list(base)], points[list(image)]), points, 2 * near)
        if order is None or order in found or order == tuple(range(len(points))):
            continue
        motion = _motion(points, points[list(order)])
        renamed = _renaming(ends, order)
        if renamed is not None and _carried(motion, points, near) == order:
            found[order] = Symmetry(motion, {strings[s]: strings[k] for s, k in enumerate(renamed)})
    return tuple(found[order] for order in sorted(found))


def _places(anchors_mm: Array, ends: Index) -> tuple[Array, Index]:
    """The places (P, 3) at which strings end, and the strings' ends (S, 2) among them; anchors may share a place."""
    kept: list[int] = []
    place: dict[int, int] = {}
    for anchor in np.unique(ends).tolist():
        near = [i for i, k in enumerate(kept) if np.linalg.norm(anchors_mm[k] - anchors_mm[anchor]) <= _SAME_MM]
        place[anchor] = near[0] if near else len(kept)
        kept += [] if near else [anchor]
    return anchors_mm[kept], np.array([[place[a] for a in pair] for pair in ends.tolist()], dtype=np.intp)


def _widest_triple(points: Array) -> tuple[int, int, int] | None:
    """Three anchors that span the largest triangle; None where all lie in a line."""
    triples = list(combinations(range(len(points)), 3))
    if not triples:
        return None
    a, b, c = (points[[t[k] for t in triples]] for k in range(3))
    area = np.linalg.norm(np.cross(b - a, c - a), axis=1) / 2
    size = float(np.max(np.linalg.norm(points[:, None] - points, axis=-1)))
    return triples[int(np.argmax(np.round(area, 6)))] if np.max(area) > 1e-3 * size**2 else None


def _alike(points: Array, base: tuple[int, int, int], near: float) -> Iterator[tuple[int, ...]]:
    """Ordered triples of anchors with the same distances as the ``base``."""
    apart = np.linalg.norm(points[:, None] - points, axis=-1)
    pairs = ((0, 1), (1, 2), (2, 0))
    sides = [apart[base[i], base[j]] for i, j in pairs]
    for image in permutations(range(len(points)), 3):
        turned = [apart[image[i], image[j]] for i, j in pairs]
        if all(abs(there - here) <= 2 * near for there, here in zip(turned, sides, strict=True)):
            yield image


def _motion(points: Array, images: Array) -> Pose:
    """The rigid motion that carries the points (N, 3) nearest to their images (N, 3)."""
    centre, goal = points.mean(axis=0), images.mean(axis=0)
    R = nearest_rotation((images - goal).T @ (points - centre))
    return Pose(R, goal - R @ centre)


def _carried(motion: Pose, points: Array, near: float) -> tuple[int, ...] | None:
    """On which anchor each is carried; None where one comes to stand near none, or two on one."""
    apart = np.linalg.norm((motion @ points)[:, None] - points, axis=-1)
    order = np.argmin(apart, axis=1)
    if np.max(np.min(apart, axis=1)) > near or len(set(order.tolist())) < len(points):
        return None
    return tuple(order.tolist())


def _renaming(ends: Index, order: tuple[int, ...]) -> tuple[int, ...] | None:
    """The string onto which each is carried, by their ends (S, 2); None where there is none."""
    index = {frozenset(pair): k for k, pair in enumerate(ends.tolist())}
    renamed = [index.get(frozenset((order[a], order[b]))) for a, b in ends.tolist()]
    return None if any(k is None for k in renamed) else tuple(k for k in renamed if k is not None)
