"""Stripes: the part of the solids that the sheet lights and the camera sees."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from geometry import SensorModel
from perceptron_emu.bodies import body_of, hidden_by_solid
from perceptron_emu.config import EmulatorConfig
from perceptron_emu.occlusion import hidden_by_cylinder
from perceptron_emu.optics import sharp_sigma_px
from perceptron_emu.projection import project, to_camera
from perceptron_emu.samples import Samples, join
from perceptron_emu.scene import Scene, Solid
from perceptron_emu.section import cut_plane, first_reached
from perceptron_emu.sheet import axis_meets_sheet_mm, half_width_mm
from perceptron_emu.strings import SHEET_REACH, STEP, Cylinders
from perceptron_emu.transport import Light

Array = NDArray[np.float64]
Index = NDArray[np.int64]

MAX_PLANES = 61
TILE_PX = 64  # stripes are drawn in tiles of this side
BLOCKER = -1  # owner of a string's silhouette: it takes light and gives none here
OFF_SURFACE_MM = 1e-4


@dataclass(frozen=True, eq=False)
class Faces:
    """Triangles (T, 3, 3) [mm] in {P} that the sheet can reach, normals at their corners, the solid each belongs to (T,)."""

    triangles: Array
    normals: Array
    solid: Index


@dataclass(frozen=True, eq=False)
class LitPoints:
    """Nodes of lit surface in one plane of the sheet: points (N, 3), shading normals (N, 3), area element (N,) [mm²], solid (N,)."""

    xyz_mm: Array
    normal: Array
    area: Array
    solid: Index


def light_solids(scene: Scene, strings: Cylinders | None, config: EmulatorConfig, light: Light) -> Samples:
    """Nodes on all solids where laser and camera both reach, with the light that each sends to the chip.

    The sheet is cut into planes of constant x. In each the solids are segments and the laser a fan of rays from a point, so that what is lit follows exactly from
    the angular order of the segments' ends; string silhouettes cast their shadows.
    """
    sensor = scene.sensor
    faces = _faces_in_sheet(scene, config)
    if len(faces.triangles) == 0:
        return Samples.none()
    planes, step = _planes(faces, sensor, config)
    parts = []
    for x in planes:
        points = _lit_in_plane(faces, strings, float(x), step, sensor, config)
        parts.append(_seen(points, scene, strings, light))
    return join(parts)


def _faces_in_sheet(scene: Scene, config: EmulatorConfig) -> Faces:
    reach = 0.0
    triangles, normals, owner = [], [], []
    for number, solid in enumerate(scene.solids):
        pose, body = solid.T_sensor_mesh, body_of(solid)
        x = body.triangles @ pose.R[0] + pose.t[0]
        reach = SHEET_REACH * _widest(scene.sensor, config) / 2
        near = (x.min(1) <= reach) & (x.max(1) >= -reach)
        triangles.append(body.triangles[near] @ pose.R.T + pose.t)
        normals.append(body.normals[near] @ pose.R.T)
        owner.append(np.full(int(near.sum()), number))
    if not triangles:
        return Faces(np.zeros((0, 3, 3)), np.zeros((0, 3, 3)), np.zeros(0, dtype=np.int64))
    return Faces(np.concatenate(triangles), np.concatenate(normals), np.concatenate(owner))


def _widest(sensor: SensorModel, config: EmulatorConfig) -> float:
    """A half-width [mm] that the sheet does not exceed within twice the working distance."""
    middle = axis_meets_sheet_mm(sensor)
    return float(np.max(half_width_mm(config.laser, sensor, np.array([0.0, middle / 2, 2 * middle]))))


def _planes(faces: Faces, sensor: SensorModel, config: EmulatorConfig) -> tuple[Array, float]:
    """Equally spaced planes of the sheet [mm]: close enough for its Gaussian and for the spread that the camera sees."""
    distance = np.linalg.norm(faces.triangles[..., 1:] - sensor.laser_origin_mm[1:], axis=-1)
    ends = half_width_mm(config.laser, sensor, np.array([distance.min(), distance.max(), axis_meets_sheet_mm(sensor)]))
    thin, thick = float(ends.min()) / 2, float(min(ends.max(), _widest(sensor, config))) / 2
    n = int(np.clip(np.ceil(2 * SHEET_REACH * thick / (STEP * thin)), 11, MAX_PLANES)) | 1
    planes = np.linspace(-SHEET_REACH * thick, SHEET_REACH * thick, n)
    return planes, float(planes[1] - planes[0])


def _lit_in_plane(
    faces: Faces, strings: Cylinders | None, x: float, step: float, sensor: SensorModel, config: EmulatorConfig
) -> LitPoints:
    ends, normals, owner = cut_plane(faces.triangles, faces.normals, x)
    if strings is not None:
        silhouettes = _silhouettes(strings, x, sensor.laser_origin_mm[1:])
        ends = np.concatenate([ends, silhouettes])
        normals = np.concatenate([normals, np.zeros((len(silhouettes), 2, 3))])
        owner = np.concatenate([owner, np.full(len(silhouettes), BLOCKER)])
    which, where = first_reached(ends, sensor.laser_origin_mm[1:], sensor.fan_rad)
    keep = owner[which] != BLOCKER
    which, where = which[keep], where[keep]
    count = _node_counts(ends[which], where, x, sensor, config)
    return _nodes(faces, ends[which], normals[which], owner[which], where, count, x, step, sensor)


def _silhouettes(strings: Cylinders, x: float, origin: Array) -> Array:
    """Segments (n, 2, 2) as (y, z) across the strings as the emitter sees them in the plane of constant x."""
    slope = strings.directions[:, 0]
    with np.errstate(divide="ignore", invalid="ignore"):
        t = (x - strings.starts[:, 0]) / slope
        centre = strings.starts[:, 1:] + t[:, None] * strings.directions[:, 1:]
        towards = centre - origin
        distance = np.linalg.norm(towards, axis=1)
        towards /= distance[:, None]
        along = np.sum(towards * strings.directions[:, 1:], 1)
        sine = strings.radius * np.sqrt(1 - along**2) / (distance * np.abs(slope))
        reached = (t >= 0) & (t <= strings.lengths) & (sine < 0.5)
    half = (distance * sine / np.sqrt(1 - np.where(reached, sine, 0) ** 2))[:, None]
    across = np.column_stack([towards[:, 1], -towards[:, 0]])
    return np.stack([centre - half * across, centre + half * across], 1)[reached]


def _node_counts(ends: Array, where: Array, x: float, sensor: SensorModel, config: EmulatorConfig) -> Index:
    """Pairs of Gauss nodes for each piece, so that they lie closer in the image than the blur's σ."""
    piece = ends[:, :1] + where[:, :, None] * (ends[:, 1:] - ends[:, :1])
    xyz = np.concatenate([np.full((*piece.shape[:2], 1), x), piece], -1)
    uv = project(sensor, xyz)
    length = np.linalg.norm(uv[:, 1] - uv[:, 0], axis=1)
    sigma = sharp_sigma_px(config.optics, sensor, config.laser.wavelength_nm)
    count = np.clip(np.ceil(np.nan_to_num(length) / (1.2 * sigma)), 1, 4000).astype(np.int64)
    return np.where(np.isnan(length), 0, count)


