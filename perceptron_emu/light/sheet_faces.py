"""The triangles that the sheet can reach, and the planes that the sheet is cut into."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from geometry import Sensor
from geometry.compiled import kernel
from perceptron_emu.config import EmulatorConfig
from perceptron_emu.lens import project, sharp_sigma_px
from perceptron_emu.light.sheet import SHEET_REACH, STEP, axis_meets_sheet_mm, half_width_mm
from perceptron_emu.scene import Scene
from perceptron_emu.solids import body_of

Array = NDArray[np.float64]
Index = NDArray[np.int64]
Mask = NDArray[np.bool_]

MAX_PLANES = 201  # of the sheet: enough for a waist of 1/27 of its widest part; finer ones would cost, not show
MAX_SLOPE = 3.0  # a steeper face is hardly lit
STEP_MM = 1e-3  # across the sheet, by which the image's movement is taken


@dataclass(frozen=True, eq=False)
class Faces:
    """Triangles that the sheet can reach.

    Parameters
    ----------
    triangles : Array
        Corners (T, 3, 3) [mm] in {P}.
    facing : Array
        Unit normals (T, 3).
    normals : Array
        Those for shading, at the corners (T, 3, 3).
    solid : NDArray
        The solid each belongs to (T,).
    bare : NDArray
        (T,) of bool: nothing of that solid stands before what faces the triangle.
    """

    triangles: Array
    facing: Array
    normals: Array
    solid: Index
    bare: Mask


def faces_in_sheet(scene: Scene, config: EmulatorConfig) -> Faces:
    """The faces of all solids that come near enough to x = 0 to be lit.

    Parameters
    ----------
    scene : Scene
        With a camera.
    config : EmulatorConfig
        How thick the sheet is.

    Returns
    -------
    Faces
        None of them where nothing reaches the sheet.
    """
    reach = SHEET_REACH * widest_mm(scene.sensor, config) / 2
    parts = []
    for solid in scene.solids:
        pose, body = solid.T_sensor_mesh, body_of(solid)
        R, t = np.ascontiguousarray(pose.R), np.ascontiguousarray(pose.t)
        parts.append(_near(body.triangles, body.outwards, body.normals, body.bare, (R, t), reach))
    if not parts:
        return Faces(
            np.zeros((0, 3, 3)),
            np.zeros((0, 3)),
            np.zeros((0, 3, 3)),
            np.zeros(0, dtype=np.int64),
            np.zeros(0, dtype=bool),
        )
    owner = np.repeat(np.arange(len(parts)), [len(p[0]) for p in parts])
    triangles, facing, normals, bare = (np.concatenate(columns) for columns in zip(*parts, strict=True))
    return Faces(triangles, facing, normals, owner, bare)


@kernel
def _near(
    triangles: Array, outwards: Array, normals: Array, bare: Mask, pose: tuple[Array, Array], reach: float
) -> tuple[Array, Array, Array, Mask]:
    """A body's triangles that come nearer to x = 0 than reach, turned into {P}, with their normals; which are bare."""
    R, t = pose
    near, n = np.empty(len(triangles), np.int64), 0
    for i in range(len(triangles)):
        low, high = np.inf, -np.inf
        for k in range(3):
            p = triangles[i, k]
            x = R[0, 0] * p[0] + R[0, 1] * p[1] + R[0, 2] * p[2] + t[0]
            low, high = min(low, x), max(high, x)
        if low <= reach and high >= -reach:
            near[n] = i
            n += 1
    corners, facing, shading = np.empty((n, 3, 3)), np.empty((n, 3)), np.empty((n, 3, 3))
    alone = np.empty(n, np.bool_)
    for m in range(n):
        i = near[m]
        alone[m] = bare[i]
        _turned(R, outwards[i], facing[m])
        for k in range(3):
            _turned(R, triangles[i, k], corners[m, k])
            _turned(R, normals[i, k], shading[m, k])
            for a in range(3):
                corners[m, k, a] += t[a]
    return corners, facing, shading, alone


@kernel(inline=True)
def _turned(R: Array, vector: Array, out: Array) -> None:
    for a in range(3):
        out[a] = R[a, 0] * vector[0] + R[a, 1] * vector[1] + R[a, 2] * vector[2]


