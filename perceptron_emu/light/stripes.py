"""Stripes: the part of the solids that the sheet lights and the camera sees."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from geometry import Sensor
from geometry.compiled import kernel
from perceptron_emu.config import EmulatorConfig
from perceptron_emu.lens import project, pupil_points_mm, sharp_sigma_px
from perceptron_emu.light.nodes import TILE_PX, LightNodes, stripe_group
from perceptron_emu.light.sheet_faces import Faces, faces_in_sheet, sheet_planes
from perceptron_emu.light.strings import Cylinders, hidden_by_strings
from perceptron_emu.light.subsurface import line_spread, moved_below, spread_mm
from perceptron_emu.light.transport import Light
from perceptron_emu.scene import Material, Scene
from perceptron_emu.solids import LaserRays, Shades, SheetPieces, hidden_by_solids, lit_in_planes

Array = NDArray[np.float64]
Index = NDArray[np.int64]
Mask = NDArray[np.bool_]

OFF_SURFACE_MM = 1e-4  # where a ray to the camera starts: above its own face's rounding, below any part's detail
UNKNOWN_PX, MAX_PAIRS = 2000.0, 4000  # of a piece that reaches behind the camera; of nodes on a piece
GRAZED = 0.5  # sine of half a string's width from the emitter: one that takes more lies almost in the plane
NODE_STEP = 1.7  # length of image, in σ of the blur, that a pair of Gauss nodes covers: ripple 3e-4
MARGIN_PX = 40.0  # light this far outside the image can still reach into it


class SurfaceNodes(NamedTuple):
    """Nodes (N,) on lit surface: points and unit normals towards the laser (N, 3) [mm] in {P}, the area [mm²] that each
    stands for, the solid it lies on, whether nothing of that one stands before it.
    """

    xyz_mm: Array
    normal: Array
    area_mm2: Array
    solid: Index
    bare: Mask


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


def lit_pieces(faces: Faces, strings: Cylinders | None, planes: Array, sensor: Sensor) -> SheetPieces:
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
    SheetPieces
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
    return _shades(strings.starts, strings.directions, strings.lengths, strings.radius, planes, origin)


@kernel
def _shades(starts: Array, directions: Array, lengths: Array, radius: float, planes: Array, origin: Array) -> Shades:
    """`_silhouettes` of strings."""
    ends, there = np.empty((len(planes), len(starts), 2, 2)), np.empty((len(planes), len(starts)), np.bool_)
    for k in range(len(planes)):
        for s in range(len(starts)):
            slope, dy, dz = directions[s, 0], directions[s, 1], directions[s, 2]
            t = (planes[k] - starts[s, 0]) / slope
            y, z = starts[s, 1] + t * dy, starts[s, 2] + t * dz
            ty, tz = y - origin[0], z - origin[1]
            distance = math.sqrt(ty * ty + tz * tz)
            ty, tz = ty / distance, tz / distance
            along = ty * dy + tz * dz
            # the ray at δ from the axis point passes the axis at s |sin δ| |d_x| / √(1 − (r·d)²)
            sine = radius * math.sqrt(1 - along * along) / (distance * abs(slope))
            there[k, s] = t >= 0 and t <= lengths[s] and sine < GRAZED
            half = distance * sine / math.sqrt(1 - sine * sine)
            ends[k, s, 0, 0], ends[k, s, 0, 1] = y - half * tz, z + half * ty
            ends[k, s, 1, 0], ends[k, s, 1, 1] = y + half * tz, z - half * ty
    return Shades(ends, there)


def _in_view(faces: Faces, pieces: SheetPieces, sensor: Sensor) -> tuple[SheetPieces, Array]:
    """The pieces that turn the lit side to the camera and whose box in the image touches it, and the lengths (n,) [px]
    of their images, NaN where they reach behind the camera.
    """
    camera = sensor.require_camera()
    origin, centre = np.array(sensor.sheet.origin_mm, dtype=float), np.array(camera.centre_mm)
    uv = project(sensor, pieces.ends)
    return _kept(pieces, uv, faces.triangles, faces.facing, (origin, centre), (camera.width_px, camera.height_px))


@kernel
def _kept(
    pieces: SheetPieces, uv: Array, triangles: Array, facing: Array, eyes: tuple[Array, Array], size: tuple[int, int]
) -> tuple[SheetPieces, Array]:
    """`_in_view`, for ends at uv (n, 2, 2) in the image. eyes: the emitter and the camera's centre."""
    (origin, centre), n = eyes, 0
    ends, normals, face = np.empty_like(pieces.ends), np.empty_like(pieces.normals), np.empty_like(pieces.face)
    length = np.empty(len(face))
    for p in range(len(face)):
        f = pieces.face[p]
        corner, normal = triangles[f, 0], facing[f]
        to_laser = normal[0] * (pieces.ends[p, 0, 0] - corner[0])  # the sheet's rays keep their x
        to_laser += normal[1] * (origin[1] - corner[1]) + normal[2] * (origin[2] - corner[2])
        to_camera = 0.0
        for a in range(3):
            to_camera += normal[a] * (centre[a] - corner[a])
        if not to_laser * to_camera > 0:
            continue
        outside = False  # all of a piece on one side; never where it is behind the camera, NaN
        for a in range(2):
            first, last, far = uv[p, 0, a], uv[p, 1, a], size[a] - 1 + MARGIN_PX
            outside |= (first <= -MARGIN_PX and last <= -MARGIN_PX) or (first >= far and last >= far)
        if outside:
            continue
        u, v = uv[p, 1, 0] - uv[p, 0, 0], uv[p, 1, 1] - uv[p, 0, 1]
        face[n], length[n] = f, math.sqrt(u * u + v * v)
        for e in range(2):
            for a in range(3):
                ends[n, e, a], normals[n, e, a] = pieces.ends[p, e, a], pieces.normals[p, e, a]
        n += 1
    return SheetPieces(ends[:n].copy(), normals[:n].copy(), face[:n].copy()), length[:n].copy()


