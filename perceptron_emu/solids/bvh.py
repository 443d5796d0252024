"""Whether triangles stand between two points: a bounding-volume hierarchy in double precision."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from geometry.compiled import kernel

Array = NDArray[np.float64]
Index = NDArray[np.int64]
Vector = tuple[float, float, float]
Span = tuple[float, float]
Mask = NDArray[np.bool_]

LEAF = 4  # triangles of a box that is not divided
PACKET = 16  # segments that are tried together
TIE = 1e-9  # by which a split must be better than one found before: rounding decides none
PIECES, MAX_PIECES = 4, 100_000  # of a mesh's length; pieces of a mesh after which none is halved
UNTURNED, UNMOVED = np.eye(3), np.zeros(3)
EDGE_SLACK = 1e-12  # of a triangle: rays between two triangles must hit one
SLACK = 1e-9  # of a segment's length: a flat box must not be missed by rounding


class Bvh(NamedTuple):
    """A hierarchy of boxes over triangles.

    Parameters
    ----------
    boxes : Array
        (M, 6) of low and high corners [mm].
    children : NDArray
        (M, 2), or in leaves (−1 − first, count) of the members.
    members : NDArray
        (P,) numbers of triangles; one that is long is the member of several leaves.
    triangles : Array
        (T, 3, 3) [mm].
    """

    boxes: Array
    children: Index
    members: Index
    triangles: Array


class MeshPose(NamedTuple):
    """The pose of a hierarchy's axes in those of the points: rotation (3, 3), translation (3,) [mm]."""

    R: Array
    t: Array


def build_bvh(triangles: Array) -> Bvh:
    """Hierarchy over triangles, split where the boxes become small.

    Long triangles are boxed in pieces: else the fans about a drilled hole fill their plane with overlapping boxes.

    Parameters
    ----------
    triangles : Array
        (T, 3, 3) [mm].

    Returns
    -------
    Bvh
        Of at most some 100,000 pieces more than triangles.

    References
    ----------
    Early split clipping, Ernst & Greiner 2007.
    """
    triangles = np.array(triangles, dtype=float, order="C")  # a copy: never a read-only view
    pieces, owner = _in_pieces(triangles)
    order, boxes, children = _grow(pieces.min(1), pieces.max(1))
    return Bvh(boxes, children, owner[order].copy(), triangles)


def _in_pieces(triangles: Array) -> tuple[Array, NDArray[np.int64]]:
    """Triangles halved across their longest edges until none is long: (P, 3, 3), and whose pieces they are (P,)."""
    longest = max(float(np.ptp(triangles.reshape(-1, 3), axis=0).max()) / PIECES, 1e-9)
    pieces, owner = triangles, np.arange(len(triangles))
    while LEAF < len(pieces) < MAX_PIECES:
        edges = np.linalg.norm(np.roll(pieces, -1, axis=1) - pieces, axis=2)
        long = edges.max(1) > longest
        if not np.any(long):
            break
        turned = np.take_along_axis(pieces[long], (edges[long].argmax(1)[:, None] + [0, 1, 2])[..., None] % 3, axis=1)
        halves = np.repeat(turned, 2, axis=0)
        halves[::2, 1] = halves[1::2, 0] = turned[:, :2].mean(1)
        pieces = np.concatenate([pieces[~long], halves])
        owner = np.concatenate([owner[~long], np.repeat(owner[long], 2)])
    return pieces, owner


