"""The noise of a pixel: what the frame, the camera and the speckle put into it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from extraction.config import NoiseConfig
from extraction.preprocess import QUANTISATION_VARIANCE, Prepared
from geometry import SensorModel


@dataclass(frozen=True)
class NoiseModel:
    """Variance of a pixel: variance_dn2 + gain · signal + (contrast · signal)² [DN²].

    variance_dn2: of a raw pixel beside the spots. gain_dn_per_e: shot noise. speckle_weight: contrast in the weights of
    the fit; speckle_contrast, speckle_grain_px: in the covariance, None where the image tells.
    saturation_dn: grey level from which a pixel is clipped. model_error: of the Gaussian, over the spot's height.
    """

    variance_dn2: float
    gain_dn_per_e: float
    speckle_weight: float
    speckle_contrast: float | None
    speckle_grain_px: float | None
    saturation_dn: float
    model_error: float


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
        float(sensor.saturation_dn), config.model_error,
    )  # fmt: skip
