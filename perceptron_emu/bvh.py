"""Whether triangles stand between two points: a bounding-volume hierarchy in double precision."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import NDArray

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

LEAF = 4


@dataclass(frozen=True, eq=False)
class Bvh:
    """Boxes (M, 6) of low and high corners, children (M, 2) or, in leaves, (−1 − first, count), triangles (T, 3, 3) in leaf order."""

    boxes: Array
    children: NDArray[np.int64]
    triangles: Array


def build_bvh(triangles: Array) -> Bvh:
    """Hierarchy over triangles (T, 3, 3) [mm], split at the median along the longest side."""
    triangles = np.ascontiguousarray(triangles, dtype=float)
    order, boxes, children = _build(triangles.min(1), triangles.max(1))
    return Bvh(boxes, children, np.ascontiguousarray(triangles[order]))


def blocked(bvh: Bvh, origins: Array, targets: Array) -> Mask:
    """Whether a triangle cuts the open segment from origins (N, 3) to targets (N, 3) or (3,) [mm]."""
    origins = np.ascontiguousarray(origins, dtype=float)
    targets = np.ascontiguousarray(np.broadcast_to(targets, origins.shape), dtype=float)
    return np.asarray(_blocked(bvh.boxes, bvh.children, bvh.triangles, origins, targets))


@njit(cache=True)
def _build(low, high):  # type: ignore[no-untyped-def]
    n = len(low)
    order = np.arange(n)
    boxes = np.empty((max(1, 2 * n), 6))
    children = np.empty((max(1, 2 * n), 2), np.int64)
    stack = np.empty((128, 3), np.int64)
    stack[0] = (0, 0, n)
    top, used = 1, 1
    while top > 0:
        top -= 1
        node, first, last = stack[top]
        for k in range(3):
            lo, hi = np.inf, -np.inf
            for i in range(first, last):
                lo, hi = min(lo, low[order[i], k]), max(hi, high[order[i], k])
            boxes[node, k], boxes[node, 3 + k] = lo, hi
        if last - first <= LEAF:
            children[node] = (-1 - first, last - first)
            continue
        axis = np.argmax(boxes[node, 3:] - boxes[node, :3])
        part = order[first:last].copy()
        order[first:last] = part[np.argsort(low[part, axis] + high[part, axis])]
        middle = (first + last) // 2
        children[node] = (used, used + 1)
        stack[top] = (used, first, middle)
        stack[top + 1] = (used + 1, middle, last)
        top, used = top + 2, used + 2
    return order, boxes[:used].copy(), children[:used].copy()


@njit(cache=True)
def _blocked(boxes, children, triangles, origins, targets):  # type: ignore[no-untyped-def]
    out = np.zeros(len(origins), np.bool_)
    stack = np.empty(128, np.int64)
    for r in range(len(origins)):
        o, d = origins[r], targets[r] - origins[r]
        stack[0] = 0
        top = 1
        while top > 0 and not out[r]:
            top -= 1
            node = stack[top]
            near, far = 0.0, 1.0
            for k in range(3):
                if abs(d[k]) > 1e-12:
                    a, b = (boxes[node, k] - o[k]) / d[k], (boxes[node, 3 + k] - o[k]) / d[k]
                    near, far = max(near, min(a, b)), min(far, max(a, b))
                elif o[k] < boxes[node, k] or o[k] > boxes[node, 3 + k]:
                    far = -1.0
            if near > far:
                continue
            if children[node, 0] >= 0:
                stack[top], stack[top + 1] = children[node, 0], children[node, 1]
                top += 2
                continue
            for i in range(-1 - children[node, 0], -1 - children[node, 0] + children[node, 1]):
                if _cuts(triangles[i], o, d):
                    out[r] = True
                    break
    return out


@njit(cache=True, inline="always")
def _cuts(t, o, d):  # type: ignore[no-untyped-def]
    """Möller & Trumbore 1997; closed at the edges, so that no ray slips between two triangles."""
    e1x, e1y, e1z = t[1, 0] - t[0, 0], t[1, 1] - t[0, 1], t[1, 2] - t[0, 2]
    e2x, e2y, e2z = t[2, 0] - t[0, 0], t[2, 1] - t[0, 1], t[2, 2] - t[0, 2]
    px, py, pz = d[1] * e2z - d[2] * e2y, d[2] * e2x - d[0] * e2z, d[0] * e2y - d[1] * e2x
    det = e1x * px + e1y * py + e1z * pz
    if det == 0:
        return False
    sx, sy, sz = o[0] - t[0, 0], o[1] - t[0, 1], o[2] - t[0, 2]
    u = (sx * px + sy * py + sz * pz) / det
    if u < -1e-12 or u > 1 + 1e-12:
        return False
    qx, qy, qz = sy * e1z - sz * e1y, sz * e1x - sx * e1z, sx * e1y - sy * e1x
    v = (d[0] * qx + d[1] * qy + d[2] * qz) / det
    if v < -1e-12 or u + v > 1 + 1e-12:
        return False
    s = (e2x * qx + e2y * qy + e2z * qz) / det
    return 0 < s < 1
