"""All solids of a scene as one: what a ray meets first, and whether anything stands between two points."""

from __future__ import annotations

from collections import OrderedDict
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from geometry.compiled import kernel
from perceptron_emu.scene import Solid
from perceptron_emu.solids.bodies import Body, body_of
from perceptron_emu.solids.bvh import (
    EDGE_SLACK,
    SLACK,
    Bvh,
    MeshPose,
    Span,
    Vector,
    block,
    cuts,
    inverse,
    slab,
    writable,
)

Array = NDArray[np.float64]
Index = NDArray[np.int64]
Mask = NDArray[np.bool_]

KEPT = 8  # sets of meshes that stay joined


class World(NamedTuple):
    """Solids side by side, each in its mesh's own axes, with their poses.

    Parameters
    ----------
    bvh : Bvh
        Hierarchies of all of them, one behind the other.
    roots : NDArray
        (S,) where each solid's hierarchy begins.
    first : NDArray
        (S + 1,) where each solid's triangles begin.
    outwards : Array
        Unit normals of the triangles (T, 3), by their winding.
    normals : Array
        Unit normals for shading at their corners (T, 3, 3).
    closed : NDArray
        (S,) whether back faces are never seen.
    bare : NDArray
        (T,) whether nothing of its solid stands before what faces a triangle.
    R, t : Array
        (S, 3, 3), (S, 3) [mm]: T_sensor_mesh of each.
    """

    bvh: Bvh
    roots: Index
    first: Index
    outwards: Array
    normals: Array
    closed: NDArray[np.bool_]
    bare: NDArray[np.bool_]
    R: Array
    t: Array


class Hit(NamedTuple):
    """What a ray meets first: the solid (-1: nothing), its triangle, the distance in units of the direction, and the
    place on the triangle.
    """

    solid: int
    triangle: int
    distance: float
    u: float
    v: float


_JOINED: OrderedDict[tuple[int, ...], tuple[tuple[Body, ...], World]] = OrderedDict()


def world_of(solids: tuple[Solid, ...]) -> World:
    """The solids as one; what does not change with their poses is kept.

    Parameters
    ----------
    solids : tuple of Solid
        At least one, at their places in {P}.

    Returns
    -------
    World
        In their order.
    """
    bodies = tuple(body_of(s) for s in solids)
    key = tuple(map(id, bodies))
    known = _JOINED.get(key)
    if known is None or any(a is not b for a, b in zip(known[0], bodies, strict=True)):
        known = _JOINED[key] = (bodies, _joined(bodies))
        while len(_JOINED) > KEPT:
            _JOINED.popitem(last=False)
    R = np.array([s.T_sensor_mesh.R for s in solids])
    t = np.array([s.T_sensor_mesh.t for s in solids])
    return known[1]._replace(R=R, t=t)


def _joined(bodies: tuple[Body, ...]) -> World:
    nodes = np.cumsum([0, *(len(b.bvh.boxes) for b in bodies)])
    members = np.cumsum([0, *(len(b.bvh.members) for b in bodies)])
    first = np.cumsum([0, *(len(b.triangles) for b in bodies)])
    children = []
    for k, body in enumerate(bodies):
        own = body.bvh.children.copy()
        leaf = own[:, 0] < 0
        own[leaf, 0] -= members[k]
        own[~leaf] += nodes[k]
        children.append(own)
    bvh = Bvh(
        np.concatenate([b.bvh.boxes for b in bodies]),
        np.concatenate(children),
        np.concatenate([b.bvh.members + f for b, f in zip(bodies, first, strict=False)]),
        np.concatenate([b.bvh.triangles for b in bodies]),
    )
    return World(
        bvh, nodes[:-1].copy(), first, np.concatenate([b.outwards for b in bodies]),
        np.concatenate([b.normals for b in bodies]), np.array([b.closed for b in bodies]),
        np.concatenate([b.bare for b in bodies]), np.zeros((len(bodies), 3, 3)), np.zeros((len(bodies), 3)),
    )  # fmt: skip


