"""A section clipped over a plateau: its centre lies midway between the flanks, whatever the shape of the peak."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from extraction.noise import PixelNoise, camera_variance, pixel_variance
from geometry.compiled import kernel

Array = NDArray[np.float64]
IntArray = NDArray[np.int32]

PLATEAU_PIXELS = 6  # clipped pixels from which the flanks are halo more than they are Gaussian
FLOOR = 0.2  # of the clipping level above the background: what lies below is halo and surface more than flank
# error by phase of flanks that rise over a pixel or two, and the sum of their partial pixels' f (1 - f) from which it
# falls: Gaussians of σ 1.5 to 6 px, clipped at a half to a twelfth of their height, leave 0.035 px, then 0.02 at 1.1
# and 0.01 at 1.5
INTERPOLATION_PX, SOFT = 0.034, 0.6
_BELOW = 3  # pixels in a row below the floor that end a flank
_FWHM = 2 * math.sqrt(2 * math.log(2))


@kernel
def between_flanks(y: Array, clip: float, noise: PixelNoise, row: Any) -> bool:
    """Centre of the section's longest clipped run, midway between its flanks; False where a flank is not seen.

    y: grey levels (n,). row: the record of SECTION that is filled. A flank's place is the mean of where it crosses all
    levels from FLOOR to ``clip``: the sum of its grey levels, which asks for no monotonous rise. The amplitude is what
    is seen, the least it can be; the width is that of a Gaussian as wide between the flanks.
    """
    n = len(y)
    first, last = _longest_run(y, clip)
    if last - first + 1 < PLATEAU_PIXELS:
        return False
    background = 0.25 * (y[0] + y[1] + y[n - 1] + y[n - 2])
    height = clip - background
    left, left_variance, left_partial = _flank(y, first - 1, -1, background, height, noise)
    right, right_variance, right_partial = _flank(y, last + 1, 1, background, height, noise)
    if left < 0 or right < 0:
        return False
    row.centre = 0.5 * (first + last + right - left)
    row.width = (last - first + 1 + left + right) / _FWHM
    row.amplitude, row.background = height, background
    softness = max((left_partial + right_partial) / SOFT, 1.0)
    row.floor = (INTERPOLATION_PX / softness) ** 2
    row.variance = 0.25 * (left_variance + right_variance) + row.floor
    row.snr = height / math.sqrt(camera_variance(noise, clip))
    row.chi2, row.converged = 0.0, True
    return True


@kernel
def _flank(
    y: Array, start: int, step: int, background: float, height: float, noise: PixelNoise
) -> tuple[float, float, float]:
    """How far a flank reaches from the clipped run [px], its variance, and how soft it is; -1 where the section ends
    within it.

    start, step: first pixel and direction. height: of the clipping level above the background.
    """
    k = start
    reach, variance, partial, below = 0.0, 0.0, 0.0, 0
    while 0 <= k < len(y) and below < _BELOW:
        share = ((y[k] - background) / height - FLOOR) / (1.0 - FLOOR)
        if share > 0:
            reach += min(share, 1.0)
            partial += min(share, 1.0) * (1.0 - min(share, 1.0))
            signal = max(y[k] - background, 0.0)
            variance += pixel_variance(noise, y[k], signal) / (height * (1.0 - FLOOR)) ** 2
            below = 0
        else:
            below += 1
        k += step
    return (reach, variance, partial) if below else (-1.0, 0.0, 0.0)


@kernel
def _longest_run(y: Array, clip: float) -> tuple[int, int]:
    """First and last index of the longest run of clipped pixels."""
    best, first, length = 0, 0, 0
    for k in range(len(y)):
        length = length + 1 if y[k] >= clip else 0
        if length > best:
            best, first = length, k - length + 1
    return first, first + best - 1