def _seen(nodes: SurfaceNodes, scene: Scene, strings: Cylinders | None, light: Light) -> LightNodes:
    """The nodes that the camera sees, inside the image and past all that stands before it."""
    camera, sensor = scene.camera, scene.sensor
    materials = [s.material for s in scene.solids]
    if any(m.scatter_mm > 0 for m in materials):
        nodes, density = _below_surface(nodes, materials, light)
    else:
        density = light.electrons_on(nodes.xyz_mm, nodes.normal, materials, nodes.solid)
    uv = project(sensor, nodes.xyz_mm)
    xyz, start, electrons, free_of, group = _bright(nodes, density, uv, (camera.width_px, camera.height_px))
    eyes = pupil_points_mm(light.config.optics, sensor)
    seen = np.zeros(len(electrons))
    for eye in eyes:
        behind = None if strings is None else hidden_by_strings(strings, start, eye)
        seen += ~hidden_by_solids(scene.solids, start, eye, behind, free_of)
    if np.all(seen == len(eyes)):
        return LightNodes(xyz, electrons, group)
    some = seen > 0
    return LightNodes(xyz[some], electrons[some] * (seen[some] / len(eyes)), group[some])


def _below_surface(nodes: SurfaceNodes, materials: list[Material], light: Light) -> tuple[SurfaceNodes, Array]:
    """Nodes and their electrons per mm²; where light goes below the surface its matte part leaves elsewhere."""
    deep = np.array([m.scatter_mm > 0 for m in materials])
    surface = [replace(m, diffuse=0.0) if m.scatter_mm > 0 else m for m in materials]
    parts = [nodes]
    densities = [light.electrons_on(nodes.xyz_mm, nodes.normal, surface, nodes.solid)]
    for k in np.flatnonzero(deep):
        own, matte = np.flatnonzero(nodes.solid == k), replace(materials[k], specular=0.0)
        xyz, normal = nodes.xyz_mm[own], nodes.normal[own]
        lengths = matte.scatter_mm, spread_mm(matte)
        origin = np.array(light.sensor.sheet.origin_mm, dtype=float)
        places, shares = moved_below(xyz, normal, origin, lengths, line_spread())
        density = light.electrons_on(xyz, normal, [matte], np.zeros(len(own), np.int64))
        n = len(shares)
        area, solid = np.repeat(nodes.area_mm2[own], n), np.repeat(nodes.solid[own], n)
        bare = np.repeat(nodes.bare[own], n)
        parts.append(SurfaceNodes(places, np.repeat(normal, n, axis=0), area, solid, bare))
        densities.append((density[:, None] * shares).ravel())
    return SurfaceNodes(*(np.concatenate(columns) for columns in zip(*parts, strict=True))), np.concatenate(densities)


