"""Solids made ready for light: triangles, smooth corner normals and a hierarchy, kept as long as the mesh lives."""

from __future__ import annotations

import weakref
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from geometry.compiled import kernel
from perceptron_emu.scene import Solid
from perceptron_emu.solids.bvh import Bvh, blocked, build_bvh
from perceptron_emu.solids.flat_faces import FlatFaces, flat_faces

if TYPE_CHECKING:
    import trimesh

Array = NDArray[np.float64]
Index = NDArray[np.int64]

SMOOTH_COS = float(np.cos(np.deg2rad(35.0)))  # faces that meet at a smaller angle are shaded as one smooth surface
MAX_CONVEX_FACES = 10_000  # asked in their square, 0.1 s once a mesh; larger ones count as not convex, which is safe
FLAT = 1e-9  # of a mesh's size: corners no farther from a face's plane lie in it


@dataclass(frozen=True, eq=False)
class Body:
    """A mesh made ready for light, in its own axes.

    Parameters
    ----------
    triangles : Array
        (T, 3, 3) [mm].
    outwards : Array
        Their unit normals (T, 3), by their winding.
    flat : FlatFaces
        Its plane parts, by the edges around them.
    normals : Array
        Unit normals for shading at the triangles' corners (T, 3, 3).
    bvh : Bvh
        Over the triangles.
    closed : bool
        Without a hole in its surface and wound outwards, so that back faces are never seen.
    convex : bool
        It never hides a part of its own surface that faces the camera.
    bare : NDArray
        (T,) of bool: nothing of it stands before what faces that triangle.
    """

    triangles: Array
    outwards: Array
    flat: FlatFaces
    normals: Array
    bvh: Bvh
    closed: bool
    convex: bool
    bare: NDArray[np.bool_]


_BODIES: dict[int, tuple[weakref.ref[trimesh.Trimesh], Body]] = {}


def body_of(solid: Solid) -> Body:
    """The solid's body, made once for a mesh and kept as long as the mesh lives.

    Parameters
    ----------
    solid : Solid
        Its mesh counts alone.

    Returns
    -------
    Body
        In the mesh's axes.
    """
    key = id(solid.mesh)
    known = _BODIES.get(key)
    if known is not None and known[0]() is solid.mesh:
        return known[1]
    mesh = solid.mesh
    triangles = np.asarray(mesh.triangles, dtype=float)
    closed = bool(mesh.is_volume)
    convex, bare = _bare(triangles, np.array(mesh.vertices, dtype=float), closed)
    outwards = _face_normals(triangles)[0]
    flat = flat_faces(np.array(mesh.vertices, dtype=float), np.array(mesh.faces, dtype=np.int64), outwards)
    bvh = build_bvh(triangles)
    body = Body(triangles, outwards, flat, corner_normals(mesh), bvh, closed, convex, bare)
    _BODIES[key] = (weakref.ref(solid.mesh, lambda _: _BODIES.pop(key, None)), body)
    return body


def hidden_by_solid(
    solid: Solid, points: Array, sources: Array, but: NDArray[np.bool_] | None = None
) -> NDArray[np.bool_]:
    """Whether a solid stands between points and sources.

    Parameters
    ----------
    solid : Solid
        At its place in {P}.
    points : Array
        (N, 3) [mm] in {P}.
    sources : Array
        (N, 3) or (3,) [mm] in {P}.
    but : NDArray, optional
        (N,) of bool: points that it does not hide for certain, or that need not be asked.

    Returns
    -------
    NDArray
        (N,) of bool.
    """
    return blocked(body_of(solid).bvh, points, sources, solid.T_sensor_mesh.R, solid.T_sensor_mesh.t, but)


def _bare(triangles: Array, corners: Array, closed: bool) -> tuple[bool, NDArray[np.bool_]]:
    """Whether all ``corners`` (V, 3) lie on one side of every triangle's plane, and of which triangles (T,) nothing
    stands above; false for meshes too large to ask.
    """
    if len(triangles) > MAX_CONVEX_FACES:
        return False, np.zeros(len(triangles), dtype=bool)
    above, below = _sides(triangles, corners, FLAT * float(np.ptp(corners, axis=0).max()))
    convex = not np.any(above & below)
    return convex, ~above if closed else np.full(len(triangles), convex)


@kernel
def _sides(triangles: Array, corners: Array, slack: float) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
    """Whether corners lie farther than slack above, and below, each triangle's plane (T,)."""
    above, below = np.zeros(len(triangles), np.bool_), np.zeros(len(triangles), np.bool_)
    for t in range(len(triangles)):
        a, b, c = triangles[t, 0], triangles[t, 1] - triangles[t, 0], triangles[t, 2] - triangles[t, 0]
        nx, ny, nz = b[1] * c[2] - b[2] * c[1], b[2] * c[0] - b[0] * c[2], b[0] * c[1] - b[1] * c[0]
        size = np.sqrt(nx * nx + ny * ny + nz * nz)
        for k in range(len(corners)):
            height = nx * (corners[k, 0] - a[0]) + ny * (corners[k, 1] - a[1]) + nz * (corners[k, 2] - a[2])
            above[t] |= height > slack * size
            below[t] |= height < -slack * size
            if above[t] and below[t]:
                break
    return above, below


def corner_normals(mesh: trimesh.Trimesh) -> Array:
    """Unit normals (T, 3, 3) at the triangles' corners: the mean, by area, of the faces there that are nearly
    parallel.
    """
    triangles = np.asarray(mesh.triangles, dtype=float)
    face, area = _face_normals(triangles)
    corners = np.round(triangles.reshape(-1, 3), 6)
    order = np.lexsort(corners.T)
    new = np.any(np.diff(corners[order], axis=0) != 0, axis=1)
    bounds = np.concatenate([[0], np.flatnonzero(new) + 1, [len(corners)]])
    return _smooth(order, bounds, area, face).reshape(-1, 3, 3)


def _face_normals(triangles: Array) -> tuple[Array, Array]:
    """Unit normals (T, 3), and normals as long as twice the area (T, 3) [mm²]."""
    area = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    return area / np.maximum(np.linalg.norm(area, axis=1, keepdims=True), 1e-300), area


@kernel
def _smooth(order: Index, bounds: Index, area: Array, face: Array) -> Array:
    """Normals (3T, 3), a row a corner; those of order[bounds[k] : bounds[k + 1]] are in one place."""
    out = np.empty((len(order), 3))
    for k in range(len(bounds) - 1):
        for i in order[bounds[k] : bounds[k + 1]]:
            x, y, z = 0.0, 0.0, 0.0
            mine = face[i // 3]
            for j in order[bounds[k] : bounds[k + 1]]:
                other, weight = face[j // 3], area[j // 3]
                if mine[0] * other[0] + mine[1] * other[1] + mine[2] * other[2] > SMOOTH_COS:
                    x, y, z = x + weight[0], y + weight[1], z + weight[2]
            size = max(np.sqrt(x * x + y * y + z * z), 1e-300)
            out[i, 0], out[i, 1], out[i, 2] = x / size, y / size, z / size
    return out
