"""Pixels → points (0, y, z) of the laser sheet: undistort, intersect the ray with x = 0, propagate the covariance."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from extraction.sheet.lens import undistort
from geometry import InputError, Sensor

Array = NDArray[np.float64]


def image_to_sheet(sensor: Sensor, uv_px: ArrayLike) -> tuple[Array, Array]:
    """Points of the laser sheet seen at pixels, with the Jacobian of that map.

    Parameters
    ----------
    sensor
        A sensor with a camera.
    uv_px
        Pixels (N, 2), column first; pixel (0, 0) is the centre of the top-left one.

    Returns
    -------
    yz_mm
        Points (N, 2) in the laser plane x = 0 of {P}.
    jacobian
        d(yz)/d(uv) (N, 2, 2) [mm/px]. Both are NaN where the ray runs away from the sheet, where the lens model has no
        inverse, and beyond the pixels that a direct map was fitted to.

    Raises
    ------
    InputError
        Where the pixels have another shape, or the sensor no camera.

    References
    ----------
    OpenCV's camera model with fourteen coefficients, tilt included, inverted exactly (`undistort`).
    """
    uv = np.asarray(uv_px, dtype=float)
    if uv.ndim != 2 or uv.shape[1] != 2:
        raise InputError(f"pixels must be an array of shape (N, 2), not {uv.shape}")
    if sensor.direct is not None:
        camera = sensor.require_camera()
        return sensor.direct.to_sheet(uv, (camera.width_px, camera.height_px))
    rays = undistort(sensor, uv)
    yz, yz_by_xy = _meet_sheet(sensor, rays.xy)
    return yz, yz_by_xy @ rays.jacobian


def propagate(jacobian: Array, covariance: Array) -> Array:
    """Covariance J Σ Jᵀ of mapped points.

    Parameters
    ----------
    jacobian
        Of the map (N, 2, 2), as `image_to_sheet` gives it [mm/px].
    covariance
        Of the originals (N, 2, 2) or one for all (2, 2) [px²].

    Returns
    -------
    covariance
        Of the mapped points (N, 2, 2) [mm²].
    """
    return np.asarray(jacobian @ covariance @ np.swapaxes(jacobian, -1, -2))


def _meet_sheet(sensor: Sensor, xy: Array) -> tuple[Array, Array]:
    """Where the rays (x, y, 1) of the camera meet x = 0 of {P}: (y, z) (N, 2) and d(yz)/d(xy) (N, 2, 2)."""
    camera = sensor.require_camera()
    R, t = camera.T_sensor_camera.R, camera.T_sensor_camera.t
    direction = xy @ R[:, :2].T + R[:, 2]  # (N, 3) in {P}
    with np.errstate(divide="ignore", invalid="ignore"):
        reach = -t[0] / direction[:, 0]
        reach[~(np.isfinite(reach) & (reach > 0))] = np.nan
        yz = t[1:] + reach[:, None] * direction[:, 1:]
        by_xy = reach[:, None, None] * (R[1:, :2] - direction[:, 1:, None] * R[0, :2] / direction[:, 0, None, None])
    return yz, by_xy
