"""The chip: from mean electrons to grey levels, by EMVA 1288's linear model."""

from __future__ import annotations

import math
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from geometry import Sensor
from geometry.compiled import kernel
from perceptron_emu.chip.dark import DarkPixels, dark_levels, dark_pixels
from perceptron_emu.chip.hashing import BITS, DEVIATE, LOW, NORMAL, draw16, mix
from perceptron_emu.config import NoiseConfig

Float32 = NDArray[np.float32]
Bits = NDArray[np.uint32]
Draws = NDArray[np.uint16]
Image = NDArray[np.uint8] | NDArray[np.uint16]

FULL_WELL_OVER_RANGE = 1.03  # a saturated pixel then gives the largest grey level, its noise notwithstanding
RUN = 1024  # pixels that are exposed at a time; an even number, for two share 32 random bits
DARK_KEY = np.uint32(0x9E3779B9)  # turns the noise's key into that of its dark pixels
FIRST, SECOND = np.float32(0.8), np.float32(0.6)  # shares of the two deviates of a sum: their squares add up to 1
SURE = 6.0  # σ of shot noise that the full well must be away for it not to matter


class Pattern(NamedTuple):
    """The chip's own gains and offsets [e⁻] of all pixels, (N,) each: the same for every exposure of a camera."""

    gain: Float32
    offset: Float32


class Exposure(NamedTuple):
    """What turns mean electrons into grey levels, for compiled code.

    sure_e: mean charge below which shot noise never fills the well. dark_e: of the exposure's time.
    """

    gain_dn_per_e: float
    black_dn: float
    top_dn: float
    well_e: float
    sure_e: float
    read_noise_e: float
    dark_e: float
    shot: bool


def gain_dn_per_e(noise: NoiseConfig, sensor: Sensor) -> float:
    """System gain K of the camera.

    Parameters
    ----------
    noise : NoiseConfig
        The chip; its gain_dn_per_e, where given, is the answer.
    sensor : Sensor
        Its camera's grey levels count.

    Returns
    -------
    float
        [DN/e⁻]; by default the converter is full a little before the pixel is.
    """
    camera = sensor.require_camera()
    return noise.gain_dn_per_e or FULL_WELL_OVER_RANGE * (camera.saturation_dn - camera.black_level) / noise.full_well_e


def expose(electrons: Float32, noise: NoiseConfig, sensor: Sensor, time_s: float, key: int) -> Image:
    """The image that the chip delivers for mean photo-electrons.

    y = K·(clip(n) + DSNU + read) + black, quantised; n has the mean μ·(1 + PRNU) + dark and Poisson's variance and
    skewness.

    Parameters
    ----------
    electrons : Float32
        Mean photo-electrons (H, W).
    noise : NoiseConfig
        The chip.
    sensor : Sensor
        Its camera's grey levels and black level.
    time_s : float
        Exposure, for the dark current [s].
    key : int
        64 random bits; with the pixel's number they give its noise (counter-based, hence the same on every machine and
        thread).

    Returns
    -------
    Image
        (H, W) uint8 or, above 8 bits, uint16 [DN].

    References
    ----------
    EMVA Standard 1288, release 4.0 linear, section 2.
    """
    camera = sensor.require_camera()
    gain = gain_dn_per_e(noise, sensor)
    if not noise.enabled:
        grey = np.minimum(electrons, np.float32(noise.full_well_e))
        grey *= np.float32(gain)
        grey += np.float32(camera.black_level + 0.5)
        np.clip(grey, 0, camera.saturation_dn, out=grey)
        return grey.astype(np.uint8) if camera.bit_depth == 8 else grey.astype(np.uint16)
    exposure = Exposure(
        gain_dn_per_e=gain,
        black_dn=float(camera.black_level),
        top_dn=float(camera.saturation_dn),
        well_e=noise.full_well_e,
        sure_e=_sure_limit(noise.full_well_e),
        read_noise_e=noise.read_noise_e,
        dark_e=noise.dark_current_e_s * time_s,
        shot=noise.shot,
    )
    camera_pattern = _PatternOf(electrons.size, noise.pattern_seed, noise.prnu, noise.dsnu_e)
    out: Image = np.empty(electrons.shape, np.uint8) if camera.bit_depth == 8 else np.empty(electrons.shape, np.uint16)
    low, high = np.uint32(key & 0xFFFFFFFF), np.uint32(key >> 32 & 0xFFFFFFFF)
    light, dark = np.ascontiguousarray(electrons).ravel(), _dark(camera_pattern, exposure)
    _expose(light, _pattern(camera_pattern), dark, exposure, (low, high), out.ravel())
    return out


