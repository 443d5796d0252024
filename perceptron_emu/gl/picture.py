"""The picture of the cell: arm as links, sensor, sheet and field of view, jig."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from geometry import Pose, Sensor, field_of_view
from jig_cad import Jig
from jig_cad.solids import jig_solids
from perceptron_emu.gl.context import draw_gl, load_pyrender
from perceptron_emu.gl.world import two_sided

if TYPE_CHECKING:
    import trimesh

Array = NDArray[np.float64]
Picture = NDArray[np.uint8]
Colour = tuple[float, float, float, float]

ARM, JOINT, SENSOR = (0.85, 0.45, 0.1, 1.0), (0.25, 0.25, 0.28, 1.0), (0.2, 0.3, 0.5, 1.0)
SHEET, VIEW, STRING, PLATE = (
    (1.0, 0.1, 0.1, 0.25),
    (0.1, 0.7, 0.3, 0.45),
    (0.95, 0.95, 0.9, 1.0),
    (0.35, 0.35, 0.4, 1.0),
)
FLOOR = (0.75, 0.75, 0.72, 1.0)
VISIBLE_STRING_MM = 2.0  # strings are drawn thicker than they are: 0.3 mm is nothing in a picture of metres
SHEET_REACH = 1.35  # of the way to the jig
VIEW_OFFSET_MM = 3.0  # off the sheet, that the two do not fight for the depth buffer


@dataclass(frozen=True, eq=False)
class CellView:
    """What stands in the cell, all in the base frame.

    Parameters
    ----------
    sensor : Sensor
        With a camera.
    T_base_sensor : Pose
        Its place.
    jigs : tuple of (Jig, Pose)
        A jig and its T_base_jig each.
    links : Pose, optional
        Poses of the arm's link frames from base to hand (n, …); None for a sensor without an arm.
    eye_direction : tuple of float
        From the cell to the eye.
    """

    sensor: Sensor
    T_base_sensor: Pose
    jigs: tuple[tuple[Jig, Pose], ...]
    links: Pose | None = None
    eye_direction: tuple[float, float, float] = field(default=(0.9, -1.3, 0.8))


def cell_picture(cell: CellView, width: int = 1280, height: int = 960) -> Picture:
    """A colour picture of the cell: arm, sensor, sheet and field of view, jigs.

    Parameters
    ----------
    cell : CellView
        What stands where.
    width, height : int
        [px].

    Returns
    -------
    Picture
        (H, W, 3) uint8.

    Raises
    ------
    MissingDependencyError
        Where there is no OpenGL.
    """
    import trimesh  # a quarter of a second, and most commands build no mesh

    parts: list[tuple[trimesh.Trimesh, Colour]] = []
    if cell.links is not None:
        parts += _arm(cell.links)
    parts += _sensor(cell)
    for jig, pose in cell.jigs:
        parts += _jig(jig, pose)
    corners = np.concatenate([m.bounds for m, _ in parts])
    floor = trimesh.creation.box((4000, 4000, 10))
    floor.apply_translation([0, 0, min(0.0, float(corners[:, 2].min())) - 6])
    return _draw([*parts, (floor, FLOOR)], corners, np.array(cell.eye_direction), width, height)


def _arm(links: Pose) -> list[tuple[trimesh.Trimesh, Colour]]:
    import trimesh

    points = links.t
    parts: list[tuple[trimesh.Trimesh, Colour]] = []
    radius = np.linspace(70, 35, len(points))
    for i, point in enumerate(points):
        joint = trimesh.creation.icosphere(2, radius[i] * 1.15)
        joint.apply_translation(point)
        parts.append((joint, JOINT))
        if i and np.linalg.norm(point - points[i - 1]) > 1:
            segment = np.stack([points[i - 1], point])
            parts.append((trimesh.creation.cylinder(radius[i], segment=segment, sections=32), ARM))
    return parts


def _sensor(cell: CellView) -> list[tuple[trimesh.Trimesh, Colour]]:
    import trimesh

    sensor, pose = cell.sensor, cell.T_base_sensor
    ends = sensor.sheet.origin_mm[None]
    if sensor.camera is not None:
        ends = np.stack([*ends, sensor.camera.centre_mm])
    low, high = ends.min(0) - np.array([25, 30, 60]), ends.max(0) + np.array([25, 30, 0])
    body = trimesh.creation.box(bounds=np.stack([low, high]))
    seen = field_of_view(sensor)
    reach = _working_distance(cell) * SHEET_REACH
    half = np.tan(sensor.sheet.fan_rad / 2) * reach
    oy, oz = sensor.sheet.origin_mm[1:]
    fan = np.array([[0, oy, oz], [0, oy - half, oz + reach], [0, oy + half, oz + reach]])
    seen = seen[np.all(seen[:, 1:] <= oz + reach, axis=1)] if np.any(seen[:, 1] > oz + reach) else seen
    parts = [(body, SENSOR), (trimesh.Trimesh(fan, [[0, 1, 2]], process=False), SHEET)]
    if len(seen) >= 3:
        corners = np.column_stack([np.full(len(seen), VIEW_OFFSET_MM), seen])
        faces = [[0, i, i + 1] for i in range(1, len(seen) - 1)]
        parts.append((trimesh.Trimesh(corners, faces, process=False), VIEW))
    return [(m.apply_transform(pose.matrix), c) for m, c in parts]


def _working_distance(cell: CellView) -> float:
    """Distance [mm] from the sensor to the nearest jig, or 400 without one."""
    middle = [pose @ jig.anchors_mm.mean(0) for jig, pose in cell.jigs]
    return min((float(np.linalg.norm(m - cell.T_base_sensor.t)) for m in middle), default=400.0)


def _jig(jig: Jig, pose: Pose) -> list[tuple[trimesh.Trimesh, Colour]]:
    import trimesh

    solids = [(m.copy().apply_transform(pose.matrix), PLATE) for m in jig_solids(jig, strings=False).values()]
    ends = zip(pose @ jig.starts, pose @ jig.ends, strict=True)
    return [*solids, *((trimesh.creation.cylinder(VISIBLE_STRING_MM / 2, segment=np.stack(e)), STRING) for e in ends)]


def _draw(parts: list[tuple[Any, Colour]], corners: Array, towards: Array, width: int, height: int) -> Picture:
    pyrender = load_pyrender()
    world = pyrender.Scene(ambient_light=[0.35, 0.35, 0.35], bg_color=[0.96, 0.97, 0.98, 1.0])
    # one node each: pyrender draws nodes in the order of their addresses, which no two runs share
    for blended in (False, True):
        drawn = [_coloured(mesh, colour) for mesh, colour in parts if (colour[3] < 1) == blended]
        world.add(pyrender.Mesh([primitive for one in drawn for primitive in one.primitives]))
    centre = (corners.min(0) + corners.max(0)) / 2
    radius = float(np.linalg.norm(corners.max(0) - corners.min(0))) / 2
    away = towards / np.linalg.norm(towards)
    view = np.deg2rad(35.0)
    distance = 0.8 * radius / np.sin(view / 2)
    eye = _look_at(centre + distance * away, centre)
    near, far = max(distance - 3 * radius, 1.0), distance + 6000
    world.add(pyrender.PerspectiveCamera(view, znear=near, zfar=far, aspectRatio=width / height), pose=eye)
    world.add(pyrender.DirectionalLight(intensity=3.0), pose=_look_at(np.array([1.0, -2.0, 3.0]), np.zeros(3)))
    world.add(pyrender.DirectionalLight(intensity=1.5), pose=_look_at(np.array([-2.0, -1.0, 1.0]), np.zeros(3)))
    return np.array(draw_gl(world, width, height)[0])


def _coloured(mesh: trimesh.Trimesh, colour: Colour) -> Any:
    pyrender = load_pyrender()
    material = pyrender.MetallicRoughnessMaterial(
        baseColorFactor=colour,
        metallicFactor=0.0,
        roughnessFactor=0.8,
        alphaMode="BLEND" if colour[3] < 1 else "OPAQUE",
        doubleSided=True,
    )
    return pyrender.Mesh.from_trimesh(two_sided(mesh) if colour[3] < 1 else mesh, material=material, smooth=False)


def _look_at(eye: Array, target: Array) -> Array:
    """Pose (4, 4) of an OpenGL camera at ``eye`` that looks at ``target``, z of the base upwards."""
    back = (eye - target) / np.linalg.norm(eye - target)
    right = np.cross([0.0, 0.0, 1.0], back)
    right /= np.linalg.norm(right)
    out = np.eye(4)
    out[:3, 0], out[:3, 1], out[:3, 2], out[:3, 3] = right, np.cross(back, right), back, eye
    return out
