"""A direct map from pixels to the laser plane, as makers of sensors store it: no camera, no lens, no pose.

References
----------
The homography by the direct linear transform with normalised coordinates: Hartley & Zisserman, Multiple View Geometry
(2004), section 4.4.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from calib.sensor.result import SensorCalibration
from calib.sensor.start import homography
from geometry import DIGITS, InputError
from geometry.sensor import DirectMap

Array = NDArray[np.float64]

DirectModel = Literal["homography", "polynomial"]

ORDER = 4  # of the polynomial: lens and tilt of usual size leave micrometres beyond it
MIN_POINTS = 60  # four for each of fifteen coefficients


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
    views = [v for v in result.views if v.stripe_px is not None and v.stripe_yz_mm is not None]
    if not views or sum(len(v.stripe_px) for v in views if v.stripe_px is not None) < MIN_POINTS:
        raise InputError(f"a direct map needs at least {MIN_POINTS} points of the stripe")
    uv = np.concatenate([v.stripe_px for v in views if v.stripe_px is not None])
    yz = np.concatenate([v.stripe_yz_mm for v in views if v.stripe_yz_mm is not None])
    seen = (*np.floor(uv.min(axis=0)), *np.ceil(uv.max(axis=0)))
    box = (float(seen[0]), float(seen[1]), float(seen[2]), float(seen[3]))
    found = _homography(uv, yz) if model == "homography" else _polynomial(uv, yz, size_px)
    return replace(found, rms_mm=_short(_rms(found.to_sheet(uv, size_px)[0] - yz)), seen_px=box)


def _homography(uv: Array, yz: Array) -> DirectMap:
    h = homography(uv, yz)
    return DirectMap(np.array([[_short(v) for v in row] for row in (h / h[2, 2]).tolist()]))


def _polynomial(uv: Array, yz: Array, size_px: tuple[int, int]) -> DirectMap:
    powers = [(i, j) for i in range(ORDER + 1) for j in range(ORDER + 1 - i)]
    at = (uv - (np.array(size_px) - 1) / 2) / (np.hypot(*size_px) / 2)
    basis = np.stack([at[:, 0] ** i * at[:, 1] ** j for i, j in powers], -1)
    coefficients = np.linalg.lstsq(basis, yz, rcond=None)[0]
    return DirectMap(
        polynomial=tuple(
            (i, j, _short(float(y)), _short(float(z))) for (i, j), (y, z) in zip(powers, coefficients, strict=True)
        )
    )


def _short(value: float) -> float:
    """A number to DIGITS significant digits, however small: a direct map multiplies it by powers of pixels."""
    return float(f"{value:.{DIGITS}g}")


def _rms(error: Array) -> float:
    return float(np.sqrt(np.mean(np.sum(error**2, axis=1))))