def _sure_limit(well_e: float) -> float:
    """Mean charge whose shot noise stays below the full well, by SURE of its σ."""
    root = (math.sqrt(SURE**2 + 4 * well_e) - SURE) / 2
    return root * root


class _PatternOf(NamedTuple):
    """Which camera: its pixels, its seed, and the σ of their own gains and offsets [e⁻]."""

    pixels: int
    seed: int
    prnu: float
    dsnu_e: float


@lru_cache(maxsize=4)
def _pattern(of: _PatternOf) -> Pattern:
    """The fixed pattern of the camera of that seed."""
    pattern = Pattern(np.empty(of.pixels, np.float32), np.empty(of.pixels, np.float32))
    _draw_pattern(pattern, np.uint64(of.seed * 2 + 1), of.prnu, of.dsnu_e)
    return pattern


@lru_cache(maxsize=4)
def _dark(of: _PatternOf, exposure: Exposure) -> DarkPixels:
    """What the pixels of that camera give where no light falls."""
    mean, read2 = np.float64(exposure.dark_e), exposure.read_noise_e**2
    z = DEVIATE.astype(float)
    if exposure.shot:
        variance = max(mean + read2, 1e-12)
        charge = mean + math.sqrt(variance) * z + (z * z - 1) / 6 * mean / variance
    else:
        charge = min(mean, exposure.well_e) + exposure.read_noise_e * z
    gain = exposure.gain_dn_per_e
    offset = _pattern(of).offset
    return dark_pixels(np.sort(charge) * gain + exposure.black_dn + 0.5, offset, gain, exposure.top_dn)


@kernel(inline=True)
def _deviate(bits: np.uint64, place: int) -> np.float32:
    """A standard normal deviate from 24 of the bits: the sum of two of the table is smooth where one is a staircase."""
    low, half = np.uint64(LOW), np.uint64(place + BITS)
    first, second = NORMAL[(bits >> np.uint64(place)) & low], NORMAL[(bits >> half) & low]
    deviate: np.float32 = FIRST * first + SECOND * second
    return deviate


@kernel(fastmath=True)
def _draw_pattern(pattern: Pattern, key: np.uint64, prnu: float, dsnu: float) -> None:
    for i in range(pattern.gain.size):
        bits = mix(i, key)
        pattern.gain[i] = np.float32(1) + np.float32(prnu) * _deviate(bits, 0)
        pattern.offset[i] = np.float32(dsnu) * _deviate(bits, 2 * BITS)


