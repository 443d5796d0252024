"""A section clipped over a plateau: its centre lies midway between the flanks, whatever the shape of the peak."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from extraction.compiled import inner
from extraction.stripe_columns import AMPLITUDE, BACKGROUND, CENTRE, CHI2, CONVERGED, SNR, VARIANCE, WIDTH

Array = NDArray[np.float64]

PLATEAU_PIXELS = 6  # clipped pixels from which the flanks are halo more than they are Gaussian
_FWHM = 2 * math.sqrt(2 * math.log(2))


@inner
def between_flanks(y: Array, n: int, clip: float, noise: Array, row: Array) -> bool:
    """Centre of the section's longest clipped run by both flanks' crossings of half the clipping level; False if none.

    y: grey levels (n). noise: `NoiseModel.as_array`. The amplitude is what is seen, the least it can be; the width is
    that of a Gaussian of the same width between the crossings.
    """
    first, last = _longest_run(y, n, clip)
    background = 0.25 * (y[0] + y[1] + y[n - 1] + y[n - 2])
    level = 0.5 * (clip + background)
    a, b = first - 1, last + 1
    while a >= 0 and y[a] > level:
        a -= 1
    while b < n and y[b] > level:
        b += 1
    if last - first + 1 < PLATEAU_PIXELS or a < 1 or b > n - 2:
        return False
    rise, fall = min(y[a + 1], clip) - y[a], min(y[b - 1], clip) - y[b]
    left, right = (level - y[a]) / rise, (level - y[b]) / fall
    variance = noise[0] + noise[1] * max(level - noise[3], 0.0) + noise[2] * (level - background) ** 2
    spread = ((1 - left) ** 2 + left**2) / rise**2 + ((1 - right) ** 2 + right**2) / fall**2
    row[CENTRE] = 0.5 * (a + left + b - right)
    row[AMPLITUDE], row[BACKGROUND] = clip - background, background
    row[WIDTH] = (b - right - a - left) / _FWHM
    row[VARIANCE], row[SNR] = 0.25 * variance * spread, (clip - background) / math.sqrt(variance)
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
