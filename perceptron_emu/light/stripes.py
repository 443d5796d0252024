"""Stripes: the part of the solids that the sheet lights and the camera sees."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from geometry import Sensor
from geometry.compiled import kernel
from perceptron_emu.config import EmulatorConfig
from perceptron_emu.lens import project, sharp_sigma_px
from perceptron_emu.light.nodes import TILE_PX, LightNodes, stripe_group
from perceptron_emu.light.sheet_faces import Faces, faces_in_sheet, sheet_planes
from perceptron_emu.light.strings import Cylinders, hidden_by_strings
from perceptron_emu.light.transport import Light
from perceptron_emu.scene import Scene
from perceptron_emu.solids import LaserRays, Pieces, Shades, body_of, hidden_by_solid, lit_in_planes

Array = NDArray[np.float64]
Index = NDArray[np.int64]

OFF_SURFACE_MM = 1e-4  # where a ray to the camera starts: above its own face's rounding, below any part's detail
UNKNOWN_PX, MAX_PAIRS = 2000.0, 4000  # of a piece that reaches behind the camera; of nodes on a piece
GRAZED = 0.5  # sine of half a string's width from the emitter: one that takes more lies almost in the plane
NODE_STEP = 1.7  # length of image, in σ of the blur, that a pair of Gauss nodes covers: ripple 3e-4
MARGIN_PX = 40.0  # light this far outside the image can still reach into it


class SurfaceNodes(NamedTuple):
    """Nodes (N,) on lit surface: points and unit normals towards the laser (N, 3) [mm] in {P}, the area [mm²] that each
    stands for, the solid it lies on.
    """

    xyz_mm: Array
    normal: Array
    area_mm2: Array
    solid: Index


def light_solids(scene: Scene, strings: Cylinders | None, config: EmulatorConfig, light: Light) -> LightNodes:
    """Nodes on all solids where laser and camera both reach, with the light that each sends to the chip.

    The sheet is cut into planes of constant x. In each the solids are segments and the laser a fan of rays from a
    point,
    so that what is lit follows exactly from the angular order of the segments' ends; strings cast their shadows.
    """
    faces = faces_in_sheet(scene, config)
    if len(faces.triangles) == 0:
        return LightNodes.none()
    planes, step = sheet_planes(faces, scene.sensor, config)
    pieces, length_px = _in_view(faces, lit_pieces(faces, strings, planes, scene.sensor), scene.sensor)
    nodes = _nodes(faces, pieces, length_px, step, scene.sensor, config)
    return _seen(nodes, scene, strings, light)


def lit_pieces(faces: Faces, strings: Cylinders | None, planes: Array, sensor: Sensor) -> Pieces:
    """What the laser reaches first in planes of constant x.

    Parameters
    ----------
    faces : Faces
        Of all solids.
    strings : Cylinders or None
        They cast shadows.
    planes : Array
        x (K,) [mm].
    sensor : Sensor
        Where the laser stands and how far its fan opens.

    Returns
    -------
    Pieces
        Straight pieces of surface.
    """
    origin = np.array(sensor.sheet.origin_mm[1:], dtype=float)
    rays = LaserRays(origin, float(sensor.sheet.fan_rad))
    triangles, normals = np.ascontiguousarray(faces.triangles), np.ascontiguousarray(faces.normals)
    return lit_in_planes(triangles, normals, planes, _silhouettes(strings, planes, origin), rays)


def _silhouettes(strings: Cylinders | None, planes: Array, origin: Array) -> Shades:
    """What the strings take of the laser in the planes of constant x (K,): segments across them as the emitter sees
    them.
    """
    if strings is None:
        return Shades(np.zeros((len(planes), 0, 2, 2)), np.zeros((len(planes), 0), dtype=bool))
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
        reached = (t >= 0) & (t <= strings.lengths) & (sine < GRAZED)
        half = (distance * sine / np.sqrt(1 - sine**2))[..., None]
        across = np.stack([towards[..., 1], -towards[..., 0]], -1)
        ends = np.stack([centre - half * across, centre + half * across], -2)
    return Shades(ends, reached)


def _in_view(faces: Faces, pieces: Pieces, sensor: Sensor) -> tuple[Pieces, Array]:
    """The pieces that turn the lit side to the camera and whose box in the image touches it, and the lengths (n,) [px]
    of their images, NaN where they reach behind the camera.
    """
    camera = sensor.require_camera()
    corner, normal = faces.triangles[pieces.face, 0], faces.facing[pieces.face]
    to_laser = np.einsum("ij,ij->i", normal[:, 1:], sensor.sheet.origin_mm[1:] - corner[:, 1:])
    to_laser += normal[:, 0] * (pieces.ends[:, 0, 0] - corner[:, 0])  # the sheet's rays keep their x
    facing = np.flatnonzero(to_laser * np.einsum("ij,ij->i", normal, camera.centre_mm - corner) > 0)
    ends = pieces.ends[facing]
    uv = project(sensor, ends)
    outside = np.zeros(len(uv), dtype=bool)  # all of a piece on one side; never where it is behind the camera, NaN
    for a, size in enumerate((camera.width_px, camera.height_px)):
        first, last = uv[:, 0, a], uv[:, 1, a]
        outside |= (first <= -MARGIN_PX) & (last <= -MARGIN_PX)
        outside |= (first >= size - 1 + MARGIN_PX) & (last >= size - 1 + MARGIN_PX)
    kept, length = facing[~outside], np.hypot(uv[:, 1, 0] - uv[:, 0, 0], uv[:, 1, 1] - uv[:, 0, 1])
    return Pieces(ends[~outside], pieces.normals[kept], pieces.face[kept]), length[~outside]


def _seen(nodes: SurfaceNodes, scene: Scene, strings: Cylinders | None, light: Light) -> LightNodes:
    """The nodes that the camera sees, inside the image and past all that stands before it."""
    xyz, normal, area, number = nodes
    camera = scene.camera
    uv = project(scene.sensor, xyz)
    electrons = area * light.electrons_on(xyz, normal, [s.material for s in scene.solids], number)
    bright = np.flatnonzero((electrons > 0) & _within(uv, camera.width_px - 1, camera.height_px - 1))
    xyz, uv, electrons, number = xyz[bright], uv[bright], electrons[bright], number[bright]
    hidden = np.zeros(len(bright), dtype=bool)
    start = xyz + OFF_SURFACE_MM * normal[bright]
    if strings is not None:
        hidden |= hidden_by_strings(strings, start, camera.centre_mm)
    for k, solid in enumerate(scene.solids):
        if not body_of(solid).convex:
            hidden |= hidden_by_solid(solid, start, camera.centre_mm)
            continue
        others = np.flatnonzero(number != k)
        hidden[others] |= hidden_by_solid(solid, start[others], camera.centre_mm)
    tile = np.floor(uv / TILE_PX).astype(np.int64)
    group = stripe_group(number, tile[:, 0], tile[:, 1])
    seen = slice(None) if not np.any(hidden) else ~hidden
    return LightNodes(xyz[seen], electrons[seen], group[seen])


@kernel
def _within(uv: Array, last_u: float, last_v: float) -> NDArray[np.bool_]:
    """Whether points (N, 2) of the image lie within MARGIN_PX of it; false behind the camera, where they are NaN."""
    out = np.empty(len(uv), np.bool_)
    for i in range(len(uv)):
        u, v = uv[i, 0], uv[i, 1]
        out[i] = -MARGIN_PX < u < last_u + MARGIN_PX and -MARGIN_PX < v < last_v + MARGIN_PX
    return out


def _nodes(
    faces: Faces, pieces: Pieces, length_px: Array, step: float, sensor: Sensor, config: EmulatorConfig
) -> SurfaceNodes:
    """Pairs of Gauss-Legendre nodes along the pieces."""
    sigma = sharp_sigma_px(config.optics, sensor, config.laser.wavelength_nm)
    pairs = np.clip(np.ceil(np.nan_to_num(length_px, nan=UNKNOWN_PX) / (NODE_STEP * sigma)), 1, MAX_PAIRS).astype(
        np.int64
    )
    xyz, normal, piece = _place(pieces, pairs, np.array(sensor.sheet.origin_mm, dtype=float))
    area = _length_mm(pieces) / (2 * pairs) * step / _plane_sine(faces, pieces)
    return SurfaceNodes(xyz, normal, area[piece], faces.solid[pieces.face][piece])


@kernel
def _place(pieces: Pieces, pairs: Index, origin: Array) -> tuple[Array, Array, Index]:
    """Points and unit normals towards the laser (N, 3) of every node, and the piece (N,) it lies on."""
    ends, normals = pieces.ends, pieces.normals
    count = 2 * pairs.sum()
    xyz, normal, piece = np.empty((count, 3)), np.empty((count, 3)), np.empty(count, np.int64)
    n = 0
    for p in range(len(pairs)):
        for k in range(2 * pairs[p]):
            s = (k // 2 + 0.5 + (0.5 if k % 2 else -0.5) / math.sqrt(3)) / pairs[p]
            size = 0.0
            for a in range(3):
                xyz[n, a] = ends[p, 0, a] + s * (ends[p, 1, a] - ends[p, 0, a])
                normal[n, a] = normals[p, 0, a] + s * (normals[p, 1, a] - normals[p, 0, a])
                size += normal[n, a] * normal[n, a]
            towards = normal[n, 1] * (origin[1] - xyz[n, 1]) + normal[n, 2] * (origin[2] - xyz[n, 2])
            scale = (-1.0 if towards < 0 else 1.0) / max(math.sqrt(size), 1e-12)
            for a in range(3):
                normal[n, a] *= scale
            piece[n] = p
            n += 1
    return xyz, normal, piece


def _length_mm(pieces: Pieces) -> Array:
    return np.asarray(np.linalg.norm(pieces.ends[:, 1] - pieces.ends[:, 0], axis=1))


def _plane_sine(faces: Faces, pieces: Pieces) -> Array:
    """√(1 − nₓ²) of each piece's face: the width that the sheet's spacing dx has on it is dx over this."""
    return np.asarray(np.sqrt(np.maximum(1 - faces.facing[pieces.face, 0] ** 2, 1e-12)))
