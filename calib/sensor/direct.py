"""A direct map from pixels to the laser plane, as makers of sensors store it: no camera, no lens, no pose.

References
----------
The homography by the direct linear transform with normalised coordinates: Hartley & Zisserman, Multiple View Geometry
(2004), section 4.4.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from calib.sensor.result import SensorCalibration
from calib.sensor.start import homography
from geometry import InputError

Array = NDArray[np.float64]

DirectModel = Literal["homography", "polynomial"]

ORDER = 4  # of the polynomial: lens and tilt of usual size leave micrometres beyond it
MIN_POINTS = 60  # four for each of fifteen coefficients


@dataclass(frozen=True, eq=False)
class DirectMap:
    """(u, v) to (y, z).

    Parameters
    ----------
    homography : ndarray (3, 3) or None
        (u, v, 1) to (y, z, 1) [mm].
    polynomial : tuple of (i, j, y, z)
        Coefficients [mm] of uⁱvʲ, in pixels from the image's centre over its half diagonal; empty for a homography.
    rms_mm : float
        Of the stripes' points from what the bundle makes of them.
    """

    homography: Array | None
    polynomial: tuple[tuple[int, int, float, float], ...]
    rms_mm: float


def fit_direct(result: SensorCalibration, model: DirectModel, size_px: tuple[int, int]) -> DirectMap:
    """A direct map fitted to the stripes' points of a calibration.

    Parameters
    ----------
    result
        A calibration with a solution: its boards tell where in the plane each stripe point lies.
    model
        "homography", or "polynomial" of order four.
    size_px
        Width and height of the image.

    Returns
    -------
    DirectMap
        With the residual that is left, which a homography has from the lens.

    Raises
    ------
    InputError
        Where there are too few points.
    """
    seen = [v for v in result.views if v.stripe_px is not None and v.stripe_yz_mm is not None]
    if not seen or sum(len(v.stripe_px) for v in seen if v.stripe_px is not None) < MIN_POINTS:
        raise InputError(f"a direct map needs at least {MIN_POINTS} points of the stripe")
    uv = np.concatenate([v.stripe_px for v in seen if v.stripe_px is not None])
    yz = np.concatenate([v.stripe_yz_mm for v in seen if v.stripe_yz_mm is not None])
    if model == "homography":
        h = homography(uv, yz)
        h = h / h[2, 2]
        p = np.column_stack([uv, np.ones(len(uv))]) @ h.T
        return DirectMap(h, (), _rms(p[:, :2] / p[:, 2:] - yz))
    powers = [(i, j) for i in range(ORDER + 1) for j in range(ORDER + 1 - i)]
    at = (uv - (np.array(size_px) - 1) / 2) / (np.hypot(*size_px) / 2)
    basis = np.stack([at[:, 0] ** i * at[:, 1] ** j for i, j in powers], -1)
    coefficients = np.linalg.lstsq(basis, yz, rcond=None)[0]
    rows = tuple((i, j, float(c[0]), float(c[1])) for (i, j), c in zip(powers, coefficients, strict=True))
    return DirectMap(None, rows, _rms(basis @ coefficients - yz))


def _rms(error: Array) -> float:
    return float(np.sqrt(np.mean(np.sum(error**2, axis=1))))
