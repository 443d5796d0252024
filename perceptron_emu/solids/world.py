"""All solids of a scene as one: what a ray meets first, and whether anything stands between two points."""

from __future__ import annotations

from collections import OrderedDict
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from geometry.compiled import kernel
from perceptron_emu.scene import Solid
from perceptron_emu.solids.bodies import Body, body_of
from perceptron_emu.solids.bvh import EDGE_SLACK, SLACK, Bvh, cuts

Array = NDArray[np.float64]
Index = NDArray[np.int64]

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
    R, t : Array
        (S, 3, 3), (S, 3) [mm]: T_sensor_mesh of each.
    """

    bvh: Bvh
    roots: Index
    first: Index
    outwards: Array
    normals: Array
    closed: NDArray[np.bool_]
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
        np.zeros((len(bodies), 3, 3)), np.zeros((len(bodies), 3)),
    )  # fmt: skip


@kernel
def between(world: World, point: Array, target: Array, stack: Index) -> bool:
    """Whether a solid cuts the open segment between two points (3,) of {P}. stack: room to work in (256,)."""
    boxes, children, members, triangles = world.bvh
    R, t = world.R, world.t
    px, py, pz = point[0], point[1], point[2]
    wx, wy, wz = target[0] - px, target[1] - py, target[2] - pz
    for k in range(len(world.roots)):
        x, y, z = px - t[k, 0], py - t[k, 1], pz - t[k, 2]
        ox = R[k, 0, 0] * x + R[k, 1, 0] * y + R[k, 2, 0] * z
        oy = R[k, 0, 1] * x + R[k, 1, 1] * y + R[k, 2, 1] * z
        oz = R[k, 0, 2] * x + R[k, 1, 2] * y + R[k, 2, 2] * z
        dx = R[k, 0, 0] * wx + R[k, 1, 0] * wy + R[k, 2, 0] * wz
        dy = R[k, 0, 1] * wx + R[k, 1, 1] * wy + R[k, 2, 1] * wz
        dz = R[k, 0, 2] * wx + R[k, 1, 2] * wy + R[k, 2, 2] * wz
        ix = 1 / dx if abs(dx) > 1e-12 else 1e12
        iy = 1 / dy if abs(dy) > 1e-12 else 1e12
        iz = 1 / dz if abs(dz) > 1e-12 else 1e12
        stack[0] = world.roots[k]
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
                if cuts(triangles, members[i], (ox, oy, oz), (dx, dy, dz)):
                    return True
    return False


@kernel
def first_met(world: World, origin: Array, way: Array, stack: Index, own: Array) -> Hit:
    """What a ray of {P} from the origin (3,) along the way (3,) meets first. stack, own: to work in (256,), (2, 3)."""
    best = Hit(-1, -1, np.inf, 0.0, 0.0)
    for k in range(len(world.roots)):
        for a in range(3):
            own[0, a], own[1, a] = 0.0, 0.0
            for b in range(3):
                own[0, a] += world.R[k, b, a] * (origin[b] - world.t[k, b])
                own[1, a] += world.R[k, b, a] * way[b]
        best = _nearest(world.bvh, world.roots[k], own, stack, k, best)
    return best


@kernel
def _nearest(bvh: Bvh, root: int, ray: Array, stack: Index, solid: int, best: Hit) -> Hit:
    """The nearer of the best hit so far and one of a solid. ray: origin and way (2, 3) in the solid's axes."""
    boxes, children = bvh.boxes, bvh.children
    inverse = np.empty(3)
    for a in range(3):
        inverse[a] = 1 / ray[1, a] if abs(ray[1, a]) > 1e-12 else 1e12
    stack[0] = root
    top = 1
    while top > 0:
        top -= 1
        node = stack[top]
        near, far = 0.0, best.distance
        for a in range(3):
            p, q = (boxes[node, a] - ray[0, a]) * inverse[a], (boxes[node, 3 + a] - ray[0, a]) * inverse[a]
            near, far = max(near, min(p, q)), min(far, max(p, q))
        if near > far * (1 + 1e-9) + 1e-9:
            continue
        first, second = children[node, 0], children[node, 1]
        if first >= 0:
            stack[top], stack[top + 1] = first, second
            top += 2
            continue
        for i in range(-1 - first, second - 1 - first):
            triangle = bvh.members[i]
            distance, u, v = _meeting(bvh.triangles[triangle], ray)
            if 0 < distance < best.distance:
                best = Hit(solid, triangle, distance, u, v)
    return best


@kernel
def _meeting(triangle: Array, ray: Array) -> tuple[float, float, float]:
    """Distance to a triangle (3, 3) along a ray (2, 3) and the place on it; -1 where it is missed (as in `cuts`)."""
    (ax, ay, az), (dx, dy, dz) = (triangle[0, 0], triangle[0, 1], triangle[0, 2]), (ray[1, 0], ray[1, 1], ray[1, 2])
    e1x, e1y, e1z = triangle[1, 0] - ax, triangle[1, 1] - ay, triangle[1, 2] - az
    e2x, e2y, e2z = triangle[2, 0] - ax, triangle[2, 1] - ay, triangle[2, 2] - az
    sx, sy, sz = ray[0, 0] - ax, ray[0, 1] - ay, ray[0, 2] - az
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


@kernel
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
