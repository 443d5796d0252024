"""{P} of a calibrated sensor: laser plane x = 0, x towards the camera, z the optical axis in the plane, y = z × x.

The origin is the foot of the camera's centre. Where the optical axis stands near the plane's normal, z is the image's
v direction at its centre instead.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from calib.sensor.lens import undistort
from geometry import Pose
from geometry.sensor import CAMERA_PARAMETERS

Array = NDArray[np.float64]

MAX_FACING_DEG = 20.0  # between optical axis and normal: nearer, the axis has no clear direction in the plane


@dataclass(frozen=True, eq=False)
class SheetFrame:
    """T_sensor_camera, and whether z is the image's v direction."""

    T_sensor_camera: Pose
    z_is_image_v: bool


def sheet_frame(camera: Array, plane: Array, origin_yz_mm: tuple[float, float] = (0.0, 0.0)) -> SheetFrame:
    """The frame of a camera (18,), pixels from the image's centre, and a plane p · X = 1 in the camera's frame.

    origin_yz_mm: where the origin stands, from the foot of the camera's centre.
    """
    distance = float(1 / np.linalg.norm(plane))
    x = -plane * distance  # from the plane towards the camera
    facing = abs(x[2]) > np.cos(np.deg2rad(MAX_FACING_DEG))
    direction = _image_v(camera, x, distance) if facing else np.array([0.0, 0.0, 1.0])
    z = direction - (direction @ x) * x
    z = z / np.linalg.norm(z)
    y = np.cross(z, x)
    R_camera_sensor = np.column_stack([x, y, z])
    origin = -distance * x + origin_yz_mm[0] * y + origin_yz_mm[1] * z
    return SheetFrame(Pose(R_camera_sensor, origin).inverse(), bool(facing))


def sheet_deviations(frame: SheetFrame, plane: Array) -> Array:
    """Jacobian (3, 3) of the plane's turns about {P}'s y and z [rad] and its shift along x [mm], by p."""
    R = frame.T_sensor_camera.R  # rows: x, y, z of {P} in the camera's frame
    x = R[0]
    distance = 1 / np.linalg.norm(plane)
    by_x = -distance * (np.eye(3) - np.outer(x, x))  # of the unit normal
    by_distance = -(distance**3) * plane  # of |p|⁻¹
    offset = frame.T_sensor_camera.inverse().t  # the origin of {P} in the camera's frame
    # points of the plane: x̂ · X = -distance; with x̂ + dx̂, at the origin of {P}
    shift = -by_distance - offset @ by_x
    return np.stack([-(R[2] @ by_x), R[1] @ by_x, shift])


def plane_deviations(frame: SheetFrame, plane: Array) -> tuple[Array, Array]:
    """A plane's turns about {P}'s y and then z [rad] and its shift along x [mm] (3,), and their Jacobian (3, 3) by p.

    As ``sheet_deviations``, of a plane that is not near.
    """
    R = frame.T_sensor_camera.R
    origin = frame.T_sensor_camera.inverse().t
    size = float(np.linalg.norm(plane))
    x = -R @ plane / size  # the plane's own x in {P}
    by_x = -(R - np.outer(R @ plane, plane) / size**2) / size
    level = float(np.hypot(x[0], x[2]))
    turns = np.array([np.arctan2(-x[2], x[0]), np.arctan2(x[1], level)])
    by_turns = np.stack([(x[2] * by_x[0] - x[0] * by_x[2]) / level**2, by_x[1] / level])
    along, rest = float(plane @ R[0]), 1 - float(plane @ origin)  # p · (origin + s x) = 1
    by_shift = -origin / along - rest * R[0] / along**2
    return np.array([*turns, rest / along]), np.vstack([by_turns, by_shift])


def camera_rows(terms: tuple[str, ...]) -> tuple[int, ...]:
    """Positions of the pinhole's numbers and of the terms among CAMERA_PARAMETERS."""
    return (0, 1, 2, 3, *(CAMERA_PARAMETERS.index(t) for t in CAMERA_PARAMETERS if t in terms))


def to_sheet(camera: Array, frame: SheetFrame, uv_px: Array) -> Array:
    """Points (N, 2) of the sheet (y, z) [mm] seen at pixels (N, 2) from the image's centre."""
    q = np.column_stack([undistort(camera, uv_px).value, np.ones(len(uv_px))]) @ frame.T_sensor_camera.R.T
    t = frame.T_sensor_camera.t
    with np.errstate(divide="ignore", invalid="ignore"):
        reach = -t[0] / q[:, 0]
        reach[~(reach > 0)] = np.nan
    return np.asarray(t[1:] + reach[:, None] * q[:, 1:])


def _image_v(camera: Array, x: Array, distance: float) -> Array:
    ends = undistort(camera, np.array([[0.0, -0.5], [0.0, 0.5]])).value
    q = np.column_stack([ends, np.ones(2)])
    points = q * (-distance / (q @ x))[:, None]
    return np.asarray(points[1] - points[0])