def blocked(
    bvh: Bvh, origins: Array, targets: Array, R: Array = UNTURNED, t: Array = UNMOVED, but: Mask | None = None
) -> Mask:
    """Whether a triangle cuts the open segment from origin to target.

    Parameters
    ----------
    bvh : Bvh
        Over the triangles.
    origins : Array
        (N, 3) [mm].
    targets : Array
        (N, 3) or (3,) [mm].
    R, t : Array
        (3, 3), (3,) [mm]: the pose of the triangles' axes in those of the points.
    but : NDArray, optional
        (N,) of bool: segments that are known to be free.

    Returns
    -------
    NDArray
        (N,) of bool.
    """
    # copies where they are read-only views: kernels are compiled for arrays that can be written
    origins = writable(origins)
    targets = writable(np.atleast_2d(targets))
    place = MeshPose(np.array(R, dtype=float, order="C"), np.array(t, dtype=float))
    free = np.zeros(len(origins), np.bool_) if but is None else but
    out = np.zeros(len(origins), np.bool_)
    block(bvh, 0, (origins, targets), place, free, out)
    return out


def writable(points: Array) -> Array:
    """Points as kernels are compiled for: in a row, and not a read-only view."""
    points = np.ascontiguousarray(points, dtype=float)
    return points if points.flags.writeable else points.copy()


@kernel
def _grow(low: Array, high: Array) -> tuple[Index, Array, Index]:
    """Leaf order (T,), boxes and children of the hierarchy over boxes low, high (T, 3), from the root down."""
    order, count = np.arange(len(low)), 2 * len(low)
    boxes, children = np.empty((count, 6)), np.empty((count, 2), np.int64)
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
    return order, boxes[:used].copy(), children[:used].copy()


@kernel
def _box_of(low: Array, high: Array, members: Index, box: Array) -> None:
    for axis in range(3):
        box[axis], box[3 + axis] = np.inf, -np.inf
        for i in members:
            box[axis], box[3 + axis] = min(box[axis], low[i, axis]), max(box[3 + axis], high[i, axis])


@kernel
def _split(low: Array, high: Array, members: Index, cost: Array) -> int:
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
            if cost[k] < best * (1 - TIE):
                best, best_at, best_axis = cost[k], k + 1, axis
    before = members.copy()
    order = np.argsort(low[members, best_axis] + high[members, best_axis], kind="mergesort")
    for k in range(n):
        members[k] = before[order[k]]
    return best_at


@kernel
def block(bvh: Bvh, root: int, segments: tuple[Array, Array], place: MeshPose, free: Mask, out: Mask) -> None:
    """Set out (N,) for segments that a triangle below the root cuts, where they are not known to be free.

    segments: where they begin (N, 3) and end, (N, 3) or (1, 3). They are taken in packets of neighbours: most packets
    come near no triangle at all.
    """
    origins, targets = segments
    stack = np.empty(128, np.int64)
    begin, end = np.empty((2, PACKET, 3))
    begin_box, end_box = np.empty((2, 6))
    middle, way, half = np.empty(3), np.empty(3), np.empty(3)
    single = np.zeros(3)
    for first in range(0, len(origins), PACKET):
        n = min(PACKET, len(origins) - first)
        if np.all(free[first : first + n]):
            continue
        for k in range(n):
            _into(place, origins[first + k], begin[k])
            _into(place, targets[first + k if len(targets) > 1 else 0], end[k])
        _bounds(begin, n, begin_box)
        _bounds(end, n, end_box)
        for a in range(3):
            middle[a] = (begin_box[a] + begin_box[3 + a]) / 2
            way[a] = (end_box[a] + end_box[3 + a]) / 2 - middle[a]
            half[a] = max(begin_box[3 + a] - begin_box[a], end_box[3 + a] - end_box[a]) / 2
        if not _meets(bvh, root, (middle, way, half), False, stack):
            continue
        for k in range(n):
            if free[first + k]:
                continue
            for a in range(3):
                way[a] = end[k, a] - begin[k, a]
            if _meets(bvh, root, (begin[k], way, single), True, stack):
                out[first + k] = True


@kernel
def _bounds(points: Array, n: int, box: Array) -> None:
    for a in range(3):
        low, high = points[0, a], points[0, a]
        for k in range(1, n):
            low, high = min(low, points[k, a]), max(high, points[k, a])
        box[a], box[3 + a] = low, high


