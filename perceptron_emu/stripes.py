"""Stripes: the part of the solids that the sheet lights and the camera sees."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from geometry import SensorModel
from perceptron_emu.bodies import body_of, hidden_by_solid
from perceptron_emu.config import EmulatorConfig
from perceptron_emu.occlusion import hidden_by_strings
from perceptron_emu.optics import sharp_sigma_px
from perceptron_emu.projection import project
from perceptron_emu.samples import Samples
from perceptron_emu.scene import Scene
from perceptron_emu.section import cut_plane, first_reached
from perceptron_emu.sheet_faces import Faces, faces_in_sheet, sheet_planes
from perceptron_emu.strings import Cylinders
from perceptron_emu.transport import Light

Array = NDArray[np.float64]
Index = NDArray[np.int64]

TILE_PX = 64  # stripes are drawn in tiles of this side
FIRST_STRIPE_GROUP = 1_000
TILES_A_ROW = 2048
GROUPS_A_SOLID = TILES_A_ROW**2
OFF_SURFACE_MM = 1e-4
NODE_STEP = 1.7  # length of image, in σ of the blur, that a pair of Gauss nodes covers: ripple 3e-4
MARGIN_PX = 40.0  # light this far outside the image can still reach into it


@dataclass(frozen=True, eq=False)
class Pieces:
    """Straight pieces of surface that the laser reaches first, each in one plane of the sheet.

    ends: (n, 2, 3) [mm] in {P}. normals: unit shading normals at the ends (n, 2, 3). face: the triangle (n,).
    """

    ends: Array
    normals: Array
    face: Index


def light_solids(scene: Scene, strings: Cylinders | None, config: EmulatorConfig, light: Light) -> Samples:
    """Nodes on all solids where laser and camera both reach, with the light that each sends to the chip.

    The sheet is cut into planes of constant x. In each the solids are segments and the laser a fan of rays from a
    point,
    so that what is lit follows exactly from the angular order of the segments' ends; strings cast their shadows.
    """
    faces = faces_in_sheet(scene, config)
    if len(faces.triangles) == 0:
        return Samples.none()
    planes, step = sheet_planes(faces, scene.sensor, config)
    pieces = _in_view(faces, lit_pieces(faces, strings, planes, scene.sensor), scene.sensor)
    return _seen(faces, pieces, step, scene, strings, config, light)


def lit_pieces(faces: Faces, strings: Cylinders | None, planes: Array, sensor: SensorModel) -> Pieces:
    """What the laser reaches first in the planes of constant x."""
    found = []
    origin = np.array(sensor.laser_origin_mm[1:])
    shades = _silhouettes(strings, planes, origin) if strings is not None else [np.zeros((0, 2, 2))] * len(planes)
    for x, shade in zip(planes, shades, strict=True):
        ends, normals, face = cut_plane(faces.triangles, faces.normals, x)
        n = len(face)
        which, where = first_reached(np.concatenate([ends, shade]), origin, sensor.fan_rad)
        where, which = where[which < n], which[which < n]
        yz, normal = (a[which, :1] + where[:, :, None] * (a[which, 1:] - a[which, :1]) for a in (ends, normals))
        found.append(Pieces(np.concatenate([np.full((len(yz), 2, 1), x), yz], -1), normal, face[which]))
    return Pieces(*(np.concatenate([getattr(p, name) for p in found]) for name in ("ends", "normals", "face")))


def _silhouettes(strings: Cylinders, planes: Array, origin: Array) -> list[Array]:
    """For each plane of constant x segments (n, 2, 2) as (y, z) across the strings as the emitter sees them in it."""
    slope = strings.directions[:, 0]
    with np.errstate(divide="ignore", invalid="ignore"):
        t = (planes[:, None] - strings.starts[:, 0]) / slope  # (K, S)
        centre = strings.starts[:, 1:] + t[..., None] * strings.directions[:, 1:]
        towards = centre - origin
        distance = np.sqrt(np.einsum("...i,...i->...", towards, towards))
        towards /= distance[..., None]
        along = np.sum(towards * strings.directions[:, 1:], -1)
        # the ray at δ from the axis point passes the axis at s |sin δ| |d_x| / √(1 − (r·d)²)
        sine = strings.radius * np.sqrt(1 - along**2) / (distance * np.abs(slope))
        reached = (t >= 0) & (t <= strings.lengths) & (sine < 0.5)
        half = (distance * sine / np.sqrt(1 - sine**2))[..., None]
        across = np.stack([towards[..., 1], -towards[..., 0]], -1)
        ends = np.stack([centre - half * across, centre + half * across], -2)
    return [e[r] for e, r in zip(ends, reached, strict=True)]


def _in_view(faces: Faces, pieces: Pieces, sensor: SensorModel) -> Pieces:
    """The pieces that turn the lit side to the camera and whose box in the image touches it."""
    corner, normal = faces.triangles[pieces.face, 0], _face_normals(faces)[pieces.face]
    to_laser = np.einsum("ij,ij->i", normal[:, 1:], sensor.laser_origin_mm[1:] - corner[:, 1:])
    to_laser += normal[:, 0] * (pieces.ends[:, 0, 0] - corner[:, 0])  # the sheet's rays keep their x
    keep = to_laser * np.einsum("ij,ij->i", normal, sensor.camera_centre_mm - corner) > 0
    uv = project(sensor, pieces.ends[keep])
    size = np.array([sensor.width_px, sensor.height_px]) - 1 + MARGIN_PX
    with np.errstate(invalid="ignore"):
        touches = np.all((uv.max(1) > -MARGIN_PX) & (uv.min(1) < size), axis=1)
    keep[keep] = touches | np.any(np.isnan(uv), axis=(1, 2))
    return Pieces(pieces.ends[keep], pieces.normals[keep], pieces.face[keep])


def _seen(
    faces: Faces,
    pieces: Pieces,
    step: float,
    scene: Scene,
    strings: Cylinders | None,
    config: EmulatorConfig,
    light: Light,
) -> Samples:
    """Nodes on the pieces that the camera sees, inside the image and past all that stands before it."""
    sensor = scene.sensor
    xyz, normal, area, face = _nodes(faces, pieces, step, sensor, config)
    uv = project(sensor, xyz)
    size = np.array([sensor.width_px, sensor.height_px]) - 1 + MARGIN_PX
    inside = np.all((uv > -MARGIN_PX) & (uv < size), axis=1)  # false behind the camera, where uv is NaN
    xyz, normal, area, uv, number = xyz[inside], normal[inside], area[inside], uv[inside], faces.solid[face[inside]]
    electrons = np.zeros(len(xyz))
    for k in np.unique(number):
        mine = number == k
        electrons[mine] = light.electrons(xyz[mine], normal[mine], scene.solids[k].material) * area[mine]
    seen = np.flatnonzero(electrons > 0)
    start = xyz + OFF_SURFACE_MM * normal
    for k, solid in enumerate(scene.solids):
        todo = number[seen] != k if body_of(solid).convex else np.ones(len(seen), dtype=bool)
        todo[todo] = hidden_by_solid(solid, start[seen[todo]], sensor.camera_centre_mm)
        seen = seen[~todo]
    if strings is not None:
        seen = seen[~hidden_by_strings(strings, start[seen], sensor.camera_centre_mm)]
    tile = np.floor(uv[seen] / TILE_PX).astype(np.int64) + 8
    group = FIRST_STRIPE_GROUP + number[seen] * GROUPS_A_SOLID + tile[:, 1] * TILES_A_ROW + tile[:, 0]
    return Samples(xyz[seen], electrons[seen], group)


def _nodes(
    faces: Faces, pieces: Pieces, step: float, sensor: SensorModel, config: EmulatorConfig
) -> tuple[Array, Array, Array, Index]:
    """Pairs of Gauss-Legendre nodes along the pieces: points, normals towards the laser (N, 3), area [mm²], face
    (N,).
    """
    uv = project(sensor, pieces.ends)
    with np.errstate(invalid="ignore"):
        length = np.linalg.norm(uv[:, 1] - uv[:, 0], axis=1)
    sigma = sharp_sigma_px(config.optics, sensor, config.laser.wavelength_nm)
    pairs = np.clip(np.ceil(np.nan_to_num(length, nan=2000.0) / (NODE_STEP * sigma)), 1, 4000).astype(np.int64)
    piece = np.repeat(np.arange(len(pairs)), 2 * pairs)
    number = np.arange(len(piece)) - (np.cumsum(2 * pairs) - 2 * pairs)[piece]
    s = ((number // 2 + 0.5 + np.where(number % 2, 0.5, -0.5) / np.sqrt(3)) / pairs[piece])[:, None]
    xyz = pieces.ends[piece, 0] + s * (pieces.ends[piece, 1] - pieces.ends[piece, 0])
    normal = pieces.normals[piece, 0] + s * (pieces.normals[piece, 1] - pieces.normals[piece, 0])
    normal /= np.maximum(np.sqrt(np.einsum("ij,ij->i", normal, normal)), 1e-12)[:, None]
    towards = np.einsum("ij,ij->i", normal[:, 1:], sensor.laser_origin_mm[1:] - xyz[:, 1:])
    normal *= np.where(towards < 0, -1.0, 1.0)[:, None]
    area = _length_mm(pieces) / (2 * pairs) * step / _plane_sine(faces, pieces)
    return xyz, normal, area[piece], pieces.face[piece]


def _length_mm(pieces: Pieces) -> Array:
    return np.asarray(np.linalg.norm(pieces.ends[:, 1] - pieces.ends[:, 0], axis=1))


def _face_normals(faces: Faces) -> Array:
    t = faces.triangles
    normal = np.cross(t[:, 1] - t[:, 0], t[:, 2] - t[:, 0])
    return np.asarray(normal / np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-300))


def _plane_sine(faces: Faces, pieces: Pieces) -> Array:
    """√(1 − nₓ²) of each piece's face: the width that the sheet's spacing dx has on it is dx over this."""
    return np.asarray(np.sqrt(np.maximum(1 - _face_normals(faces)[pieces.face, 0] ** 2, 1e-12)))
