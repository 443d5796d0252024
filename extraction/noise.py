"""The noise of a pixel: what the frame, the camera and the speckle put into it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from extraction import spot_noise as sn
from extraction.config import NoiseConfig
from extraction.fit_frame import CONVERGED, NOISE
from extraction.preprocess import QUANTISATION_VARIANCE, Prepared
from geometry import SensorModel

Array = NDArray[np.float64]

# speckle that is estimated from an image starts from this contrast, with the weight of so many pixels
PRIOR_CONTRAST, PRIOR_PIXELS = 0.3, 12.0


@dataclass(frozen=True)
class NoiseModel:
    """Variance of a pixel: variance_dn2 + gain · signal + (contrast · signal)² [DN²].

    variance_dn2: of a raw pixel beside the spots. gain_dn_per_e: shot noise. speckle_weight: contrast in the weights of
    the fit; speckle_contrast: in the covariance, None where the image tells; speckle_grain_px: its correlation length.
    saturation_dn: grey level from which a pixel is clipped.
    """

    variance_dn2: float
    gain_dn_per_e: float
    speckle_weight: float
    speckle_contrast: float | None
    speckle_grain_px: float
    saturation_dn: float


def noise_model(prepared: Prepared, sensor: SensorModel, config: NoiseConfig) -> NoiseModel:
    """The frame's noise, from the configuration where it says and else from the frame itself."""
    gain = config.gain_dn_per_e
    if gain is None:
        gain = (sensor.saturation_dn - sensor.black_level) / config.full_well_e
    if config.read_noise_dn is not None:
        # the dark frame's background has no shot noise of its own to speak of
        variance = config.read_noise_dn**2 + QUANTISATION_VARIANCE
    else:
        # white noise of variance V has V · Σ kernel² · Σ kernel² after the separable blur
        variance = (float(np.median(prepared.noise)) / float(np.sum(prepared.kernel**2))) ** 2
    weight = config.speckle_weight
    if config.speckle_contrast is not None:
        weight = min(weight, 4.0 / 3.0 * config.speckle_contrast)
    return NoiseModel(
        max(variance, QUANTISATION_VARIANCE), gain, weight, config.speckle_contrast, config.speckle_grain_px,
        float(sensor.saturation_dn),
    )  # fmt: skip


def speckle_contrast(table: Array, noise: NoiseModel) -> float:
    """The speckle's contrast: as configured, or as the residuals of the image's fits show it, drawn to a prior."""
    if noise.speckle_contrast is not None:
        return noise.speckle_contrast
    good = (table[:, CONVERGED] > 0) & np.isfinite(table[:, NOISE + sn.EXCESS])
    excess, expected = table[good, NOISE + sn.EXCESS], table[good, NOISE + sn.EXPECTED]
    # a spot that is no Gaussian at all must not speak for the others
    with np.errstate(divide="ignore", invalid="ignore"):
        expected = np.where(excess > expected, 0.0, expected)
    excess = np.where(expected > 0, excess, 0.0)
    total = PRIOR_CONTRAST**2 * PRIOR_PIXELS + float(np.sum(excess))
    return float(np.sqrt(np.clip(total / (PRIOR_PIXELS + float(np.sum(expected))), 0.0, 1.0)))