def _nodes(faces, ends, normals, owner, where, count, x, step, sensor):  # type: ignore[no-untyped-def]
    yz, normal, length, piece = _gauss_nodes(ends, normals, where, count)
    xyz = np.column_stack([np.full(len(yz), x), yz])
    triangle = faces.triangles[owner[piece]]
    flat = np.cross(triangle[:, 1] - triangle[:, 0], triangle[:, 2] - triangle[:, 0])
    flat /= np.linalg.norm(flat, axis=1, keepdims=True)
    area = length * step / np.sqrt(np.maximum(1 - flat[:, 0] ** 2, 1e-12))
    normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-12)
    away = np.sum(normal[:, 1:] * (sensor.laser_origin_mm[1:] - yz), 1) < 0
    normal[away] *= -1
    return LitPoints(xyz, normal, area, faces.solid[owner[piece]])


def _gauss_nodes(ends: Array, normals: Array, where: Array, count: Index) -> tuple[Array, Array, Array, Index]:
    """Two Gauss-Legendre nodes on each of count equal parts of every piece: (y, z), normal, length [mm], piece."""
    piece = np.repeat(np.arange(len(count)), 2 * count)
    first = np.cumsum(2 * count) - 2 * count
    number = np.arange(len(piece)) - first[piece]
    inner = (number // 2 + 0.5 + np.where(number % 2, 0.5, -0.5) / np.sqrt(3)) / count[piece]
    s = (where[piece, 0] + inner * (where[piece, 1] - where[piece, 0]))[:, None]
    along = ends[:, 1] - ends[:, 0]
    length = np.linalg.norm(along, axis=1) * np.abs(where[:, 1] - where[:, 0]) / np.maximum(2 * count, 1)
    normal = normals[piece, 0] + s * (normals[piece, 1] - normals[piece, 0])
    return ends[piece, 0] + s * along[piece], normal, length[piece], piece


def _seen(points: LitPoints, scene: Scene, strings: Cylinders | None, light: Light) -> Samples:
    """The nodes that the camera sees, inside the image and past all that stands before it."""
    sensor = scene.sensor
    uv = project(sensor, points.xyz_mm)
    margin = 40.0
    inside = np.all((uv > -margin) & (uv < [sensor.width_px + margin, sensor.height_px + margin]), axis=1)
    inside &= to_camera(sensor, points.xyz_mm)[:, 2] > 0
    xyz, normal, area, number, uv = (a[inside] for a in (points.xyz_mm, points.normal, points.area, points.solid, uv))
    electrons = np.zeros(len(xyz))
    for k in np.unique(number):
        mine = number == k
        electrons[mine] = light.electrons(xyz[mine], normal[mine], scene.solids[k].material) * area[mine]
    seen = electrons > 0
    start = xyz + OFF_SURFACE_MM * normal
    for solid in scene.solids:
        seen[seen] = ~hidden_by_solid(solid, start[seen], sensor.camera_centre_mm)
    if strings is not None:
        for j in range(len(strings.labels)):
            cylinder = strings.starts[j], strings.directions[j], strings.lengths[j], strings.radius
            seen[seen] = ~hidden_by_cylinder(start[seen], sensor.camera_centre_mm, *cylinder)
    tile = np.floor(uv[seen] / TILE_PX).astype(np.int64) + 8
    group = 1_000 + (number[seen] * 2048 + tile[:, 1]) * 2048 + tile[:, 0]
    return Samples(xyz[seen], electrons[seen], group)
