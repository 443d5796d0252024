"""A section clipped over a plateau: its centre lies midway between the flanks, whatever the shape of the peak."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from extraction.stripe.columns import AMPLITUDE, BACKGROUND, CENTRE, CHI2, CONVERGED, SNR, VARIANCE, WIDTH
from geometry.compiled import kernel

Array = NDArray[np.float64]
IntArray = NDArray[np.int32]

PLATEAU_PIXELS = 6  # clipped pixels from which the flanks are halo more than they are Gaussian
FLOOR = 0.2  # of the clipping level above the background: what lies below is halo and surface more than flank
INTERPOLATION_PX = 0.034  # of a flank that rises over one pixel: error by phase
_BELOW = 3  # pixels in a row below the floor that end a flank
_FWHM = 2 * math.sqrt(2 * math.log(2))


@kernel
def between_flanks(y: Array, n: int, clip: float, noise: Array, row: Array) -> bool:
    """Centre of the section's longest clipped run, midway between its flanks; False where a flank is not seen.

    y: grey levels (n). noise: `NoiseModel.as_array`. A flank's place is the mean of where it crosses all levels from
    FLOOR to ``clip``: the sum of its grey levels, which asks for no monotonous rise. The amplitude is what is seen, the
    least it can be; the width is that of a Gaussian as wide between the flanks.
    """
    first, last = _longest_run(y, n, clip)
    if last - first + 1 < PLATEAU_PIXELS:
        return False
    background = 0.25 * (y[0] + y[1] + y[n - 1] + y[n - 2])
    height = clip - background
    left, left_variance = _flank(y, n, (first - 1, -1), (background, height), noise)
    right, right_variance = _flank(y, n, (last + 1, 1), (background, height), noise)
    if left < 0 or right < 0:
        return False
    row[CENTRE] = 0.5 * (first + last + right - left)
    row[WIDTH] = (last - first + 1 + left + right) / _FWHM
    row[AMPLITUDE], row[BACKGROUND] = height, background
    row[VARIANCE] = 0.25 * (left_variance + right_variance) + INTERPOLATION_PX**2
    row[SNR] = height / math.sqrt(noise[0] + noise[1] * max(clip - noise[3], 0.0))
    row[CHI2], row[CONVERGED] = 0.0, 1.0
    return True


@kernel
def _flank(y: Array, n: int, place: tuple[int, int], level: tuple[float, float], noise: Array) -> tuple[float, float]:
    """How far a flank reaches from the clipped run [px], and its variance; -1 where the section ends within it.

    place: first pixel and direction; level: background and clipping level above it.
    """
    k, step = place
    background, height = level
    reach, variance, below = 0.0, 0.0, 0
    while 0 <= k < n and below < _BELOW:
        share = ((y[k] - background) / height - FLOOR) / (1.0 - FLOOR)
        if share > 0:
            reach += min(share, 1.0)
            signal = max(y[k] - background, 0.0)
            dark = noise[0] + noise[1] * max(y[k] - noise[3], 0.0)
            variance += (dark + noise[2] * signal * signal) / (height * (1.0 - FLOOR)) ** 2
            below = 0
        else:
            below += 1
        k += step
    return (reach, variance) if below else (-1.0, 0.0)


@kernel
def join_plateaus(
    grey: NDArray[np.generic], section: NDArray[np.int32], place: tuple[Array, IntArray, IntArray], clip: float
) -> tuple[NDArray[np.bool_], Array, IntArray, IntArray]:
    """Candidates on one clipped run made one: which remain (N,), their places, and their ranges low and high.

    A detector finds no peak on a plateau, or several; each would be given one flank only.
    place: centre, low and high as in `Candidates`.
    """
    centre, low, high = place[0].copy(), place[1].copy(), place[2].copy()
    keep = np.ones(len(section), dtype=np.bool_)
    last = 0
    for i in range(1, len(section)):
        same = section[i] == section[last]
        if same:
            for k in range(int(centre[last] + 0.5), int(centre[i] + 0.5) + 1):
                same = same and grey[k, section[i]] >= clip
        if same:
            keep[i], high[last] = False, high[i]
            centre[last] = 0.5 * (centre[last] + centre[i])
        else:
            last = i
    return keep, centre, low, high


@kernel
def _longest_run(y: Array, n: int, clip: float) -> tuple[int, int]:
    """First and last index of the longest run of clipped pixels."""
    best, first, length = 0, 0, 0
    for k in range(n):
        length = length + 1 if y[k] >= clip else 0
        if length > best:
            best, first = length, k - length + 1
    return first, first + best - 1
