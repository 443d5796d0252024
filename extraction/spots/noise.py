"""The noise of a frame's pixels: what the camera and the speckle put into them, by the frame itself or as stated."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from extraction.config import SpotNoiseConfig
from extraction.image import clipping_level
from extraction.noise import QUANTISATION_VARIANCE
from extraction.spots.detect import Image32, PreparedImage, block_share
from geometry import Sensor
from geometry.special import ndtr

PRIOR_CONTRAST = 0.33  # of the speckle, where nothing is known of it; see `error.speckle`
# noise σ about grey level 0, cut off there and rounded: the mean and variance that are left
CUT_SIGMA = np.geomspace(0.1, 60.0, 120)
_STEPS = np.arange(300) + 0.5
_ABOVE = ndtr(-_STEPS / CUT_SIGMA[:, None])
CUT_MEAN = _ABOVE.sum(axis=1)
CUT_VARIANCE = 2.0 * _ABOVE @ _STEPS - CUT_MEAN**2
# noise of σ 1 about t ≥ 0, cut off at 0: variance over that of the same mean about 0, and the share of that correction
_T = np.linspace(0.0, 4.0, 81)
_MEAN = np.exp(-0.5 * _T**2) / np.sqrt(2.0 * np.pi) + _T * ndtr(_T)
_LEFT = ndtr(_T) + _T * _MEAN - _MEAN**2
ALIKE = _LEFT / _LEFT[0] * (_MEAN[0] / _MEAN) ** 2
SHARE = (1.0 / _LEFT - 1.0) / (1.0 / (ALIKE * _LEFT[0]) - 1.0)


@dataclass(frozen=True)
class FrameNoise:
    """What is known of the noise of a frame's pixels, from which each spot's `PixelNoise` is made.

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


def noise_model(prepared: PreparedImage, sensor: Sensor, config: SpotNoiseConfig) -> FrameNoise:
    """The frame's noise, from the configuration where it says and else from the frame itself."""
    camera = sensor.require_camera()
    gain = config.gain_dn_per_e
    if gain is None:
        gain = (camera.saturation_dn - camera.black_level) / config.full_well_e
    if config.read_noise_dn is not None:
        # the dark frame's background has no shot noise of its own to speak of
        variance = config.read_noise_dn**2 + QUANTISATION_VARIANCE
    else:
        # white noise of variance V has V · Σ kernel² · Σ kernel² after the separable blur
        variance = (_median(prepared.noise) / float(np.sum(prepared.kernel**2))) ** 2
        variance /= block_share(tuple(prepared.kernel))
        variance = uncut_variance(_median(prepared.background), variance)
    weight = config.speckle_weight
    if config.speckle_contrast is not None:
        weight = min(weight, 4.0 / 3.0 * config.speckle_contrast)
    return FrameNoise(
        max(variance, QUANTISATION_VARIANCE), gain, weight, config.speckle_contrast, config.speckle_grain_px,
        clipping_level(prepared.image, camera.saturation_dn), config.model_error,
    )  # fmt: skip


def _median(values: Image32) -> float:
    """Median of finite values, the upper one of two: numpy's own looks for NaN and takes three times as long."""
    return float(np.partition(values, values.size // 2, axis=None)[values.size // 2])


def uncut_variance(mean_dn: float, variance_dn2: float) -> float:
    """Variance of dark pixels before grey level 0 cut their noise off, from what is left of mean and variance [DN²].

    Without a black level dark pixels show less than half their noise, those that a spot lifts all of it. Where levels 0
    and 1 are all there is, mean and variance say the same, and the dark level is taken as 0.
    """
    if not CUT_MEAN[0] < mean_dn < CUT_MEAN[-1]:
        return variance_dn2
    whole = float(np.interp(mean_dn, CUT_MEAN, CUT_SIGMA)) ** 2 + QUANTISATION_VARIANCE
    alike = variance_dn2 / float(np.interp(mean_dn, CUT_MEAN, CUT_VARIANCE))
    share = float(np.interp(alike, ALIKE[::-1], SHARE[::-1]))
    return variance_dn2 + share * max(whole - variance_dn2, 0.0)