@kernel(fastmath=True)
def _expose(
    electrons: Float32,
    pattern: Pattern,
    dark: DarkPixels,
    exposure: Exposure,
    key: tuple[np.uint32, np.uint32],
    out: Image,
) -> None:
    """One draw for shot and read noise together where the well is far, two where it may cut the charge.

    Pixels are taken in runs, in loops over few arrays each, simple enough for the compiler to do several at once. Runs
    without any light are looked up: what a pixel gives then hangs on 16 random bits alone.
    """
    z, other = np.empty(RUN, np.float32), np.empty(RUN, np.float32)
    mean, signal = np.empty(RUN, np.float32), np.empty(RUN, np.float32)
    draws = np.empty(RUN // 2, np.uint32)
    light = electrons.view(np.uint32)
    read, (low, high) = exposure.read_noise_e, key
    scale, zero = np.float32(exposure.gain_dn_per_e), np.float32(exposure.black_dn) + np.float32(0.5)
    is_dark_known = exposure.dark_e < exposure.sure_e
    for first in range(0, electrons.size, RUN):
        n = min(RUN, electrons.size - first)
        here = slice(first, first + n)
        if is_dark_known and not _any_light(light[here]):
            draw16(draws, np.uint32(first // 2), low, np.uint32(high ^ DARK_KEY))
            dark_levels(draws.view(np.uint16)[:n], dark, first, out[here])
            continue
        draw16(draws, np.uint32(first // 2), low, high)
        _normal(z[:n], draws.view(np.uint16))
        largest = _charge(electrons[here], pattern.gain[here], np.float32(exposure.dark_e), mean)
        if not exposure.shot:
            _cut(mean[:n], np.float32(exposure.well_e), np.float32(read), z, signal)
        else:
            _noisy(mean[:n], z, np.float32(read * read), signal)
            if largest >= exposure.sure_e:
                draw16(draws, np.uint32(first // 2), low, np.uint32(~high))
                _normal(other[:n], draws.view(np.uint16))
                _near_the_well(mean[:n], z, other, exposure, signal)
        _quantise(signal[:n], pattern.offset[here], scale, zero, np.float32(exposure.top_dn), out[here])


@kernel
def _any_light(light: Bits) -> bool:
    """Whether any of the pixels, never negative, is more than 0; by their bits, several at once."""
    any_bit = np.uint32(0)
    for i in range(len(light)):
        any_bit |= light[i]
    return bool(any_bit != 0)


@kernel(fastmath=True)
def _normal(z: Float32, draws: Draws) -> None:
    """Standard normal deviates (n,) of 16 random bits each."""
    for i in range(len(z)):
        z[i] = DEVIATE[draws[i]]


@kernel(fastmath=True)
def _cut(mean: Float32, well: np.float32, read: np.float32, z: Float32, signal: Float32) -> None:
    """Charge without shot noise, cut by the full well, with read noise."""
    for i in range(len(mean)):
        signal[i] = min(mean[i], well) + read * z[i]


@kernel(fastmath=True)
def _near_the_well(mean: Float32, z: Float32, other: Float32, exposure: Exposure, signal: Float32) -> None:
    """Charge of the pixels whose shot noise the full well may cut; read noise comes after it."""
    sure, well, read = exposure.sure_e, np.float32(exposure.well_e), np.float32(exposure.read_noise_e)
    for i in range(len(mean)):
        if mean[i] >= sure:
            charge = mean[i] + math.sqrt(mean[i]) * z[i] + (z[i] * z[i] - np.float32(1)) / np.float32(6)
            signal[i] = min(charge, well) + read * other[i]


@kernel(fastmath=True)
def _quantise(
    signal: Float32, offset: Float32, scale: np.float32, zero: np.float32, top: np.float32, out: Image
) -> None:
    for i in range(len(out)):
        signal[i] = min(max((signal[i] + offset[i]) * scale + zero, np.float32(0)), top)
    for i in range(len(out)):
        out[i] = np.int32(signal[i])


@kernel(fastmath=True)
def _charge(light: Float32, own_gain: Float32, dark: np.float32, mean: Float32) -> np.float32:
    """Mean charge [e⁻] of a run of pixels, to ``mean``; returns the largest."""
    for i in range(len(light)):
        mean[i] = max(light[i] * own_gain[i] + dark, np.float32(0))
    bits, largest = mean.view(np.int32), np.int32(0)
    for i in range(len(light)):  # floats from 0 on are ordered as their bits are
        largest = max(largest, bits[i])
    found: np.float32 = np.array([largest]).view(np.float32)[0]
    return found


@kernel(fastmath=True)
def _noisy(mean: Float32, z: Float32, read2: np.float32, signal: Float32) -> None:
    """Charge with shot and read noise: variance μ + r² and third moment μ by Cornish and Fisher's expansion."""
    one, sixth = np.float32(1), np.float32(1 / 6)
    for i in range(len(mean)):
        variance = max(mean[i] + read2, np.float32(1e-12))
        signal[i] = mean[i] + np.float32(math.sqrt(variance)) * z[i] + (z[i] * z[i] - one) * sixth * mean[i] / variance
