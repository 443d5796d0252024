"""Peaks of the blurred image: pixels that are the largest around and stand above the frame's noise."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from extraction.spots.detect.blur import BLOCK_PX, Image32
from extraction.spots.detect.prepare import PreparedImage
from geometry.compiled import kernel

Indices = NDArray[np.int64]
Marks = NDArray[np.uint8]

PEAK_RADIUS_PX = 2  # within which a peak is the largest: less than the blur's own width
USUAL_PEAKS, MAX_PEAKS = 4_000, 200_000  # room for peaks: at first, at most
PLACE_BITS = 2**32 - 1  # of a peak's key that hold its place in reading order


class Blocks(NamedTuple):
    """A blurred image (H, W) with the largest value, background and noise of its blocks (h, w), as in `Prepared`."""

    smooth: Image32
    tops: Image32
    background: Image32
    noise: Image32


def find_peaks(prepared: PreparedImage, threshold: float) -> Indices:
    """Keys (N,) of the peaks ``threshold`` · noise above the background, at most MAX_PEAKS.

    The smaller a key the brighter the peak; of equal ones the first in reading order has the smaller. `place` reads it.
    """
    blocks = Blocks(prepared.smooth, prepared.tops, prepared.background, prepared.noise)
    for most in (USUAL_PEAKS, MAX_PEAKS):
        keys = np.empty(most, np.int64)
        count = _peaks(blocks, threshold, keys)
        if count < most:
            break
    return keys[:count]


@kernel
def _peaks(blocks: Blocks, threshold: float, keys: Indices) -> int:
    """Write the peaks' keys to ``keys`` (M,); returns their number."""
    smooth, tops, background, noise = blocks.smooth, blocks.tops, blocks.background, blocks.noise
    rows, columns = smooth.shape
    h, w = background.shape
    count, marks, limits, bits = 0, np.zeros(columns + 8, np.uint8), np.empty(w), smooth.view(np.int32)
    eights = marks[: columns // 8 * 8 + 8].view(np.int64)
    for bj in range(h):
        first, last, end = bj * BLOCK_PX, rows if bj == h - 1 else (bj + 1) * BLOCK_PX, 0
        for bi in range(w):
            limits[bi] = background[bj, bi] + threshold * noise[bj, bi]
        while end < w:
            begin = end
            while end < w and tops[bj, end] > limits[end]:
                end += 1
            if end == begin:
                end += 1
                continue
            lowest = limits[begin]
            for k in range(begin + 1, end):
                lowest = min(lowest, limits[k])
            least = np.float32(lowest * (1.0 - 1e-6))  # not above the limits themselves
            left, right = begin * BLOCK_PX, columns if end == w else end * BLOCK_PX
            for j in range(first, last):
                _mark(smooth, j, left, right, least, marks)
                for eight in range(left // 8, (right + 7) // 8):
                    if eights[eight] == 0:
                        continue
                    for i in range(8 * eight, min(8 * eight + 8, right)):
                        limit = limits[min(i // BLOCK_PX, w - 1)]
                        if marks[i] and smooth[j, i] > limit and count < len(keys) and _is_peak(smooth, j, i):
                            keys[count] = j * columns + i - (np.int64(bits[j, i]) << 32)
                            count += 1
    return count


@kernel
def _mark(smooth: Image32, j: int, left: int, right: int, limit: np.float32, marks: Marks) -> None:
    """Mark in row j, from column ``left`` to before ``right``, what is above the limit and no less than its four
    neighbours; at the image's left and right border all that is above the limit.
    """
    here, above, below = smooth[j], smooth[max(j - 1, 0)], smooth[min(j + 1, len(smooth) - 1)]
    low, high = max(left, 1), min(right, len(here) - 1)
    for i in range(left, low):
        marks[i] = here[i] > limit
    for i in range(high, right):
        marks[i] = here[i] > limit
    # no branch and no negative index: for the vector unit
    middle, above, below, before, after = (
        here[low:high],
        above[low:high],
        below[low:high],
        here[low - 1 :],
        here[low + 1 :],
    )
    out = marks[low:high]
    for i in range(high - low):
        value = middle[i]
        mark = (value > limit) & (value >= above[i]) & (value >= below[i])
        out[i] = mark & (value >= before[i]) & (value >= after[i])


@kernel
def _is_peak(smooth: Image32, j: int, i: int) -> bool:
    """Whether no pixel within PEAK_RADIUS_PX is larger; of equal ones the first in reading order counts."""
    rows, columns = smooth.shape
    here, radius = smooth[j, i], PEAK_RADIUS_PX
    for y in range(max(0, j - radius), min(rows, j + radius + 1)):
        for x in range(max(0, i - radius), min(columns, i + radius + 1)):
            other = smooth[y, x]
            if other > here or (other == here and (y < j or (y == j and x < i))):
                return False
    return True