@kernel
def _bright(
    nodes: SurfaceNodes, density: Array, uv: Array, size: tuple[int, int]
) -> tuple[Array, Array, Array, Index, Index]:
    """Of nodes whose image at uv (N, 2) is within MARGIN_PX of the chip and not dark: points, where rays from them
    start, electrons, the solid that does not hide them (−1: none), groups. density: electrons per mm².
    """
    xyz, start = np.empty_like(nodes.xyz_mm), np.empty_like(nodes.xyz_mm)
    electrons, free_of, group = np.empty(len(uv)), np.empty(len(uv), np.int64), np.empty(len(uv), np.int64)
    n = 0
    for i in range(len(uv)):
        u, v, light = uv[i, 0], uv[i, 1], nodes.area_mm2[i] * density[i]
        # never behind the camera, where they are NaN
        here = -MARGIN_PX < u < size[0] - 1 + MARGIN_PX and -MARGIN_PX < v < size[1] - 1 + MARGIN_PX
        if not (light > 0 and here):
            continue
        for a in range(3):
            xyz[n, a] = nodes.xyz_mm[i, a]
            start[n, a] = xyz[n, a] + OFF_SURFACE_MM * nodes.normal[i, a]
        electrons[n], free_of[n] = light, nodes.solid[i] if nodes.bare[i] else -1
        group[n] = stripe_group(nodes.solid[i], math.floor(u / TILE_PX), math.floor(v / TILE_PX))
        n += 1
    return xyz[:n], start[:n], electrons[:n], free_of[:n], group[:n]


def _nodes(
    faces: Faces, pieces: SheetPieces, length_px: Array, step: float, sensor: Sensor, config: EmulatorConfig
) -> SurfaceNodes:
    """Pairs of Gauss-Legendre nodes along the pieces."""
    step_px = NODE_STEP * sharp_sigma_px(config.optics, sensor, config.laser.wavelength_nm)
    origin = np.array(sensor.sheet.origin_mm, dtype=float)
    return _place(pieces, length_px, (step_px, step), (faces.facing, faces.solid, faces.bare), origin)


@kernel
def _place(
    pieces: SheetPieces,
    length_px: Array,
    steps: tuple[float, float],
    faces: tuple[Array, Index, Mask],
    origin: Array,
) -> SurfaceNodes:
    """Nodes of pieces whose images are so long. steps: along the image [px], across the sheet [mm]; faces: their
    normals, whose they are, and whether they are bare.
    """
    ends, normals = pieces.ends, pieces.normals
    facing, solid, bare = faces
    pairs, count = np.empty(len(length_px), np.int64), 0
    for p in range(len(pairs)):
        length = length_px[p] if length_px[p] < np.inf else UNKNOWN_PX
        pairs[p] = min(max(math.ceil(length / steps[0]), 1), MAX_PAIRS)
        count += 2 * pairs[p]
    xyz, normal = np.empty((count, 3)), np.empty((count, 3))
    area_mm2, owner, alone = np.empty(count), np.empty(count, np.int64), np.empty(count, np.bool_)
    n = 0
    for p in range(len(pairs)):
        along, face = 0.0, pieces.face[p]
        for a in range(3):
            along += (ends[p, 1, a] - ends[p, 0, a]) ** 2
        # √(1 − nₓ²): the width that the sheet's spacing has on the face is the spacing over this
        sine = math.sqrt(max(1 - facing[face, 0] ** 2, 1e-12))
        area = math.sqrt(along) / (2 * pairs[p]) * steps[1] / sine
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
            area_mm2[n], owner[n], alone[n] = area, solid[face], bare[face]
            n += 1
    return SurfaceNodes(xyz, normal, area_mm2, owner, alone)
