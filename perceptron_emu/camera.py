"""The chip: from mean electrons to grey levels, by EMVA 1288's linear model."""

from __future__ import annotations

import math

import numpy as np
from numba import njit, uint64
from numpy.typing import NDArray

from geometry import SensorModel
from perceptron_emu.config import NoiseConfig
from perceptron_emu.hashing import NORMAL, mix

Float32 = NDArray[np.float32]
Image = NDArray[np.uint8] | NDArray[np.uint16]

FULL_WELL_OVER_RANGE = 1.03  # a saturated pixel then gives the largest grey level, its noise notwithstanding


def gain_dn_per_e(noise: NoiseConfig, sensor: SensorModel) -> float:
    """System gain K [DN/e⁻]: as configured, or such that the converter is full a little before the pixel is."""
    return noise.gain_dn_per_e or FULL_WELL_OVER_RANGE * (sensor.saturation_dn - sensor.black_level) / noise.full_well_e


def expose(electrons: Float32, noise: NoiseConfig, sensor: SensorModel, time_s: float, key: int) -> Image:
    """The image (H, W) that the chip delivers for mean photo-electrons (H, W).

    key: 64 random bits; with the pixel's number they give its noise (counter-based, hence the same on every machine
    and thread).
    y = K·(clip(n) + read) + black, quantised; n has the mean μ·(1 + PRNU) + dark + DSNU and Poisson's variance and
    skewness.
    Source: EMVA Standard 1288, release 4.0 linear, section 2.
    """
    out = np.empty(electrons.shape, np.uint8 if sensor.bit_depth == 8 else np.uint16)
    gain = gain_dn_per_e(noise, sensor)
    if not noise.enabled:
        grey = np.minimum(electrons, np.float32(noise.full_well_e))
        grey *= np.float32(gain)
        grey += np.float32(sensor.black_level + 0.5)
        np.clip(grey, 0, sensor.saturation_dn, out=grey)
        return grey.astype(out.dtype)
    _expose(electrons.ravel(), out.ravel(), NORMAL, np.uint64(key), np.uint64(noise.pattern_seed * 2 + 1), gain,
            sensor.black_level, float(sensor.saturation_dn), noise.full_well_e, noise.read_noise_e,
            noise.dark_current_e_s * time_s, noise.dsnu_e, noise.prnu, noise.shot)  # fmt: skip
    return out


@njit(cache=True, error_model="numpy", fastmath=True)
def _expose(electrons, out, normal, key, pattern, gain, black, top, well, read, dark, dsnu, prnu, shot):  # type: ignore[no-untyped-def]
    low = uint64(0xFFFF)
    for i in range(electrons.size):
        bits = mix(i, pattern)
        own_gain = np.float32(1) + np.float32(prnu) * normal[bits & low]
        own_offset = np.float32(dsnu) * normal[(bits >> uint64(16)) & low]
        mean = max(electrons[i] * own_gain + np.float32(dark), np.float32(0))
        bits = mix(i, key)
        # the sum of two table deviates is smooth where one alone would be a staircase
        z = np.float32(0.8) * normal[bits & low] + np.float32(0.6) * normal[(bits >> uint64(16)) & low]
        if shot:
            z2 = np.float32(0.8) * normal[(bits >> uint64(32)) & low] + np.float32(0.6) * normal[bits >> uint64(48)]
            # Poisson's mean, variance and skewness by Cornish and Fisher's expansion
            mean = mean + math.sqrt(mean) * z2 + (z2 * z2 - np.float32(1)) * np.float32(1 / 6)
        signal = min(mean, np.float32(well)) + own_offset + np.float32(read) * z
        grey = signal * np.float32(gain) + np.float32(black) + np.float32(0.5)
        out[i] = min(max(grey, np.float32(0)), np.float32(top))
