"""Solids made ready for light: triangles, smooth corner normals and a hierarchy, kept as long as the mesh lives."""

from __future__ import annotations

import weakref
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
import trimesh
from numpy.typing import NDArray

from perceptron_emu.bvh import Bvh, blocked, build_bvh
from perceptron_emu.scene import Solid

Array = NDArray[np.float64]

SMOOTH_COS = float(np.cos(np.deg2rad(35.0)))  # faces that meet at a smaller angle are shaded as one smooth surface


@dataclass(frozen=True, eq=False)
class Body:
    """A mesh in its own axes. triangles: (T, 3, 3) [mm]. normals: unit normals at their corners (T, 3, 3)."""

    triangles: Array
    normals: Array
    bvh: Bvh


_BODIES: dict[int, tuple[weakref.ref[trimesh.Trimesh], Body]] = {}


def body_of(solid: Solid) -> Body:
    """The solid's body, made once for a mesh."""
    key = id(solid.mesh)
    known = _BODIES.get(key)
    if known is not None and known[0]() is solid.mesh:
        return known[1]
    triangles = np.asarray(solid.mesh.triangles, dtype=float)
    body = Body(triangles, corner_normals(solid.mesh), build_bvh(triangles))
    _BODIES[key] = (weakref.ref(solid.mesh, lambda _: _BODIES.pop(key, None)), body)
    return body


def hidden_by_solid(solid: Solid, points: Array, sources: Array) -> NDArray[np.bool_]:
    """Whether the solid stands between points (N, 3) and sources (N, 3) or (3,) [mm], all in {P}."""
    pose = solid.T_sensor_mesh
    return blocked(body_of(solid).bvh, (points - pose.t) @ pose.R, (sources - pose.t) @ pose.R)


def corner_normals(mesh: trimesh.Trimesh) -> Array:
    """Unit normals (T, 3, 3) at the triangles' corners: the mean, by area, of the faces there that are nearly
    parallel.
    """
    triangles = np.asarray(mesh.triangles, dtype=float)
    area = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    face = area / np.maximum(np.linalg.norm(area, axis=1, keepdims=True), 1e-300)
    corners = np.unique(np.round(triangles.reshape(-1, 3), 6), axis=0, return_inverse=True)[1].reshape(-1)
    order = np.argsort(corners, kind="stable")
    bounds = np.flatnonzero(np.diff(corners[order], prepend=-1, append=-1))
    out = np.repeat(face[:, None], 3, 1).reshape(-1, 3)
    for first, last in pairwise(bounds):
        members = order[first:last]
        f = face[members // 3]
        near = (f @ f.T) > SMOOTH_COS
        total = near @ area[members // 3]
        out[members] = total / np.maximum(np.linalg.norm(total, axis=1, keepdims=True), 1e-300)
    return out.reshape(-1, 3, 3)
