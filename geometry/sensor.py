"""The laser-line sensor: camera intrinsics, its pose, the laser fan, and what of the sheet the camera sees."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from geometry.errors import InputError
from geometry.pose import Pose, check_rotation

Array = NDArray[np.float64]

DISTORTION_LENGTHS = (0, 4, 5, 8, 12, 14)
BIT_DEPTHS = (8, 10, 12, 14, 16)


@dataclass(frozen=True, eq=False)
class SensorModel:
    """Parameters of a laser-line sensor; the laser sheet is the plane x = 0 of {P}, the fan opens about +z.

    width_px, height_px, bit_depth, black_level: the image (pixel (0, 0) is the centre of the top-left pixel).
    fx_px, fy_px, cx_px, cy_px, distortion: OpenCV's camera model, 0, 4, 5, 8, 12 or 14 terms, tilt in radians.
    T_sensor_camera: pose of the camera (x right, y down, z forward) in {P} [mm].
    laser_origin_mm: the emitter in {P} (3,). fan_rad: full opening angle of the fan.
    """

    width_px: int
    height_px: int
    fx_px: float
    fy_px: float
    cx_px: float
    cy_px: float
    T_sensor_camera: Pose
    distortion: tuple[float, ...] = ()
    bit_depth: int = 8
    black_level: float = 0.0
    laser_origin_mm: Array = field(default_factory=lambda: np.zeros(3))
    fan_rad: float = np.deg2rad(45.0)
    name: str = ""

    def __post_init__(self) -> None:
        """InputError where the numbers can not be a sensor."""
        _check_image(self)
        _check_camera(self)
        _check_laser(self)

    @property
    def camera_matrix(self) -> Array:
        """Intrinsic matrix K (3, 3) [px]."""
        return np.array([[self.fx_px, 0, self.cx_px], [0, self.fy_px, self.cy_px], [0, 0, 1.0]])

    @property
    def camera_centre_mm(self) -> Array:
        """The camera's projection centre in {P} (3,) [mm]."""
        return self.T_sensor_camera.t

    @property
    def distortion14(self) -> Array:
        """The distortion terms filled up with zeros to OpenCV's 14 (14,)."""
        return np.array([*self.distortion, *[0.0] * (14 - len(self.distortion))])

    @property
    def saturation_dn(self) -> int:
        """The largest grey level that the image can hold."""
        return int(2**self.bit_depth - 1)


def _check_image(s: SensorModel) -> None:
    if not (1 <= s.width_px <= 65535 and 1 <= s.height_px <= 65535):
        raise InputError(f"image size {s.width_px} × {s.height_px} px: width and height must lie in 1 … 65535")
    if s.bit_depth not in BIT_DEPTHS:
        raise InputError(f"bit_depth {s.bit_depth}: must be one of {', '.join(map(str, BIT_DEPTHS))}")
    if not 0 <= s.black_level < s.saturation_dn:
        raise InputError(f"black_level {s.black_level:g}: must lie in 0 … {s.saturation_dn - 1} at {s.bit_depth} bits")


def _check_camera(s: SensorModel) -> None:
    numbers = [s.fx_px, s.fy_px, s.cx_px, s.cy_px, *s.distortion, *s.T_sensor_camera.t]
    if not np.all(np.isfinite(numbers)):
        raise InputError("the camera holds a number that is not finite")
    if s.fx_px <= 0 or s.fy_px <= 0:
        raise InputError(f"focal lengths fx_px = {s.fx_px:g}, fy_px = {s.fy_px:g}: must be positive")
    if len(s.distortion) not in DISTORTION_LENGTHS:
        raise InputError(f"distortion has {len(s.distortion)} terms: OpenCV's model takes 0, 4, 5, 8, 12 or 14")
    check_rotation(s.T_sensor_camera.R)
    if abs(s.T_sensor_camera.t[0]) < 1e-6:
        raise InputError(
            "the camera's centre lies in the laser plane x = 0: it sees the sheet edge-on and measures no depth"
        )
    if _rays_hit_nowhere(s):
        raise InputError(
            "the camera looks along or away from the laser plane x = 0 and never sees it: turn [camera.pose] towards it"
        )


def _rays_hit_nowhere(s: SensorModel) -> bool:
    """Whether the rays of all four image corners run away from the sheet."""
    u = np.array([0, s.width_px - 1, s.width_px - 1, 0], dtype=float)
    v = np.array([0, 0, s.height_px - 1, s.height_px - 1], dtype=float)
    rays = np.stack([(u - s.cx_px) / s.fx_px, (v - s.cy_px) / s.fy_px, np.ones(4)], -1) @ s.T_sensor_camera.R.T
    return bool(np.all(rays[:, 0] * s.T_sensor_camera.t[0] >= 0))


def _check_laser(s: SensorModel) -> None:
    if s.laser_origin_mm.shape != (3,) or not np.all(np.isfinite(s.laser_origin_mm)):
        raise InputError("[laser] origin_mm must be three finite numbers [mm]")
    if abs(s.laser_origin_mm[0]) > 1e-6:
        raise InputError(
            f"[laser] origin_mm has x = {s.laser_origin_mm[0]:g}: the emitter lies in the laser plane, x must be 0"
        )
    if not 0 < s.fan_rad < np.pi:
        raise InputError(f"[laser] fan_deg = {np.rad2deg(s.fan_rad):g}: must lie between 0 and 180")
