"""Balls, plates, edges and wedges as meshes in their own axes [mm], to be lit; nothing of solving is in them."""

from __future__ import annotations

from functools import singledispatch
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from geometry import InputError, Target
from jig_cad.flat import Edge, Plane, Wedge
from jig_cad.sphere import Balls, Sphere

if TYPE_CHECKING:
    import trimesh

Array = NDArray[np.float64]

PLATE_MM = (180.0, 140.0)  # of a plane or an edge whose size is not given
FACE_MM = 60.0  # of a wedge's faces, from the ridge
FACE_WIDTH_MM = 200.0
_HALVINGS = 5  # of an icosahedron's edges: its faces are within 2e-4 of the radius of the ball


@singledispatch
def target_meshes(target: Target) -> dict[str, trimesh.Trimesh]:
    """The target's body by name of its part, in its own axes; a kind of one's own adds its by ``.register``.

    Parameters
    ----------
    target : Target
        A ball, balls, a plane, an edge or a wedge; plates and faces have no thickness and z points out of them.

    Returns
    -------
    dict of str to trimesh.Trimesh
        A ball's faces are as often inside its surface as outside.

    Raises
    ------
    InputError
        For a target whose body is not known.
    """
    raise InputError(f"a target of class {type(target).__name__} has no body that could be lit")


@target_meshes.register(Sphere)
def _sphere(ball: Sphere) -> dict[str, trimesh.Trimesh]:
    return {"ball": _ball(np.zeros(3), ball.diameter_mm)}


@target_meshes.register(Balls)
def _balls(target: Balls) -> dict[str, trimesh.Trimesh]:
    balls = zip(target.names, target.centres_mm, target.diameters_mm, strict=True)
    return {f"ball {name}": _ball(centre, float(diameter)) for name, centre, diameter in balls}


@target_meshes.register(Plane)
def _plane(plane: Plane) -> dict[str, trimesh.Trimesh]:
    w, h = (plane.width_mm or PLATE_MM[0]) / 2, (plane.height_mm or PLATE_MM[1]) / 2
    return {"plate": _quad([[-w, -h, 0.0], [w, -h, 0.0], [w, h, 0.0], [-w, h, 0.0]])}


@target_meshes.register(Edge)
def _edge(_: Edge) -> dict[str, trimesh.Trimesh]:
    w, h = PLATE_MM[0] / 2, PLATE_MM[1]
    return {"plate": _quad([[-w, -h, 0.0], [w, -h, 0.0], [w, 0.0, 0.0], [-w, 0.0, 0.0]])}


@target_meshes.register(Wedge)
def _wedge(wedge: Wedge) -> dict[str, trimesh.Trimesh]:
    return {name: _face(wedge, side) for name, side in zip(wedge.features, (1.0, -1.0), strict=True)}


def _ball(centre: Array, diameter_mm: float) -> trimesh.Trimesh:
    import trimesh  # a quarter of a second, and most commands build no mesh

    unit = trimesh.creation.icosphere(_HALVINGS, 1.0)
    inside = 0.5 * (1.0 + float(np.mean(np.linalg.norm(unit.triangles_center, axis=1))))
    return trimesh.Trimesh(unit.vertices * (diameter_mm / 2 / inside) + centre, unit.faces, process=False)


def _quad(corners: list[list[float]]) -> trimesh.Trimesh:
    import trimesh

    return trimesh.Trimesh(corners, [[0, 1, 2], [0, 2, 3]], process=False)


def _face(wedge: Wedge, side: float) -> trimesh.Trimesh:
    half, w = np.deg2rad(wedge.angle_deg) / 2, FACE_WIDTH_MM / 2
    y, z = side * FACE_MM * np.sin(half), -FACE_MM * np.cos(half)
    return _quad([[-side * w, 0.0, 0.0], [side * w, 0.0, 0.0], [side * w, y, z], [-side * w, y, z]])
