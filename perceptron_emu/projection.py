"""From millimetres to pixels: OpenCV's pinhole model with all 14 distortion terms, written for the emulator alone."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from geometry import SensorModel

Array = NDArray[np.float64]


def project(sensor: SensorModel, xyz_mm: ArrayLike) -> Array:
    """Where points of {P} fall in the image.

    xyz_mm: (..., 3) [mm] in {P}. Returns uv_px (..., 2), NaN for points that are not in front of the camera.
    Source: OpenCV's calib3d documentation, "Detailed Description", rational model with thin prism and tilt.
    """
    camera = to_camera(sensor, xyz_mm)
    depth = np.where(camera[..., 2] > 0, camera[..., 2], np.nan)
    x, y = tilt(sensor, *lens(sensor, camera[..., 0] / depth, camera[..., 1] / depth))
    return np.stack([sensor.fx_px * x + sensor.cx_px, sensor.fy_px * y + sensor.cy_px], -1)


def to_camera(sensor: SensorModel, xyz_mm: ArrayLike) -> Array:
    """Points (..., 3) [mm] of {P} in the camera's axes: x right, y down, z forward."""
    pose = sensor.T_sensor_camera
    return np.asarray((np.asarray(xyz_mm, dtype=float) - pose.t) @ pose.R)


def lens(sensor: SensorModel, x: Array, y: Array) -> tuple[Array, Array]:
    """Normalised image coordinates after the lens: radial (rational), tangential and thin-prism terms."""
    terms = sensor.distortion
    if not any(terms):
        return x, y
    k1, k2, p1, p2, k3, k4, k5, k6, s1, s2, s3, s4, _, _ = sensor.distortion14
    r2 = x * x + y * y
    r4, r6 = r2 * r2, r2 * r2 * r2
    gain = (1 + k1 * r2 + k2 * r4 + k3 * r6) / (1 + k4 * r2 + k5 * r4 + k6 * r6)
    xy2 = 2 * x * y
    return (
        x * gain + p1 * xy2 + p2 * (r2 + 2 * x * x) + s1 * r2 + s2 * r4,
        y * gain + p2 * xy2 + p1 * (r2 + 2 * y * y) + s3 * r2 + s4 * r4,
    )


def tilt(sensor: SensorModel, x: Array, y: Array) -> tuple[Array, Array]:
    """Normalised coordinates on a chip turned by τx, τy about its centre: the ray meets the turned plane.

    With R = Ry(τy)·Rx(τx) (OpenCV's signs) a ray q = (x, y, 1) has chip coordinates R·q; it reaches the chip, which
    passes through (0, 0, 1), at the length that makes ((R q)·t − …) vanish; that is the projective map below.
    """
    tau_x, tau_y = sensor.distortion14[12:]
    if tau_x == 0 and tau_y == 0:
        return x, y
    r = tilt_rotation(float(tau_x), float(tau_y))
    qx, qy, qz = (r[i, 0] * x + r[i, 1] * y + r[i, 2] for i in range(3))
    return (r[2, 2] * qx - r[0, 2] * qz) / qz, (r[2, 2] * qy - r[1, 2] * qz) / qz


def tilt_rotation(tau_x: float, tau_y: float) -> Array:
    """OpenCV's rotation (3, 3) from camera axes to the axes of the tilted chip."""
    cx, sx, cy, sy = np.cos(tau_x), np.sin(tau_x), np.cos(tau_y), np.sin(tau_y)
    about_x = np.array([[1, 0, 0], [0, cx, sx], [0, -sx, cx]])
    about_y = np.array([[cy, 0, -sy], [0, 1, 0], [sy, 0, cy]])
    return np.asarray(about_y @ about_x)
