"""The triangles that the sheet can reach, and the planes that the sheet is cut into."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from geometry import Sensor
from perceptron_emu.config import EmulatorConfig
from perceptron_emu.lens import project, sharp_sigma_px
from perceptron_emu.light.sheet import SHEET_REACH, STEP, axis_meets_sheet_mm, half_width_mm
from perceptron_emu.scene import Scene
from perceptron_emu.solids import body_of

Array = NDArray[np.float64]
Index = NDArray[np.int64]

MAX_PLANES = 201  # of the sheet: enough for a waist of 1/27 of its widest part; finer ones would cost, not show
MAX_SLOPE = 3.0  # a steeper face is hardly lit


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
    """

    triangles: Array
    facing: Array
    normals: Array
    solid: Index


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
    triangles, facing, normals = [np.zeros((0, 3, 3))], [np.zeros((0, 3))], [np.zeros((0, 3, 3))]
    owner = [np.zeros(0, dtype=np.int64)]
    for number, solid in enumerate(scene.solids):
        pose, body = solid.T_sensor_mesh, body_of(solid)
        x = (body.triangles.reshape(-1, 3) @ pose.R[0] + pose.t[0]).reshape(-1, 3)
        low, high = (f(f(x[:, 0], x[:, 1]), x[:, 2]) for f in (np.minimum, np.maximum))
        near = np.flatnonzero((low <= reach) & (high >= -reach))
        triangles.append((body.triangles[near].reshape(-1, 3) @ pose.R.T + pose.t).reshape(-1, 3, 3))
        facing.append(body.outwards[near] @ pose.R.T)
        normals.append((body.normals[near].reshape(-1, 3) @ pose.R.T).reshape(-1, 3, 3))
        owner.append(np.full(len(near), number))
    return Faces(np.concatenate(triangles), np.concatenate(facing), np.concatenate(normals), np.concatenate(owner))


def sheet_planes(faces: Faces, sensor: Sensor, config: EmulatorConfig) -> tuple[Array, float]:
    """Equally spaced planes x of the sheet (K,) [mm] and their spacing.

    They lie close enough for the sheet's Gaussian where it is thinnest and for the blur of the image of what they
    light.
    """
    distance = np.linalg.norm(faces.triangles[..., 1:] - sensor.sheet.origin_mm[1:], axis=-1)
    ends = np.array([distance.min(), distance.max(), axis_meets_sheet_mm(sensor)])
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
    middle = faces.triangles.mean(1)
    normal = faces.facing
    ray = (middle - sensor.sheet.origin_mm) * [0, 1, 1]
    ray /= np.linalg.norm(ray, axis=1, keepdims=True)
    facing = np.einsum("ij,ij->i", normal, ray)
    slope = -normal[:, 0] / np.where(np.abs(facing) < 1e-12, 1e-12, facing)
    centre = middle * [0, 1, 1]
    step = np.clip(slope, -MAX_SLOPE, MAX_SLOPE)[:, None] * ray + [1.0, 0, 0]
    moved = np.linalg.norm(project(sensor, centre + 1e-3 * step) - project(sensor, centre), axis=1) / 1e-3
    to_camera = np.einsum("ij,ij->i", normal, sensor.require_camera().centre_mm - middle)
    moved = moved[np.isfinite(moved) & (facing * to_camera < 0)]  # lit on the side that the camera sees
    return float(np.max(moved)) if len(moved) else 1.0


def widest_mm(sensor: Sensor, config: EmulatorConfig) -> float:
    """A half-width [mm] that the sheet does not exceed within twice the working distance."""
    middle = axis_meets_sheet_mm(sensor)
    return float(np.max(half_width_mm(config.laser, sensor, np.array([0.0, middle / 2, 2 * middle]))))
