"""Several exposures merged into one image of a wider range."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from geometry import Camera, Sensor
from perceptron_emu.chip.camera import Image, expose
from perceptron_emu.chip.hashing import mix_keys
from perceptron_emu.config import ExposureConfig, NoiseConfig

Float32 = NDArray[np.float32]

USABLE = 0.95  # of the range: above, noise can hide that a pixel is full


def expose_hdr(electrons: Float32, exposure: ExposureConfig, noise: NoiseConfig, sensor: Sensor, key: int) -> Image:
    """Exposures of time_ms and of its parts hdr_ratios merged into one image, each with its own noise.

    A pixel's value is the mean of its exposures that are not saturated, each scaled to the shortest and weighted by its
    time: the best weights where shot noise rules. The shortest exposure's full scale becomes the image's, so the image
    wants more bits than one exposure: [noise] adc_bits, [image] bit_depth.

    Parameters
    ----------
    electrons : Float32
        Mean photo-electrons (H, W) of the longest exposure.
    exposure : ExposureConfig
        Time and ratios.
    noise : NoiseConfig
        The chip.
    sensor : Sensor
        Its camera's grey levels and black level.
    key : int
        64 random bits.

    Returns
    -------
    Image
        (H, W) uint8 or, above 8 bits, uint16 [DN].

    References
    ----------
    Robertson, Borman & Stevenson, "Estimation-theoretic approach to dynamic range enhancement", 2003.
    """
    camera = sensor.require_camera()
    once = sensor.with_camera(
        bit_depth=noise.adc_bits or camera.bit_depth, black_level=_black(camera, noise), stated_saturation_dn=None
    )
    single = once.require_camera()
    ratios = np.array([1.0, *exposure.hdr_ratios])
    top, shortest = single.saturation_dn, float(ratios.min())
    total, weight = np.zeros(electrons.shape, np.float32), np.zeros(electrons.shape, np.float32)
    for number, ratio in enumerate(ratios):
        time_s = exposure.time_ms * 1e-3 * ratio
        grey = expose(electrons * np.float32(ratio), noise, once, time_s, mix_keys(key, number)).astype(np.float32)
        good = (grey < USABLE * top) if ratio > shortest else np.ones_like(grey, dtype=bool)
        share = np.float32(ratio) * good
        total += share * (grey - np.float32(single.black_level)) * np.float32(shortest / ratio)
        weight += share
    scale = (camera.saturation_dn - camera.black_level) / (top - single.black_level)
    merged = total / weight * np.float32(scale) + np.float32(camera.black_level)
    np.clip(np.floor(merged + np.float32(0.5)), 0, camera.saturation_dn, out=merged)
    image: Image = merged.astype(np.uint8) if camera.bit_depth == 8 else merged.astype(np.uint16)
    return image


def _black(camera: Camera, noise: NoiseConfig) -> float:
    """The black level of one exposure: the image's, in the converter's own grey levels."""
    return camera.black_level * 2.0 ** min(0, (noise.adc_bits or camera.bit_depth) - camera.bit_depth)
