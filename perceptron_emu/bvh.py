"""Whether triangles stand between two points: a bounding-volume hierarchy in double precision."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import NDArray

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

LEAF = 4
UNTURNED, UNMOVED = np.eye(3), np.zeros(3)
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
    """Hierarchy over triangles (T, 3, 3) [mm], split where the boxes become small."""
    triangles = np.ascontiguousarray(triangles, dtype=float)
    order, boxes, children = _build(triangles.min(1), triangles.max(1))
    return Bvh(boxes, children, triangles[order].copy())


def blocked(bvh: Bvh, origins: Array, targets: Array, R: Array = UNTURNED, t: Array = UNMOVED) -> Mask:
    """Whether a triangle cuts the open segment from origins (N, 3) to targets (N, 3) or (3,) [mm].

    R (3, 3), t (3,): the pose of the triangles' axes in those of the points.
    """
    origins = np.array(origins, dtype=float, order="C")
    # copies: never a read-only view
    targets = np.array(np.atleast_2d(targets), dtype=float, order="C")
    pose = np.array(R, dtype=float, order="C"), np.array(t, dtype=float)
    return np.asarray(_blocked(bvh.boxes, bvh.children, bvh.triangles, origins, targets, *pose))


def _build(low: Array, high: Array) -> tuple[NDArray[np.int64], Array, NDArray[np.int64]]:
    """Leaf order (T,), boxes and children of the hierarchy over boxes low, high (T, 3)."""
    order, count = np.arange(len(low)), 2 * len(low)
    boxes, children = np.empty((count, 6)), np.empty((count, 2), np.int64)
    used = _grow(np.ascontiguousarray(low), np.ascontiguousarray(high), order, boxes, children)
    return order, boxes[:used].copy(), children[:used].copy()


@njit(cache=True, error_model="numpy")
def _grow(low, high, order, boxes, children):  # type: ignore[no-untyped-def]
    """Fill order, boxes and children from the root down; the number of boxes."""
    todo = np.empty((128, 3), np.int64)
    todo[0, 0], todo[0, 1], todo[0, 2] = 0, 0, len(low)
    left, used = 1, 1
    cost = np.empty(len(low))
    while left > 0:
        left -= 1
        node, first, last = todo[left]
        _box_of(low, high, order[first:last], boxes[node])
        if last - first <= LEAF:
            children[node, 0], children[node, 1] = -1 - first, last - first
            continue
        half = first + _split(low, high, order[first:last], cost)
        children[node, 0], children[node, 1] = used, used + 1
        # the larger part waits, so that the list stays short
        parts = ((used, first, half), (used + 1, half, last))
        big = 0 if half - first > last - half else 1
        todo[left], todo[left + 1] = parts[big], parts[1 - big]
        left += 2
        used += 2
    return used


@njit(cache=True, error_model="numpy")
def _box_of(low, high, members, box):  # type: ignore[no-untyped-def]
    for axis in range(3):
        box[axis], box[3 + axis] = np.inf, -np.inf
        for i in members:
            box[axis], box[3 + axis] = min(box[axis], low[i, axis]), max(box[3 + axis], high[i, axis])


@njit(cache=True, error_model="numpy")
def _split(low, high, members, cost):  # type: ignore[no-untyped-def]
    """Order the members along the axis, and return how many go to the first child, for which the children's surfaces
    times their counts are least.

    Source: the surface-area heuristic, MacDonald & Booth 1990.
    """
    n = len(members)
    best, best_at, best_axis = np.inf, n // 2, 0
    for axis in range(3):
        order = members[np.argsort(low[members, axis] + high[members, axis], kind="mergesort")]
        for step in (1, -1):
            box = np.array([np.inf, np.inf, np.inf, -np.inf, -np.inf, -np.inf])
            for k in range(n - 1):
                i = order[k] if step == 1 else order[n - 1 - k]
                for a in range(3):
                    box[a], box[3 + a] = min(box[a], low[i, a]), max(box[3 + a], high[i, a])
                x, y, z = box[3] - box[0], box[4] - box[1], box[5] - box[2]
                area = (x * y + y * z + z * x) * (k + 1)
                if step == 1:
                    cost[k] = area
                else:
                    cost[n - 2 - k] += area
        for k in range(n - 1):
            if cost[k] < best * (1 - 1e-9):
                best, best_at, best_axis = cost[k], k + 1, axis
    members[:] = members[np.argsort(low[members, best_axis] + high[members, best_axis], kind="mergesort")]
    return best_at


@njit(cache=True, error_model="numpy")
def _blocked(boxes, children, triangles, origins, targets, R, t):  # type: ignore[no-untyped-def]
    out = np.zeros(len(origins), np.bool_)
    stack = np.empty(128, np.int64)
    for r in range(len(origins)):
        k = r if len(targets) > 1 else 0
        ox, oy, oz = _into(R, origins[r, 0] - t[0], origins[r, 1] - t[1], origins[r, 2] - t[2])
        dx, dy, dz = _into(R, targets[k, 0] - t[0], targets[k, 1] - t[1], targets[k, 2] - t[2])
        dx, dy, dz = dx - ox, dy - oy, dz - oz
        # a component of 0 becomes one so small that its slab is all or nothing
        ix = 1 / dx if abs(dx) > 1e-12 else 1e12
        iy = 1 / dy if abs(dy) > 1e-12 else 1e12
        iz = 1 / dz if abs(dz) > 1e-12 else 1e12
        stack[0] = 0
        top = 1
        while top > 0:
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
            first, second = children[node, 0], children[node, 1]
            if first >= 0:
                stack[top], stack[top + 1] = first, second
                top += 2
                continue
            for i in range(-1 - first, second - 1 - first):
                if _cuts(triangles, i, ox, oy, oz, dx, dy, dz):
                    out[r] = True
                    top = 0
                    break
    return out


@njit(cache=True, error_model="numpy", inline="always")
def _into(R, x, y, z):  # type: ignore[no-untyped-def]
    """Rᵀ (x, y, z)."""
    return (
        R[0, 0] * x + R[1, 0] * y + R[2, 0] * z,
        R[0, 1] * x + R[1, 1] * y + R[2, 1] * z,
        R[0, 2] * x + R[1, 2] * y + R[2, 2] * z,
    )


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
    # all are compared in units of the determinant: most triangles are missed, and a division is dear
    size, sign = abs(det), (1.0 if det > 0 else -1.0)
    slack = 1e-12 * size
    sx, sy, sz = ox - ax, oy - ay, oz - az
    u = (sx * px + sy * py + sz * pz) * sign
    if u < -slack or u > size + slack:
        return False
    qx, qy, qz = sy * e1z - sz * e1y, sz * e1x - sx * e1z, sx * e1y - sy * e1x
    v = (dx * qx + dy * qy + dz * qz) * sign
    if v < -slack or u + v > size + slack:
        return False
    return 0 < (e2x * qx + e2y * qy + e2z * qz) * sign < size