def hidden_by_solids(
    solids: tuple[Solid, ...], points: Array, sources: Array, known: Mask | None = None, own: Index | None = None
) -> Mask:
    """Whether any solid stands between points and sources.

    Parameters
    ----------
    solids : tuple of Solid
        Any number, at their places in {P}.
    points : Array
        (N, 3) [mm] in {P}.
    sources : Array
        (N, 3) or (3,) [mm] in {P}.
    known : NDArray, optional
        (N,) of bool: points that are hidden already.
    own : NDArray, optional
        (N,) the solid that does not hide a point for certain, −1 where there is none.

    Returns
    -------
    NDArray
        (N,) of bool, the known ones too.
    """
    hidden = np.zeros(len(points), np.bool_) if known is None else known.copy()
    if solids and len(points):
        none = np.full(len(points), -1) if own is None else own
        _hide(world_of(solids), (writable(points), writable(np.atleast_2d(sources))), none, hidden)
    return hidden


@kernel
def _hide(world: World, segments: tuple[Array, Array], own: Index, hidden: Mask) -> None:
    """Set ``hidden`` (N,) for segments that a solid cuts; own: the solid that is not asked."""
    free = np.empty(len(hidden), np.bool_)
    for k in range(len(world.roots)):
        for i in range(len(free)):
            free[i] = hidden[i] or own[i] == k
        block(world.bvh, world.roots[k], segments, MeshPose(world.R[k], world.t[k]), free, hidden)


@kernel
def into_solids(world: World, point: Array, out: Array) -> None:
    """Set out (S, 3) to a point (3,) of {P} in the axes of each solid."""
    R, t = world.R, world.t
    for k in range(len(t)):
        x, y, z = point[0] - t[k, 0], point[1] - t[k, 1], point[2] - t[k, 2]
        for a in range(3):
            out[k, a] = R[k, 0, a] * x + R[k, 1, a] * y + R[k, 2, a] * z


@kernel
def between(world: World, points: Array, targets: Array, but: tuple[int, int], stack: Index) -> bool:
    """Whether a solid cuts the open segment between two points.

    points, targets: the two in the axes of each solid (S, 3). but: solids that are known not to (-1 where none is).
    stack: room to work in (256,).
    """
    boxes, children, members, triangles = world.bvh
    for k in range(len(world.roots)):
        if k == but[0] or k == but[1]:
            continue
        ox, oy, oz = points[k, 0], points[k, 1], points[k, 2]
        dx, dy, dz = targets[k, 0] - ox, targets[k, 1] - oy, targets[k, 2] - oz
        ix, iy, iz = inverse(dx), inverse(dy), inverse(dz)
        stack[0] = world.roots[k]
        top = 1
        while top > 0:
            top -= 1
            node = stack[top]
            near, far = _in_box(boxes[node], (ox, oy, oz), (ix, iy, iz), 1.0)
            if near > far + SLACK:
                continue
            first, second = children[node, 0], children[node, 1]
            if first >= 0:
                stack[top], stack[top + 1] = first, second
                top += 2
                continue
            for i in range(-1 - first, second - 1 - first):
                if cuts(triangles, members[i], (ox, oy, oz), (dx, dy, dz)):
                    return True
    return False


