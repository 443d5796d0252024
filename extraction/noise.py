"""The noise of a pixel: the one law of variance that spots and stripes are weighted by."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from geometry.compiled import kernel

QUANTISATION_VARIANCE = 1.0 / 12.0  # of rounding to whole grey levels [DN²]


class PixelNoise(NamedTuple):
    """Variance of a pixel of mean μ and signal s: floor + gain · max(μ - dark, 0) + speckle2 · s² + model2 [DN²].

    floor: at the grey level ``dark`` [DN²]. gain: shot noise [DN per electron]. speckle2: the speckle's contrast,
    squared. model2: what weights allow for the model's own error [DN²].
    """

    floor: float
    gain: float
    dark: float
    speckle2: float
    model2: float = 0.0


NOISE = np.dtype([(name, np.float64) for name in PixelNoise._fields])


@kernel
def noise_of(record: Any) -> PixelNoise:
    """The law of one record of a NOISE array."""
    return PixelNoise(record.floor, record.gain, record.dark, record.speckle2, record.model2)


@kernel(fastmath=True)
def camera_variance(noise: PixelNoise, mean: float) -> float:
    """The camera's part alone: what speckle and the model's error do not make."""
    return noise.floor + noise.gain * max(mean - noise.dark, 0.0)


@kernel(fastmath=True)
def pixel_variance(noise: PixelNoise, mean: float, signal: float) -> float:
    """The variance of a pixel of that mean, of which ``signal`` is the spot's or the stripe's."""
    return (noise.floor + noise.model2) + noise.gain * max(mean - noise.dark, 0.0) + noise.speckle2 * signal * signal
