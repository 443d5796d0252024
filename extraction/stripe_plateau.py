"""A section clipped over a plateau: its centre lies midway between the flanks, whatever the shape of the peak."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from extraction.compiled import inner
from extraction.stripe_columns import AMPLITUDE, BACKGROUND, CENTRE, CHI2, CONVERGED, SNR, VARIANCE, WIDTH

Array = NDArray[np.float64]

PLATEAU_PIXELS = 6  # clipped pixels from which the flanks are halo more than they are Gaussian
LEVELS = (0.35, 0.5, 0.65, 0.8)  # of the clipping level above the background
INTERPOLATION_PX = 0.05  # a flank that rises over one pixel is no straight line between two: error by phase
_FWHM = 2 * math.sqrt(2 * math.log(2))


@inner
def between_flanks(y: Array, n: int, clip: float, noise: Array, row: Array) -> bool:
    """Centre of the section's longest clipped run, midway between the flanks' crossings of LEVELS; False if none.

    y: grey levels (n). noise: `NoiseModel.as_array`. The amplitude is what is seen, the least it can be; the width is
    that of a Gaussian of the same width between the crossings. The levels share their pixels: two count as one.
    """
    first, last = _longest_run(y, n, clip)
    if last - first + 1 < PLATEAU_PIXELS:
        return False
    background = 0.25 * (y[0] + y[1] + y[n - 1] + y[n - 2])
    left, right, variance, count = 0.0, 0.0, 0.0, 0
    for share in LEVELS:
        level = background + share * (clip - background)
        a, b = first - 1, last + 1
        while a >= 0 and y[a] > level:
            a -= 1
        while b < n and y[b] > level:
            b += 1
        if a >= 1 and b <= n - 2:
            rise, fall = min(y[a + 1], clip) - y[a], min(y[b - 1], clip) - y[b]
            s, t = (level - y[a]) / rise, (level - y[b]) / fall
            left, right, count = left + a + s, right + b - t, count + 1
            spread = ((1 - s) ** 2 + s**2) / rise**2 + ((1 - t) ** 2 + t**2) / fall**2
            dark = noise[0] + noise[1] * max(level - noise[3], 0.0)
            variance += 0.25 * spread * (dark + noise[2] * (level - background) ** 2)
    if count == 0:
        return False
    left, right = left / count, right / count
    row[CENTRE], row[WIDTH] = 0.5 * (left + right), (right - left) / _FWHM
    row[AMPLITUDE], row[BACKGROUND] = clip - background, background
    row[VARIANCE] = variance / count / max(0.5 * count, 1.0) + INTERPOLATION_PX**2
    row[SNR] = (clip - background) / math.sqrt(noise[0] + noise[1] * max(clip - noise[3], 0.0))
    row[CHI2], row[CONVERGED] = 0.0, 1.0
    return True


@inner
def _longest_run(y: Array, n: int, clip: float) -> tuple[int, int]:
    """First and last index of the longest run of clipped pixels."""
    best, first, length = 0, 0, 0
    for k in range(n):
        length = length + 1 if y[k] >= clip else 0
        if length > best:
            best, first = length, k - length + 1
    return first, first + best - 1
