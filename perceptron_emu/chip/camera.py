"""The chip: from mean electrons to grey levels, by EMVA 1288's linear model."""

from __future__ import annotations

import math
from functools import lru_cache

import numpy as np
from numba import uint32, uint64
from numpy.typing import NDArray

from geometry import Sensor
from geometry.compiled import kernel
from perceptron_emu.chip.hashing import BITS, LOW, NORMAL, mix, mix32
from perceptron_emu.config import NoiseConfig

Float32 = NDArray[np.float32]
Image = NDArray[np.uint8] | NDArray[np.uint16]

FULL_WELL_OVER_RANGE = 1.03  # a saturated pixel then gives the largest grey level, its noise notwithstanding
RUN = 1024  # pixels that are exposed at a time
SURE = 6.0  # σ of shot noise that the full well must be away for it not to matter


def gain_dn_per_e(noise: NoiseConfig, sensor: Sensor) -> float:
    """System gain K [DN/e⁻]: as configured, or such that the converter is full a little before the pixel is."""
    camera = sensor.require_camera()
    return noise.gain_dn_per_e or FULL_WELL_OVER_RANGE * (camera.saturation_dn - camera.black_level) / noise.full_well_e


def expose(electrons: Float32, noise: NoiseConfig, sensor: Sensor, time_s: float, key: int) -> Image:
    """The image (H, W) that the chip delivers for mean photo-electrons (H, W).

    key: 64 random bits; with the pixel's number they give its noise (counter-based, hence the same on every machine
    and thread).
    y = K·(clip(n) + DSNU + read) + black, quantised; n has the mean μ·(1 + PRNU) + dark and Poisson's variance and
    skewness.
    Source: EMVA Standard 1288, release 4.0 linear, section 2.
    """
    camera = sensor.require_camera()
    out = np.empty(electrons.shape, np.uint8 if camera.bit_depth == 8 else np.uint16)
    gain = gain_dn_per_e(noise, sensor)
    if not noise.enabled:
        grey = np.minimum(electrons, np.float32(noise.full_well_e))
        grey *= np.float32(gain)
        grey += np.float32(camera.black_level + 0.5)
        np.clip(grey, 0, camera.saturation_dn, out=grey)
        return grey.astype(out.dtype)
    own_gain, own_offset = _pattern(electrons.size, noise.pattern_seed, noise.prnu, noise.dsnu_e)
    _expose(electrons.ravel(), out.ravel(), own_gain, own_offset, NORMAL, np.uint32(key & 0xFFFFFFFF),
            np.uint32(key >> 32 & 0xFFFFFFFF), gain, camera.black_level,
            float(camera.saturation_dn), noise.full_well_e, _sure_limit(noise.full_well_e), noise.read_noise_e,
            noise.dark_current_e_s * time_s, noise.shot)  # fmt: skip
    return out


def _sure_limit(well_e: float) -> float:
    """Mean charge whose shot noise stays below the full well, by SURE of its σ."""
    root = (math.sqrt(SURE**2 + 4 * well_e) - SURE) / 2
    return root * root


@lru_cache(maxsize=4)
def _pattern(pixels: int, seed: int, prnu: float, dsnu_e: float) -> tuple[Float32, Float32]:
    """The chip's own gains and offsets [e⁻] of all pixels, (N,) each; the same for every exposure of a camera."""
    own_gain, own_offset = np.empty(pixels, np.float32), np.empty(pixels, np.float32)
    _draw_pattern(own_gain, own_offset, NORMAL, np.uint64(seed * 2 + 1), prnu, dsnu_e)
    return own_gain, own_offset


@kernel(inline=True)
def _deviate(bits, place, normal):  # type: ignore[no-untyped-def]
    """A standard normal deviate from 24 of the bits: the sum of two of the table is smooth where one is a staircase."""
    low, half = uint64(LOW), uint64(place + BITS)
    return np.float32(0.8) * normal[(bits >> uint64(place)) & low] + np.float32(0.6) * normal[(bits >> half) & low]


@kernel(fastmath=True)
def _draw_pattern(own_gain, own_offset, normal, key, prnu, dsnu):  # type: ignore[no-untyped-def]
    for i in range(own_gain.size):
        bits = mix(i, key)
        own_gain[i] = np.float32(1) + np.float32(prnu) * _deviate(bits, 0, normal)
        own_offset[i] = np.float32(dsnu) * _deviate(bits, 2 * BITS, normal)