@kernel(inline=True)
def first_met(world: World, origins: Array, way: Array, stack: Index) -> Hit:
    """What a ray along the way (3,) of {P} meets first; origins: where it starts, in the axes of each solid (S, 3).

    stack: room to work in (256,). Of two boxes the one that lies nearer along the way is looked into first.
    """
    boxes, children, members, triangles = world.bvh
    R, solid, found, best, u, v = world.R, -1, -1, np.inf, 0.0, 0.0
    for k in range(len(world.roots)):
        ox, oy, oz = origins[k, 0], origins[k, 1], origins[k, 2]
        dx = R[k, 0, 0] * way[0] + R[k, 1, 0] * way[1] + R[k, 2, 0] * way[2]
        dy = R[k, 0, 1] * way[0] + R[k, 1, 1] * way[1] + R[k, 2, 1] * way[2]
        dz = R[k, 0, 2] * way[0] + R[k, 1, 2] * way[1] + R[k, 2, 2] * way[2]
        ix, iy, iz = inverse(dx), inverse(dy), inverse(dz)
        stack[0] = world.roots[k]
        top = 1
        while top > 0:
            top -= 1
            node = stack[top]
            near, far = _in_box(boxes[node], (ox, oy, oz), (ix, iy, iz), best)
            if near > far * (1 + SLACK) + SLACK:
                continue
            first, second = children[node, 0], children[node, 1]
            if first >= 0:
                ahead = (boxes[first, 0] + boxes[first, 3] - boxes[second, 0] - boxes[second, 3]) * dx
                ahead += (boxes[first, 1] + boxes[first, 4] - boxes[second, 1] - boxes[second, 4]) * dy
                ahead += (boxes[first, 2] + boxes[first, 5] - boxes[second, 2] - boxes[second, 5]) * dz
                stack[top], stack[top + 1] = (first, second) if ahead > 0 else (second, first)
                top += 2
                continue
            for i in range(-1 - first, second - 1 - first):
                distance, along, across = _meeting(triangles, members[i], (ox, oy, oz), (dx, dy, dz))
                if 0 < distance < best:
                    solid, found, best, u, v = k, members[i], distance, along, across
    return Hit(solid, found, best, u, v)


@kernel(inline=True)
def _in_box(box: Array, origin: Vector, over_way: Vector, most: float) -> Span:
    """From where to where, up to most, a ray is in a box (6,); nowhere where the first is the larger."""
    span = slab((box[0], box[3]), origin[0], over_way[0], (0.0, most))
    span = slab((box[1], box[4]), origin[1], over_way[1], span)
    return slab((box[2], box[5]), origin[2], over_way[2], span)


@kernel(inline=True)
def _meeting(triangles: Array, i: int, origin: Vector, way: Vector) -> Vector:
    """Distance to a triangle along a ray and the place on it; -1 where it is missed (as in `cuts`)."""
    (ox, oy, oz), (dx, dy, dz) = origin, way
    ax, ay, az = triangles[i, 0, 0], triangles[i, 0, 1], triangles[i, 0, 2]
    e1x, e1y, e1z = triangles[i, 1, 0] - ax, triangles[i, 1, 1] - ay, triangles[i, 1, 2] - az
    e2x, e2y, e2z = triangles[i, 2, 0] - ax, triangles[i, 2, 1] - ay, triangles[i, 2, 2] - az
    sx, sy, sz = ox - ax, oy - ay, oz - az
    px, py, pz = dy * e2z - dz * e2y, dz * e2x - dx * e2z, dx * e2y - dy * e2x
    det = e1x * px + e1y * py + e1z * pz
    if det == 0:
        return -1.0, 0.0, 0.0
    u = (sx * px + sy * py + sz * pz) / det
    if u < -EDGE_SLACK or u > 1 + EDGE_SLACK:
        return -1.0, 0.0, 0.0
    qx, qy, qz = sy * e1z - sz * e1y, sz * e1x - sx * e1z, sx * e1y - sy * e1x
    v = (dx * qx + dy * qy + dz * qz) / det
    if v < -EDGE_SLACK or u + v > 1 + EDGE_SLACK:
        return -1.0, 0.0, 0.0
    return (e2x * qx + e2y * qy + e2z * qz) / det, u, v


@kernel(inline=True)
def normal_at(world: World, hit: Hit, out: Array) -> None:
    """Set out (3,) to the unit normal for shading in {P} where a ray has met a solid, by its winding."""
    w = 1 - hit.u - hit.v
    corners = world.normals[hit.triangle]
    x = w * corners[0, 0] + hit.u * corners[1, 0] + hit.v * corners[2, 0]
    y = w * corners[0, 1] + hit.u * corners[1, 1] + hit.v * corners[2, 1]
    z = w * corners[0, 2] + hit.u * corners[1, 2] + hit.v * corners[2, 2]
    size = max(np.sqrt(x * x + y * y + z * z), 1e-300)
    R = world.R[hit.solid]
    for a in range(3):
        out[a] = (R[a, 0] * x + R[a, 1] * y + R[a, 2] * z) / size