def sheet_planes(faces: Faces, sensor: Sensor, config: EmulatorConfig) -> tuple[Array, float]:
    """Equally spaced planes x of the sheet (K,) [mm] and their spacing.

    They lie close enough for the sheet's Gaussian where it is thinnest and for the blur of the image of what they
    light.
    """
    nearest, farthest = _distances(faces.triangles, np.array(sensor.sheet.origin_mm, dtype=float))
    ends = np.array([nearest, farthest, axis_meets_sheet_mm(sensor)])
    width = half_width_mm(config.laser, sensor, ends)
    thin, thick = float(width.min()) / 2, float(min(width.max(), widest_mm(sensor, config))) / 2
    blur = sharp_sigma_px(config.optics, sensor, config.laser.wavelength_nm) / _image_spread(faces, sensor)
    n = int(np.clip(np.ceil(2 * SHEET_REACH * thick / (STEP * min(thin, blur))), 9, MAX_PLANES)) | 1
    planes = np.linspace(-SHEET_REACH * thick, SHEET_REACH * thick, n)
    return planes, float(planes[1] - planes[0])


def _image_spread(faces: Faces, sensor: Sensor) -> float:
    """How far [px] the image of the lit surface moves for 1 mm across the sheet; at most faces it is no more.

    On a face with normal n the ray along r is met at (1, −nₓ/(n·r) r) from one plane to the next.
    """
    origin, camera = np.array(sensor.sheet.origin_mm, dtype=float), np.array(sensor.require_camera().centre_mm)
    uv = project(sensor, _crossed(faces.triangles, faces.facing, origin, camera))
    moved = float(_largest_move(uv)) / STEP_MM
    return moved if moved > 0 else 1.0


@kernel
def _distances(triangles: Array, origin: Array) -> tuple[float, float]:
    """Of the nearest and the farthest corner from the emitter, in the sheet."""
    low, high = np.inf, 0.0
    for i in range(len(triangles)):
        for k in range(3):
            y, z = triangles[i, k, 1] - origin[1], triangles[i, k, 2] - origin[2]
            low, high = min(low, y * y + z * z), max(high, y * y + z * z)
    return math.sqrt(low), math.sqrt(high)


@kernel
def _crossed(triangles: Array, facing: Array, origin: Array, camera: Array) -> Array:
    """Where the ray to each face's middle meets x = 0, and the face's plane STEP_MM further on (n, 2, 3); of faces that
    are lit on the side that the camera sees.
    """
    out, n = np.empty((len(triangles), 2, 3)), 0
    for i in range(len(triangles)):
        t, normal = triangles[i], facing[i]
        x, y, z = (
            (t[0, 0] + t[1, 0] + t[2, 0]) / 3,
            (t[0, 1] + t[1, 1] + t[2, 1]) / 3,
            (t[0, 2] + t[1, 2] + t[2, 2]) / 3,
        )
        ry, rz = y - origin[1], z - origin[2]
        size = math.sqrt(ry * ry + rz * rz)
        ry, rz = ry / size, rz / size
        lit = normal[1] * ry + normal[2] * rz
        seen = normal[0] * (camera[0] - x) + normal[1] * (camera[1] - y) + normal[2] * (camera[2] - z)
        if lit * seen >= 0:
            continue
        slope = min(max(-normal[0] / (1e-12 if abs(lit) < 1e-12 else lit), -MAX_SLOPE), MAX_SLOPE)
        out[n, 0, 0], out[n, 0, 1], out[n, 0, 2] = 0.0, y, z
        out[n, 1, 0], out[n, 1, 1], out[n, 1, 2] = STEP_MM, y + STEP_MM * slope * ry, z + STEP_MM * slope * rz
        n += 1
    return out[:n].copy()


@kernel
def _largest_move(uv: Array) -> float:
    """Of pairs of places (n, 2, 2) the farthest apart; what is not before the camera is NaN and left out."""
    most = 0.0
    for i in range(len(uv)):
        u, v = uv[i, 1, 0] - uv[i, 0, 0], uv[i, 1, 1] - uv[i, 0, 1]
        size = math.sqrt(u * u + v * v)
        if size < np.inf:
            most = max(most, size)
    return most


def widest_mm(sensor: Sensor, config: EmulatorConfig) -> float:
    """A half-width [mm] that the sheet does not exceed within twice the working distance."""
    middle = axis_meets_sheet_mm(sensor)
    return float(np.max(half_width_mm(config.laser, sensor, np.array([0.0, middle / 2, 2 * middle]))))