@kernel(fastmath=True)
def _expose(electrons, out, own_gain, own_offset, normal, low, high, gain, black, top, well, sure, read, dark, shot):  # type: ignore[no-untyped-def]
    """One draw for shot and read noise together where the well is far, two where it may cut the charge.

    Pixels are taken in runs, in loops over few arrays each, simple enough for the compiler to do several at once.
    """
    z, other = np.empty(RUN, np.float32), np.empty(RUN, np.float32)
    mean, signal = np.empty(RUN, np.float32), np.empty(RUN, np.float32)
    bits = np.empty(RUN, np.uint32)
    for first in range(0, electrons.size, RUN):
        n = min(RUN, electrons.size - first)
        _normal(z[:n], bits, first, low, high, normal)
        largest = _charge(electrons[first : first + n], own_gain[first : first + n], np.float32(dark), mean)
        if not shot:
            _cut(mean[:n], np.float32(well), np.float32(read), z, signal)
        else:
            _noisy(mean[:n], z, np.float32(read * read), signal)
            if largest >= sure:
                _normal(other[:n], bits, first, low, uint32(~high), normal)
                _near_the_well(mean[:n], z, other, sure, well, read, signal)
        scale, zero = np.float32(gain), np.float32(black) + np.float32(0.5)
        _quantise(signal[:n], own_offset[first : first + n], scale, zero, np.float32(top), out[first : first + n])


@kernel(fastmath=True)
def _normal(z, bits, first, low, high, normal):  # type: ignore[no-untyped-def]
    """Standard normal deviates of the pixels from ``first`` on: sums of two of the table, 24 bits each."""
    _bits(bits, uint32(first), low, high)
    for i in range(len(z)):
        z[i] = np.float32(0.8) * normal[bits[i] & uint32(LOW)] + np.float32(0.6) * normal[bits[i] >> uint32(32 - BITS)]


@kernel
def _bits(bits, first, low, high):  # type: ignore[no-untyped-def]
    for i in range(len(bits)):
        bits[i] = mix32(first + uint32(i), low, high)


@kernel(fastmath=True)
def _cut(mean, well, read, z, signal):  # type: ignore[no-untyped-def]
    """Charge without shot noise, cut by the full well, with read noise."""
    for i in range(len(mean)):
        signal[i] = min(mean[i], well) + read * z[i]


@kernel(fastmath=True)
def _near_the_well(mean, z, other, sure, well, read, signal):  # type: ignore[no-untyped-def]
    """Charge of the pixels whose shot noise the full well may cut; read noise comes after it."""
    for i in range(len(mean)):
        if mean[i] >= sure:
            charge = mean[i] + math.sqrt(mean[i]) * z[i] + (z[i] * z[i] - np.float32(1)) / np.float32(6)
            signal[i] = min(charge, np.float32(well)) + np.float32(read) * other[i]


@kernel(fastmath=True)
def _quantise(signal, offset, scale, zero, top, out):  # type: ignore[no-untyped-def]
    for i in range(len(out)):
        signal[i] = min(max((signal[i] + offset[i]) * scale + zero, np.float32(0)), top)
    for i in range(len(out)):
        out[i] = np.int32(signal[i])


@kernel(fastmath=True)
def _charge(light, own_gain, dark, mean):  # type: ignore[no-untyped-def]
    """Mean charge [e⁻] of a run of pixels, to ``mean``; returns the largest."""
    largest = np.float32(0)
    for i in range(len(light)):
        mean[i] = max(light[i] * own_gain[i] + dark, np.float32(0))
        largest = max(largest, mean[i])
    return largest


@kernel(fastmath=True)
def _noisy(mean, z, read2, signal):  # type: ignore[no-untyped-def]
    """Charge with shot and read noise: variance μ + r² and third moment μ by Cornish and Fisher's expansion."""
    one, sixth = np.float32(1), np.float32(1 / 6)
    for i in range(len(mean)):
        variance = max(mean[i] + read2, np.float32(1e-12))
        signal[i] = mean[i] + np.float32(math.sqrt(variance)) * z[i] + (z[i] * z[i] - one) * sixth * mean[i] / variance
