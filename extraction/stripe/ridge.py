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

from geometry.compiled import kernel

Array = NDArray[np.float64]
Level = NDArray[np.float32]
IntArray = NDArray[np.int32]

FLANK = 3  # rows from the centre to either flank
_APART = 2  # rows on either side that a peak must not fall short of
_SAMPLES = 3_000  # of a level's response, for its noise
_BINS = 12  # of the background's brightness: texture and shot noise grow with it
_FEWEST = 24  # samples of a bin that say something
_LAG = 12  # level pixels along the sections, beyond the correlation of blur and speckle
_ROUGHER = 2.0  # times as rough in proportion, that bright ground may be: beside a stripe its own light is no noise
_BLOCK = 64  # pixels of a row that are looked at together
_QUANTISATION = (
    0.5  # σ of the response to rounding, of whole grey levels over 2 × 2 pixels … at 1 px; less with the level
)


class NoiseTable(NamedTuple):
    """The response's σ by the background's brightness: ``sigma`` (B,) at steps of its root from ``dark``."""

    dark: float
    step: float
    sigma: Array


class Nodes(NamedTuple):
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
    _halve(image, out)
    return out


def find_nodes(level: Level, scale: float, threshold_sigma: float) -> Nodes:
    """Peaks along the columns of a level (H, W) whose response is that many σ. scale: pixels to a level pixel."""
    response, background = np.empty_like(level), np.empty_like(level)
    _respond(level, response, background)
    table = _noise(response, background, _QUANTISATION / scale)
    room = max(level.size // (4 if threshold_sigma < 2 else 8), 64)
    section, place = np.empty(room, np.int32), np.empty(room, np.float32)
    values = np.empty((4, room), np.float32)
    first = np.zeros(level.shape[1] + 1, np.int32)
    found = _peaks(level, response, background, table, threshold_sigma, section, place, values, first)
    order = np.empty(found, np.int32)
    _by_section(section[:found], first, order)
    v = values[:, order]
    return Nodes(section[order], place[order], v[0], v[1], v[2], v[3], first)


@kernel
def _halve(image: NDArray[Any], out: Level) -> None:
    rows, columns = out.shape
    for r in range(rows):
        for c in range(columns):
            total = np.float32(image[2 * r, 2 * c]) + np.float32(image[2 * r, 2 * c + 1])
            total += np.float32(image[2 * r + 1, 2 * c]) + np.float32(image[2 * r + 1, 2 * c + 1])
            out[r, c] = np.float32(0.25) * total


@kernel(fastmath=True)
def _respond(level: Level, response: Level, background: Level) -> None:
    """The second difference of pairs of rows r, r + 1, and the mean of its flanks; rows beyond the border repeat it."""
    rows, columns = level.shape
    half, quarter = np.float32(0.5), np.float32(0.25)
    for r in range(rows):
        a, b = max(r - FLANK, 0), max(r + 1 - FLANK, 0)
        d, e = min(r + FLANK, rows - 1), min(r + 1 + FLANK, rows - 1)
        below = min(r + 1, rows - 1)
        for c in range(columns):
            flanks = quarter * ((level[a, c] + level[b, c]) + (level[d, c] + level[e, c]))
            background[r, c] = flanks
            response[r, c] = half * (level[r, c] + level[below, c]) - flanks


def _noise(response: Level, background: Level, least: float) -> NoiseTable:
    """σ of the response by the background's brightness.

    The least of the robust spread and of that of differences along the sections: in a region that is mostly stripe the
    first is the stripe's own.
    """
    sigma = np.empty(_BINS)
    dark, width = _noise_by_brightness(response, background, least, sigma)
    return NoiseTable(dark, width, sigma)


@kernel
def _noise_by_brightness(response: Level, background: Level, least: float, sigma: Array) -> tuple[float, float]:
    """Fill ``sigma`` (B,); returns the background's least grey level and the bins' width in its root."""
    rows, columns = response.shape
    lag = min(_LAG, max(columns // 4, 1))
    step = max(1, int(math.sqrt(response.size / _SAMPLES)))
    wide = max(columns - lag, 1)
    most = ((rows - 1) // step + 1) * ((wide - 1) // step + 1)
    value, change, ground = np.empty(most, np.float32), np.empty(most, np.float32), np.empty(most, np.float32)
    n, dark, light = 0, np.inf, -np.inf
    for r in range(0, rows, step):
        for c in range((r // step) % step, wide, step):
            value[n], ground[n] = response[r, c], background[r, c]
            change[n] = response[r, min(c + lag, columns - 1)] - response[r, c]
            dark, light = min(dark, float(ground[n])), max(light, float(ground[n]))
            n += 1
    width = math.sqrt(max(light - dark, 1.0)) / _BINS
    counts, bins = np.zeros(_BINS, np.int64), np.empty(n, np.int64)
    for i in range(n):
        bins[i] = min(int(math.sqrt(ground[i] - dark) / width), _BINS - 1)
        counts[bins[i]] += 1
    own, bulk, known = np.empty(n, np.float32), 0, -1
    for k in range(_BINS):
        sigma[k] = np.nan
        if counts[k] > counts[bulk]:
            bulk = k
        if counts[k] < _FEWEST:
            continue
        m = 0
        for i in range(n):
            if bins[i] == k:
                own[m] = value[i]
                m += 1
        middle = np.median(own[:m])
        for j in range(m):
            own[j] = abs(own[j] - middle)
        spread, m = float(np.median(own[:m])), 0
        for i in range(n):
            if bins[i] == k:
                own[m] = abs(change[i])
                m += 1
        sigma[k] = max(1.4826 * min(spread, float(np.median(own[:m])) / math.sqrt(2)), least)
        for j in range(known + 1, k):  # bins between two known ones, or before the first
            t = (j - known) / (k - known)
            sigma[j] = sigma[k] if known < 0 else (1 - t) * sigma[known] + t * sigma[k]
        known = k
    for j in range(known + 1, _BINS):
        sigma[j] = sigma[known] if known >= 0 else max(least, float(np.std(value[:n])))
    # what most of the image is: brighter ground may be as rough in proportion, and some
    level = dark + ((bulk + 0.5) * width) ** 2
    for k in range(_BINS):
        here = dark + ((k + 0.5) * width) ** 2
        sigma[k] = min(sigma[k], max(_ROUGHER * sigma[bulk] * here / max(level, 1.0), sigma[bulk]))
    return dark, width


@kernel
def _peaks(
    level: Level, response: Level, background: Level, table: NoiseTable, threshold: float,
    section: IntArray, where: Level, values: Level, first: IntArray,
) -> int:  # fmt: skip
    """Local maxima above the threshold, row by row; counts per section in first[1:]; returns their number."""
    rows, columns = response.shape
    least = np.float32(threshold * table.sigma.min())
    n = 0
    for place in range(rows * ((columns - 1) // _BLOCK + 1)):
        r, start = place // ((columns - 1) // _BLOCK + 1), place % ((columns - 1) // _BLOCK + 1) * _BLOCK
        stop = min(start + _BLOCK, columns)
        largest = response[r, start]
        for c in range(start, stop):
            largest = max(largest, response[r, c])
        if largest <= least:
            continue
        for c in range(start, stop):
            here = response[r, c]
            if here <= least:
                continue
            if (r > 0 and response[r - 1, c] >= here) or (r + 1 < rows and response[r + 1, c] > here):
                continue
            bright = min(int(np.sqrt(max(background[r, c] - table.dark, 0.0)) / table.step), len(table.sigma) - 1)
            if here <= threshold * table.sigma[bright] or n >= len(section):
                continue
            peak = True
            for k in range(max(r - _APART, 0), r):
                peak = peak and response[k, c] < here
            for k in range(r + 1, min(r + _APART + 1, rows)):
                peak = peak and response[k, c] <= here
            if not peak:
                continue
            up, down = response[max(r - 1, 0), c], response[min(r + 1, rows - 1), c]
            bend = 2 * here - up - down
            shift = 0.5 * (down - up) / bend if bend > 0 else 0.0
            centre = 0.5 * (level[r, c] + level[min(r + 1, rows - 1), c])
            near = 0.5 * (level[max(r - FLANK, 0), c] + level[max(r + 1 - FLANK, 0), c])
            far = 0.5 * (level[min(r + FLANK, rows - 1), c] + level[min(r + 1 + FLANK, rows - 1), c])
            section[n], where[n] = c, r + 0.5 + min(max(shift, -0.5), 0.5)
            values[0, n], values[1, n], values[2, n], values[3, n] = (
                here,
                centre - near,
                centre - far,
                table.sigma[bright],
            )
            first[c + 1] += 1
            n += 1
    return n


@kernel
def _by_section(section: IntArray, first: IntArray, order: IntArray) -> None:
    """Stable counting sort; ``first`` becomes the sections' starts."""
    for c in range(1, len(first)):
        first[c] += first[c - 1]
    at = first[:-1].copy()
    for i in range(len(section)):
        order[at[section[i]]] = i
        at[section[i]] += 1
