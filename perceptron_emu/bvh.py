"""Whether triangles stand between two points: a bounding-volume hierarchy in double precision."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import NDArray

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

LEAF = 4
SLACK = 1e-9  # of a segment's length: a flat box must not be missed by rounding


@dataclass(frozen=True, eq=False)
class Bvh:
    """Boxes (M, 6) of low and high corners, children (M, 2) or, in leaves, (−1 − first, count), triangles (T, 3, 3)
    in leaf order.
    """

    boxes: Array
    children: NDArray[np.int64]
    triangles: Array


def build_bvh(triangles: Array) -> Bvh:
    """Hierarchy over triangles (T, 3, 3) [mm], split at the median along the longest side."""
    triangles = np.ascontiguousarray(triangles, dtype=float)
    order, boxes, children = _build(triangles.min(1), triangles.max(1))
    return Bvh(boxes, children, triangles[order].copy())


def blocked(bvh: Bvh, origins: Array, targets: Array) -> Mask:
    """Whether a triangle cuts the open segment from origins (N, 3) to targets (N, 3) or (3,) [mm]."""
    origins = np.array(origins, dtype=float, order="C")
    targets = np.array(
        np.broadcast_to(targets, origins.shape), dtype=float, order="C"
    )  # a copy: never a read-only view
    return np.asarray(_blocked(bvh.boxes, bvh.children, bvh.triangles, origins, targets))


def _build(low: Array, high: Array) -> tuple[NDArray[np.int64], Array, NDArray[np.int64]]:
    """Leaf order (T,), boxes and children of the hierarchy over boxes low, high (T, 3)."""
    order, middle = np.arange(len(low)), low + high
    boxes, children = [np.zeros(6)], [(0, 0)]
    todo = [(0, 0, len(low))]
    while todo:
        node, first, last = todo.pop()
        mine = order[first:last]
        boxes[node] = np.concatenate([low[mine].min(0), high[mine].max(0)])
        if last - first <= LEAF:
            children[node] = (-1 - first, last - first)
            continue
        axis = int(np.argmax(boxes[node][3:] - boxes[node][:3]))
        order[first:last] = mine[np.argsort(middle[mine, axis], kind="stable")]
        half, used = (first + last) // 2, len(boxes)
        children[node] = (used, used + 1)
        todo += [(used, first, half), (used + 1, half, last)]
        boxes += [np.zeros(6)] * 2
        children += [(0, 0)] * 2
    return order, np.array(boxes), np.array(children)


@njit(cache=True, error_model="numpy")
def _blocked(boxes, children, triangles, origins, targets):  # type: ignore[no-untyped-def]
    out = np.zeros(len(origins), np.bool_)
    stack = np.empty(128, np.int64)
    for r in range(len(origins)):
        ox, oy, oz = origins[r, 0], origins[r, 1], origins[r, 2]
        dx, dy, dz = targets[r, 0] - ox, targets[r, 1] - oy, targets[r, 2] - oz
        # a component of 0 becomes one so small that its slab is all or nothing
        ix = 1 / dx if abs(dx) > 1e-12 else 1e12
        iy = 1 / dy if abs(dy) > 1e-12 else 1e12
        iz = 1 / dz if abs(dz) > 1e-12 else 1e12
        stack[0] = 0
        top = 1
        while top > 0 and not out[r]:
            top -= 1
            node = stack[top]
            a, b = (boxes[node, 0] - ox) * ix, (boxes[node, 3] - ox) * ix
            near, far = max(0.0, min(a, b)), min(1.0, max(a, b))
            a, b = (boxes[node, 1] - oy) * iy, (boxes[node, 4] - oy) * iy
            near, far = max(near, min(a, b)), min(far, max(a, b))
            a, b = (boxes[node, 2] - oz) * iz, (boxes[node, 5] - oz) * iz
            near, far = max(near, min(a, b)), min(far, max(a, b))
            if near > far + SLACK:
                continue
            if children[node, 0] >= 0:
                stack[top], stack[top + 1] = children[node, 0], children[node, 1]
                top += 2
                continue
            first = -1 - children[node, 0]
            for i in range(first, first + children[node, 1]):
                if _cuts(triangles, i, ox, oy, oz, dx, dy, dz):
                    out[r] = True
                    break
    return out


@njit(cache=True, error_model="numpy", inline="always")
def _cuts(triangles, i, ox, oy, oz, dx, dy, dz):  # type: ignore[no-untyped-def]
    """Möller & Trumbore 1997; closed at the edges, so that no ray slips between two triangles."""
    ax, ay, az = triangles[i, 0, 0], triangles[i, 0, 1], triangles[i, 0, 2]
    e1x, e1y, e1z = triangles[i, 1, 0] - ax, triangles[i, 1, 1] - ay, triangles[i, 1, 2] - az
    e2x, e2y, e2z = triangles[i, 2, 0] - ax, triangles[i, 2, 1] - ay, triangles[i, 2, 2] - az
    px, py, pz = dy * e2z - dz * e2y, dz * e2x - dx * e2z, dx * e2y - dy * e2x
    det = e1x * px + e1y * py + e1z * pz
    if det == 0:
        return False
    sx, sy, sz = ox - ax, oy - ay, oz - az
    u = (sx * px + sy * py + sz * pz) / det
    if u < -1e-12 or u > 1 + 1e-12:
        return False
    qx, qy, qz = sy * e1z - sz * e1y, sz * e1x - sx * e1z, sx * e1y - sy * e1x
    v = (dx * qx + dy * qy + dz * qz) / det
    if v < -1e-12 or u + v > 1 + 1e-12:
        return False
    s = (e2x * qx + e2y * qy + e2z * qz) / det
    return 0 < s < 1
