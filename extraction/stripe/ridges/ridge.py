"""Ridges of an image at several scales: where a section is brighter than both its flanks, in units of the noise there.

A level of the pyramid holds the means of 2 × 2, 4 × 4, 8 × 8 … pixels. At each the response is a second difference
along the section: the mean of two rows minus that of the two at three rows' distance on either side. A plateau
answers once, at the level where it is two rows wide.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from extraction.order import kth_smallest_level
from geometry.compiled import kernel

Array = NDArray[np.float64]
Level = NDArray[np.float32]
IntArray = NDArray[np.int32]

FLANK = 3  # rows from the centre to either flank
_APART = 2  # rows on either side that a peak must not fall short of
_SAMPLES = 3_000  # of a level's response at most, for its noise
_BINS = 12  # of the background's brightness: texture and shot noise grow with it
_FEWEST = 24  # samples of a bin that say something
_LAG = 12  # level pixels along the sections, beyond the correlation of blur and speckle
_ROUGHER = 2.0  # times as rough in proportion, that bright ground may be: beside a stripe its own light is no noise
_WORD = 8  # pixels of a row that are looked at together
_RING = 8  # rows of the response that are kept: those a peak is compared with
_QUANTISATION = (
    0.5  # σ of the response to rounding, of whole grey levels over 2 × 2 pixels … at 1 px; less with the level
)


class NoiseTable(NamedTuple):
    """The response's σ by the background's brightness: ``sigma`` (B,) at steps of its root from ``dark``.

    border: grey level from which σ is at least ``above``, as it is at least ``below`` everywhere: set so that most
    pixels need no closer look.
    """

    dark: float
    step: float
    sigma: Array
    border: float
    below: float
    above: float


class PeakLimits(NamedTuple):
    """Below ``border`` (four times the ground) a peak is above ``dark``, else above ``bright``."""

    border: np.float32
    dark: np.float32
    bright: np.float32


class RidgeNodes(NamedTuple):
    """Peaks of one level ordered by section, then place (N,).

    place: along the section [level px]. response, near, far: centre less mean, lower-index and higher-index flank [DN].
    noise: σ of the response there [DN]. first: index of each section's first node, and the end (S + 1,).
    """

    section: IntArray
    place: Level
    response: Level
    near: Level
    far: Level
    noise: Level
    first: IntArray


def halve(image: NDArray[Any]) -> Level:
    """Means of 2 × 2 pixels (H // 2, W // 2) float32; an odd last row or column is left out."""
    out = np.empty((image.shape[0] // 2, image.shape[1] // 2), dtype=np.float32)
    if image.dtype == np.uint8 and image.shape[1] % 2 == 0 and image.size:
        _halve_bytes(image.view(np.uint16), out)
    else:
        _halve(image, out)
    return out


@kernel
def find_nodes(level: Level, scale: float, threshold: float) -> RidgeNodes:
    """Peaks along the columns of a level (H, W) whose response is ``threshold`` σ. scale: pixels to a level pixel."""
    table = _noise(level, _QUANTISATION / scale)
    room = max(level.size // (4 if threshold < 2 else 8), 64)
    section, values = np.empty(room, np.int32), np.empty((room, 5), np.float32)
    first = np.zeros(level.shape[1] + 1, np.int32)
    n = _peaks(level, table, threshold, section, values, first)
    for c in range(1, len(first)):
        first[c] += first[c - 1]
    at = first[:-1].copy()
    own, columns = np.empty(n, np.int32), np.empty((5, n), np.float32)
    for i in range(n):  # a counting sort, stable
        k = at[section[i]]
        at[section[i]] += 1
        own[k] = section[i]
        for j in range(5):
            columns[j, k] = values[i, j]
    return RidgeNodes(own, columns[0], columns[1], columns[2], columns[3], columns[4], first)


@kernel
def fall_on(level: Level, nodes: RidgeNodes) -> None:
    """Take for the nodes' falls to either flank the means of their own and of those on another level of that size.

    A border of light and dark has one fall there, however even it looks without its ground; the ground of a ridge may
    slope, but not as much.
    """
    last, half = level.shape[0] - 1, np.float32(0.5)
    for i in range(len(nodes.place)):
        r, c = min(max(int(nodes.place[i]), 0), last), nodes.section[i]
        near, far = _flanks(level, r, c)
        centre = half * (level[r, c] + level[min(r + 1, last), c])
        nodes.near[i] = half * (nodes.near[i] + centre - half * near)
        nodes.far[i] = half * (nodes.far[i] + centre - half * far)


@kernel
def _halve(image: NDArray[Any], out: Level) -> None:
    for r in range(len(out)):
        a, b, means = image[2 * r], image[2 * r + 1], out[r]
        for c in range(len(means)):
            total = np.float32(a[2 * c]) + np.float32(a[2 * c + 1])
            total += np.float32(b[2 * c]) + np.float32(b[2 * c + 1])
            means[c] = np.float32(0.25) * total


@kernel
def _halve_bytes(pairs: NDArray[np.uint16], out: Level) -> None:
    """The same of bytes that lie two in a word, in whichever order."""
    low, eight = np.uint16(255), np.uint16(8)
    for r in range(len(out)):
        a, b, means = pairs[2 * r], pairs[2 * r + 1], out[r]
        for c in range(len(means)):
            total = (a[c] & low) + (a[c] >> eight) + (b[c] & low) + (b[c] >> eight)
            means[c] = np.float32(0.25) * np.float32(np.int32(total))


@kernel(fastmath=True)
def _respond(level: Level, r: int, out: Level) -> None:
    """The second difference of rows r, r + 1 (W,): their mean less that of the flanks; rows beyond the border repeat
    it.
    """
    last = level.shape[0] - 1
    half, quarter = np.float32(0.5), np.float32(0.25)
    a, b, d = level[max(r - FLANK, 0)], level[max(r + 1 - FLANK, 0)], level[min(r + FLANK, last)]
    e, here, below = level[min(r + 1 + FLANK, last)], level[r], level[min(r + 1, last)]
    for c in range(len(out)):
        out[c] = half * (here[c] + below[c]) - quarter * ((a[c] + b[c]) + (d[c] + e[c]))


@kernel(fastmath=True)
def _flanks(level: Level, r: int, c: int) -> tuple[float, float]:
    """Sums of two rows on the lower-index and on the higher-index flank."""
    last = level.shape[0] - 1
    near = level[max(r - FLANK, 0), c] + level[max(r + 1 - FLANK, 0), c]
    return near, level[min(r + FLANK, last), c] + level[min(r + 1 + FLANK, last), c]


@kernel
def _noise(level: Level, least: float) -> NoiseTable:
    """σ of the response by the background's brightness.

    The least of the robust spread and of that of differences along the sections: in a region that is mostly stripe the
    first is the stripe's own.
    """
    rows, columns = level.shape
    lag = min(_LAG, max(columns // 4, 1))
    step = max(1, math.ceil(math.sqrt(level.size / _SAMPLES)))
    wide = max(columns - lag, 1)
    most = ((rows - 1) // step + 1) * ((wide - 1) // step + 1)
    sample, ground = np.empty((2, most), np.float32), np.empty(most, np.float32)
    n = 0
    for r in range(0, rows, step):
        n += _sample_row(level, r, (r // step) % step, wide, step, lag, sample[0, n:], sample[1, n:], ground[n:])
    dark, light = float(ground[0]), float(ground[0])
    for i in range(n):
        dark, light = min(dark, float(ground[i])), max(light, float(ground[i]))
    width = math.sqrt(max(light - dark, 1.0)) / _BINS
    start, bins, own = np.zeros(_BINS + 1, np.int64), np.empty(n, np.int64), np.empty((2, n), np.float32)
    for i in range(n):
        bins[i] = min(int(math.sqrt(ground[i] - dark) / width), _BINS - 1)
    for i in range(n):  # in a loop of its own: the one above is made into vector instructions
        start[bins[i] + 1] += 1
    for k in range(_BINS):
        start[k + 1] += start[k]
    at = start[:-1].copy()
    for i in range(n):
        j = at[bins[i]]
        at[bins[i]] += 1
        own[0, j], own[1, j] = sample[0, i], sample[1, i]
    sigma, bulk, known = np.empty(_BINS), 0, -1
    for k in range(_BINS):
        a, b = start[k], start[k + 1]
        if b - a > start[bulk + 1] - start[bulk]:
            bulk = k
        if b - a < _FEWEST:
            continue
        spread = _spread(own[0, a:b], kth_smallest_level(own[0, a:b], (b - a) // 2))
        sigma[k] = max(1.4826 * min(spread, _spread(own[1, a:b], 0.0) / math.sqrt(2)), least)
        for j in range(known + 1, k):  # bins between two known ones, or before the first
            t = (j - known) / (k - known)
            sigma[j] = sigma[k] if known < 0 else (1 - t) * sigma[known] + t * sigma[k]
        known = k
    for j in range(known + 1, _BINS):
        sigma[j] = sigma[known] if known >= 0 else max(least, _spread(sample[0, :n].copy(), 0.0))
    # what most of the image is: brighter ground may be as rough in proportion, and some
    usual = dark + ((bulk + 0.5) * width) ** 2
    for k in range(_BINS):
        here = dark + ((k + 0.5) * width) ** 2
        sigma[k] = min(sigma[k], max(_ROUGHER * sigma[bulk] * here / max(usual, 1.0), sigma[bulk]))
    split, least_cost = 0, np.inf
    for k in range(_BINS):
        cost = start[k] / _least(sigma, 0, k) ** 2 if k else 0.0
        cost += (n - start[k]) / _least(sigma, k, _BINS) ** 2
        if cost < least_cost:
            split, least_cost = k, cost
    return NoiseTable(
        dark, width, sigma, dark + (split * width) ** 2, _least(sigma, 0, _BINS), _least(sigma, split, _BINS)
    )


@kernel(fastmath=True)
def _sample_row(
    level: Level, r: int, start: int, wide: int, step: int, lag: int, value: Level, change: Level, ground: Level
) -> int:
    """The response of every n-th pixel of a row, its change to the one ``lag`` sections on, and the flanks' mean there;
    how many.
    """
    last, columns, n = level.shape[0] - 1, level.shape[1], 0
    half, quarter = np.float32(0.5), np.float32(0.25)
    a, b, d = level[max(r - FLANK, 0)], level[max(r + 1 - FLANK, 0)], level[min(r + FLANK, last)]
    e, here, below = level[min(r + 1 + FLANK, last)], level[r], level[min(r + 1, last)]
    for c in range(start, wide, step):
        there = min(c + lag, columns - 1)
        flanks, far = (a[c] + b[c]) + (d[c] + e[c]), (a[there] + b[there]) + (d[there] + e[there])
        own = half * (here[c] + below[c]) - quarter * flanks
        value[n], ground[n] = own, quarter * flanks
        change[n] = half * (here[there] + below[there]) - quarter * far - own
        n += 1
    return n


@kernel
def _least(values: Array, start: int, stop: int) -> float:
    least = values[start]
    for k in range(start + 1, stop):
        least = min(least, values[k])
    return float(least)


@kernel
def _spread(values: Level, middle: float) -> float:
    """The median distance from ``middle``; the values (N,) are overwritten."""
    for i in range(len(values)):
        values[i] = abs(values[i] - np.float32(middle))
    return kth_smallest_level(values, len(values) // 2)


@kernel(fastmath=True)
def _candidates(
    level: Level, r: int, around: tuple[Level, Level, Level], least: PeakLimits, out: NDArray[np.uint8]
) -> None:
    """Mark the pixels of a row (W,) that may be peaks: above the least, and no less than both rows beside it."""
    last = level.shape[0] - 1
    a, b, d = level[max(r - FLANK, 0)], level[max(r + 1 - FLANK, 0)], level[min(r + FLANK, last)]
    e, (here, above, below) = level[min(r + 1 + FLANK, last)], around
    border, dark, bright = least
    for c in range(len(out)):
        ground = (a[c] + b[c]) + (d[c] + e[c])
        limit = dark if ground < border else bright
        out[c] = (here[c] > limit) & (here[c] > above[c]) & (here[c] >= below[c])


@kernel
def _beside_the_border(level: Level, r: int, c: int) -> tuple[Any, Any, Any]:
    """Sums of rows r, r + 1 at the image's border, and of the pairs a row before and after, less the inner flank's.

    Beyond the border there is as much as on that flank: the last row, repeated, would be the stripe, and push it out.
    """
    last = level.shape[0] - 1
    near, far = _flanks(level, r, c)
    ground = np.float32(0.5) * (far if r == 0 else near)
    before = level[r - 1, c] - ground if r > 0 else np.float32(0.0)
    first = level[r, c] - ground
    second = level[r + 1, c] - ground if r + 1 <= last else np.float32(0.0)
    after = level[r + 2, c] - ground if r + 2 <= last else np.float32(0.0)
    return before + first, first + second, second + after


@kernel
def _peaks(level: Level, table: NoiseTable, threshold: float, section: IntArray, values: Level, first: IntArray) -> int:
    """Local maxima above the threshold, row by row; counts per section in first[1:]; returns their number.

    values (N, 5): place, response, near, far, noise. Of the response only the rows that a peak is compared with are
    kept.
    """
    rows, columns = level.shape
    dark, step, sigma = table.dark, table.step, table.sigma
    # four times the flanks' mean, a little brighter: no rounding makes one dark that is not
    border = np.float32(4 * table.border * (1 + 1e-6) + 1e-6)
    least = PeakLimits(border, np.float32(threshold * table.below), np.float32(threshold * table.above * (1 - 1e-6)))
    marks = np.zeros((columns + _WORD - 1) // _WORD * _WORD, np.uint8)
    words = marks.view(np.uint64)
    ring = np.full((_RING, columns), -np.inf, np.float32)
    for r in range(min(_APART, rows)):
        _respond(level, r, ring[r])
    n = 0
    for r in range(rows):
        ahead = ring[(r + _APART) % _RING]
        if r + _APART < rows:
            _respond(level, r + _APART, ahead)
        else:
            ahead[:] = -np.inf
        response, above, below = ring[r % _RING], ring[(r - 1) % _RING], ring[(r + 1) % _RING]
        _candidates(level, r, (response, above, below), least, marks[:columns])
        for word in range(len(words)):
            if words[word] == 0:
                continue
            for c in range(word * _WORD, word * _WORD + _WORD):
                if marks[c] == 0:
                    continue
                here = response[c]
                near, far = _flanks(level, r, c)
                ground = np.float32(0.25) * (near + far)
                bright = min(int(math.sqrt(max(float(ground - dark), 0.0)) / step), len(sigma) - 1)
                peak = here > threshold * sigma[bright] and n < len(section)
                for k in range(2, _APART + 1):
                    peak = peak and ring[(r - k) % _RING, c] < here and ring[(r + k) % _RING, c] <= here
                if not peak:
                    continue
                up, middle, down = above[c], here, below[c]
                if r == 0 or r + 2 >= rows:
                    up, middle, down = _beside_the_border(level, r, c)
                bend = 2 * middle - up - down
                shift = 0.5 * (down - up) / bend if bend > 0 else 0.0
                centre = 0.5 * (level[r, c] + level[min(r + 1, rows - 1), c])
                section[n] = c
                values[n, 0], values[n, 1] = r + 0.5 + min(max(shift, -0.5), 0.5), here
                values[n, 2], values[n, 3], values[n, 4] = centre - 0.5 * near, centre - 0.5 * far, sigma[bright]
                first[c + 1] += 1
                n += 1
    return n