@kernel
def _meets(bvh: Bvh, root: int, segment: tuple[Array, Array, Array], exact: bool, stack: Index) -> bool:
    """Whether a segment (origin, way, half) cuts a triangle below the root; not exact: whether it comes within half of
    the box of a few triangles along each axis.
    """
    boxes, children = bvh.boxes, bvh.children
    origin, way, half = segment
    ox, oy, oz = origin[0], origin[1], origin[2]
    dx, dy, dz = way[0], way[1], way[2]
    hx, hy, hz = half[0], half[1], half[2]
    ix, iy, iz = inverse(dx), inverse(dy), inverse(dz)
    stack[0] = root
    top = 1
    while top > 0:
        top -= 1
        node = stack[top]
        near, far = slab((boxes[node, 0] - hx, boxes[node, 3] + hx), ox, ix, (0.0, 1.0))
        near, far = slab((boxes[node, 1] - hy, boxes[node, 4] + hy), oy, iy, (near, far))
        near, far = slab((boxes[node, 2] - hz, boxes[node, 5] + hz), oz, iz, (near, far))
        if near > far + SLACK:
            continue
        first, second = children[node, 0], children[node, 1]
        if first >= 0:
            stack[top], stack[top + 1] = first, second
            top += 2
            continue
        if not exact:
            return True
        for i in range(-1 - first, second - 1 - first):
            if cuts(bvh.triangles, bvh.members[i], (ox, oy, oz), (dx, dy, dz)):
                return True
    return False


@kernel(inline=True)
def inverse(component: float) -> float:
    """Of a ray's way along an axis; 0 becomes so small that a slab is all or nothing."""
    return 1 / component if abs(component) > 1e-12 else 1e12


@kernel(inline=True)
def slab(sides: Span, origin: float, over_way: float, span: Span) -> Span:
    """What is left of a span of a ray between two planes across an axis (Kay & Kajiya 1986); over_way: `inverse`."""
    a, b = (sides[0] - origin) * over_way, (sides[1] - origin) * over_way
    return max(span[0], min(a, b)), min(span[1], max(a, b))


@kernel(inline=True)
def _into(place: MeshPose, point: Array, out: Array) -> None:
    """Set out to Rᵀ (point − t)."""
    R, t = place
    x, y, z = point[0] - t[0], point[1] - t[1], point[2] - t[2]
    for a in range(3):
        out[a] = R[0, a] * x + R[1, a] * y + R[2, a] * z


@kernel(inline=True)
def cuts(triangles: Array, i: int, origin: Vector, way: Vector) -> bool:
    """Möller & Trumbore 1997; closed at the edges, so that no ray slips between two triangles."""
    (ox, oy, oz), (dx, dy, dz) = origin, way
    ax, ay, az = triangles[i, 0, 0], triangles[i, 0, 1], triangles[i, 0, 2]
    e1x, e1y, e1z = triangles[i, 1, 0] - ax, triangles[i, 1, 1] - ay, triangles[i, 1, 2] - az
    e2x, e2y, e2z = triangles[i, 2, 0] - ax, triangles[i, 2, 1] - ay, triangles[i, 2, 2] - az
    px, py, pz = dy * e2z - dz * e2y, dz * e2x - dx * e2z, dx * e2y - dy * e2x
    det = e1x * px + e1y * py + e1z * pz
    if det == 0:
        return False
    # all are compared in units of the determinant: most triangles are missed, and a division is dear
    size, sign = abs(det), (1.0 if det > 0 else -1.0)
    slack = EDGE_SLACK * size
    sx, sy, sz = ox - ax, oy - ay, oz - az
    u = (sx * px + sy * py + sz * pz) * sign
    if u < -slack or u > size + slack:
        return False
    qx, qy, qz = sy * e1z - sz * e1y, sz * e1x - sx * e1z, sx * e1y - sy * e1x
    v = (dx * qx + dy * qy + dz * qz) * sign
    if v < -slack or u + v > size + slack:
        return False
    return bool(0 < (e2x * qx + e2y * qy + e2z * qz) * sign < size)
