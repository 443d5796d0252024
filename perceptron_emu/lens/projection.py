"""From millimetres to pixels: OpenCV's pinhole model with all 14 distortion terms, written for the emulator alone."""

from __future__ import annotations

from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from geometry import Sensor
from geometry.compiled import kernel

Array = NDArray[np.float64]


def project(sensor: Sensor, xyz_mm: ArrayLike) -> Array:
    """Where points of {P} fall in the image.

    Parameters
    ----------
    sensor : Sensor
        With a camera: OpenCV's pinhole model with all 14 distortion terms.
    xyz_mm : array_like
        (..., 3) [mm] in {P}.

    Returns
    -------
    Array
        (u, v) (..., 2) [px], NaN for points that are not in front of the camera.

    References
    ----------
    OpenCV's calib3d documentation, "Detailed Description": rational model with thin prism and tilt.
    """
    xyz = np.ascontiguousarray(xyz_mm, dtype=float)
    out = np.empty((*xyz.shape[:-1], 2))
    _project(xyz.reshape(-1, 3), _in_numbers(sensor), out.reshape(-1, 2))
    return out


class CameraNumbers(NamedTuple):
    """A camera for compiled code: its rotation R (3, 3) and place t (3,) in {P} [mm], intrinsics fx, fy, cx, cy [px],
    the twelve terms of the lens, and the chip's rotation (3, 3).
    """

    R: Array
    t: Array
    intrinsics: Array
    terms: Array
    turn: Array


@lru_cache(maxsize=32)
def _in_numbers(sensor: Sensor) -> CameraNumbers:
    camera = sensor.require_camera()
    pose, terms = camera.T_sensor_camera, np.array(camera.distortion14, dtype=float)
    intrinsics = np.array([camera.fx_px, camera.fy_px, camera.cx_px, camera.cy_px])
    turn = tilt_rotation(float(terms[12]), float(terms[13]))
    return CameraNumbers(np.array(pose.R, order="C"), np.array(pose.t), intrinsics, terms[:12].copy(), turn)


@kernel
def _project(xyz: Array, camera: CameraNumbers, out: Array) -> None:
    """The chip turned by R = Ry(τy)·Rx(τx) (OpenCV's signs) passes through (0, 0, 1): the ray q = (x, y, 1) has the
    coordinates R·q in its axes and reaches it by the projective map of the last lines.
    """
    R, t, intrinsics, terms, turn = camera
    fx, fy, cx, cy = intrinsics
    for i in range(len(xyz)):
        px, py, pz = xyz[i, 0] - t[0], xyz[i, 1] - t[1], xyz[i, 2] - t[2]
        depth = R[0, 2] * px + R[1, 2] * py + R[2, 2] * pz
        if not depth > 0:
            out[i, 0], out[i, 1] = np.nan, np.nan
            continue
        x = (R[0, 0] * px + R[1, 0] * py + R[2, 0] * pz) / depth
        y = (R[0, 1] * px + R[1, 1] * py + R[2, 1] * pz) / depth
        a, b = _bent(x, y, terms)
        qx = turn[0, 0] * a + turn[0, 1] * b + turn[0, 2]
        qy = turn[1, 0] * a + turn[1, 1] * b + turn[1, 2]
        qz = turn[2, 0] * a + turn[2, 1] * b + turn[2, 2]
        out[i, 0] = fx * (turn[2, 2] * qx - turn[0, 2] * qz) / qz + cx
        out[i, 1] = fy * (turn[2, 2] * qy - turn[1, 2] * qz) / qz + cy


def to_camera(sensor: Sensor, xyz_mm: ArrayLike) -> Array:
    """Points in the camera's axes.

    Parameters
    ----------
    sensor : Sensor
        With a camera.
    xyz_mm : array_like
        (..., 3) [mm] in {P}.

    Returns
    -------
    Array
        (..., 3) [mm]: x right, y down, z forward.
    """
    pose = sensor.require_camera().T_sensor_camera
    return np.asarray((np.asarray(xyz_mm, dtype=float) - pose.t) @ pose.R)


def lens(sensor: Sensor, x: Array, y: Array) -> tuple[Array, Array]:
    """Normalised image coordinates after the lens: radial (rational), tangential and thin-prism terms.

    Parameters
    ----------
    sensor : Sensor
        With a camera.
    x, y : Array
        (...) x/z and y/z of the rays in the camera's axes.

    Returns
    -------
    x, y : Array
        (...) before the chip's tilt and the intrinsics.
    """
    camera = sensor.require_camera()
    if not any(camera.distortion):
        return x, y
    out = np.empty((2, *np.shape(x)))
    _bend(np.ravel(x), np.ravel(y), np.array(camera.distortion14[:12]), out.reshape(2, -1))
    return out[0], out[1]


@kernel
def _bend(x: Array, y: Array, terms: Array, out: Array) -> None:
    for i in range(len(x)):
        out[0, i], out[1, i] = _bent(x[i], y[i], terms)


@kernel(inline=True)
def _bent(x: float, y: float, terms: Array) -> tuple[float, float]:
    k1, k2, p1, p2, k3, k4, k5, k6, s1, s2, s3, s4 = terms
    r2 = x * x + y * y
    gain = (1 + r2 * (k1 + r2 * (k2 + r2 * k3))) / (1 + r2 * (k4 + r2 * (k5 + r2 * k6)))
    return (
        x * gain + 2 * p1 * x * y + p2 * (r2 + 2 * x * x) + r2 * (s1 + r2 * s2),
        y * gain + 2 * p2 * x * y + p1 * (r2 + 2 * y * y) + r2 * (s3 + r2 * s4),
    )


def tilt_rotation(tau_x: float, tau_y: float) -> Array:
    """OpenCV's rotation from camera axes to the axes of the tilted chip.

    Parameters
    ----------
    tau_x, tau_y : float
        The last two distortion terms [rad].

    Returns
    -------
    Array
        (3, 3).
    """
    cx, sx, cy, sy = np.cos(tau_x), np.sin(tau_x), np.cos(tau_y), np.sin(tau_y)
    about_x = np.array([[1, 0, 0], [0, cx, sx], [0, -sx, cx]])
    about_y = np.array([[cy, 0, -sy], [0, 1, 0], [sy, 0, cy]])
    return np.asarray(about_y @ about_x)
