"""The surroundings of each peak, and the shape of the lit region around it: one flood fill a peak, compiled."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from extraction.spots.detect.blur import Image32
from extraction.spots.detect.peaks import PLACE_BITS, Indices
from geometry.compiled import kernel

Array = NDArray[np.float64]
Owner = NDArray[np.int16]

RING_PX = 13  # half side of the square ring around a peak: beyond a blurred spot's 3 σ along, within the next string's
SECTORS = 8  # of a ring: an edge fills three of them
FEWEST_IN_SECTOR = 4  # pixels of a sector that the image's border cuts
MAX_REGION_PX = 6000  # more is a wall or a flood of light: twenty of the largest spots
WHOLE, ESCAPED, JOINED = 0, 1, 2  # states of a region: as it is; too large to follow; runs into a brighter one

# peak: its pixel and value; ring, ring_noise, uneven: level of its surroundings, their spread, and how much one side is
# brighter than the other; area, mean, covariance, length, width: of the region, in px; state: see above
REGION = np.dtype(
    [
        *((name, np.float64) for name in ("peak_u", "peak_v", "top", "ring", "ring_noise", "uneven")),
        *((name, np.float64) for name in ("area", "mean_u", "mean_v", "cov_uu", "cov_uv", "cov_vv", "length", "width")),
        ("state", np.int64),
    ]
)
# pairs of places that Batcher's odd-even merge sort of eight values compares
EXCHANGES = (
    (0, 1), (2, 3), (4, 5), (6, 7), (0, 2), (1, 3), (4, 6), (5, 7), (1, 2), (5, 6), (0, 4), (1, 5), (2, 6), (3, 7),
    (2, 4), (3, 5), (1, 2), (3, 4), (5, 6),
)  # fmt: skip


class RegionRule(NamedTuple):
    """Which peaks get a region, and how far it goes.

    threshold: height over the ring's noise. height_dn: least height. level: share of the height down to which the
    region goes. reach_px: from the peak, beyond which it is not followed. noise_dn: least noise of a ring.
    """

    threshold: float
    height_dn: float
    level: float
    reach_px: float
    noise_dn: float


class Ring(NamedTuple):
    """Level of a peak's surroundings, their spread, and how much one side is brighter than the other [DN]."""

    level: float
    noise: float
    uneven: float


@kernel
def grow_regions(
    smooth: Image32, owner: Owner, peaks: Indices, rings: Indices, rule: RegionRule, table: NDArray[np.void]
) -> None:
    """Fill the table (N,) of REGION in the order of the keys ``peaks``, brightest first; owner (H, W): 1 + its number,
    for every pixel of a region. rings: half side of each peak's ring (N,).
    """
    stack, sectors = np.empty((MAX_REGION_PX + 8, 2), np.int64), np.empty((2, SECTORS))
    for k in range(len(peaks)):
        place = peaks[k] & PLACE_BITS
        j = place // smooth.shape[1]
        i, row = place - j * smooth.shape[1], table[k]
        ring = _ring(smooth, j, i, rings[k], rule.noise_dn, sectors)
        row.peak_u, row.peak_v, row.top = i, j, smooth[j, i]
        row.ring, row.ring_noise, row.uneven = ring.level, ring.noise, ring.uneven
        height = float(smooth[j, i]) - ring.level
        if owner[j, i] > 0:
            row.state = JOINED
        elif height >= rule.threshold * ring.noise and height >= rule.height_dn:
            _grow(smooth, owner, k, row, ring.level + rule.level * height, rule.reach_px, stack)


@kernel(fastmath=True)
def _line_sums(line: Image32, pivot: float) -> tuple[float, float]:
    """Sum and sum of squares of a line of pixels about the pivot."""
    total, square = 0.0, 0.0
    for value in line:
        away = value - pivot
        total += away
        square += away * away
    return total, square


@kernel
def _ring(smooth: Image32, j: int, i: int, half: int, least_noise: float, sectors: Array) -> Ring:
    """Surroundings of a pixel by eight sectors of a square ring around it, its side twice ``half``.

    The level is the brighter side's where an edge passes (third brightest sector); the spread that of the median
    sector, so that an edge or a neighbour in a few sectors does not count as noise. sectors: scratch (2, 8).
    """
    mean, variance, pivot, seen = sectors[0], sectors[1], float(smooth[j, i]), 0
    sectors[:] = np.inf
    rows, columns = smooth.shape
    for k in range(SECTORS):  # half a side each: left and right without the corners, above and below with them
        low, high = (-half, 1) if k % 2 == 0 else (1, half + 1)
        side = half if k % 4 > 1 else -half
        count, total, square = 0, 0.0, 0.0
        if k < 4 and 0 <= i + side < columns:
            low, high = max(low, 1 - half, -j), min(high, half, rows - j)
            count = high - low
            if count >= FEWEST_IN_SECTOR:
                total, square = _line_sums(smooth[j + low : j + high, i + side], pivot)
        elif k >= 4 and 0 <= j + side < rows:
            low, high = max(low, -i), min(high, columns - i)
            count = high - low
            if count >= FEWEST_IN_SECTOR:
                total, square = _line_sums(smooth[j + side, i + low : i + high], pivot)
        if count >= FEWEST_IN_SECTOR:
            mean[seen] = total / count
            variance[seen] = square / count - mean[seen] ** 2
            seen += 1
    if seen == 0:
        return Ring(np.float64(pivot), np.inf, 0.0)
    _sort8(mean)
    _sort8(variance)
    noise = max(math.sqrt(max(variance[(seen - 1) // 2], 0.0)), least_noise)
    return Ring(pivot + mean[(5 * seen) // 8], noise, mean[(6 * seen) // 8] - mean[seen // 8])


@kernel
def _sort8(v: Array) -> None:
    """Sort eight values in place, without a branch that could be foretold wrongly (Batcher's odd-even merge sort)."""
    for low, high in EXCHANGES:
        a, b = v[low], v[high]
        v[low], v[high] = min(a, b), max(a, b)


@kernel
def _grow(smooth: Image32, owner: Owner, k: int, row: Any, level: float, reach: float, stack: Indices) -> None:
    """Flood from the peak down to ``level``; write the region's moments and extents to its record. stack: scratch."""
    rows, columns = smooth.shape
    i0, j0 = int(row.peak_u), int(row.peak_v)
    stack[0, 0], stack[0, 1] = i0, j0
    owner[j0, i0] = k + 1
    size, done, state = 1, 0, WHOLE
    total, by_x, by_y, by_xx, by_xy, by_yy = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    while done < size:
        i, j = stack[done, 0], stack[done, 1]
        done += 1
        x, y, weight = float(i - i0), float(j - j0), float(smooth[j, i]) - level
        total += weight
        by_x += weight * x
        by_y += weight * y
        by_xx += weight * x * x
        by_xy += weight * x * y
        by_yy += weight * y * y
        if abs(x) > reach or abs(y) > reach or size >= MAX_REGION_PX:
            state = ESCAPED
            continue
        for b, a in ((j - 1, i), (j + 1, i), (j, i - 1), (j, i + 1)):
            if 0 <= b < rows and 0 <= a < columns and owner[b, a] != k + 1 and smooth[b, a] > level:
                if owner[b, a] > 0:
                    state = max(state, JOINED) if state != ESCAPED else ESCAPED
                    continue
                owner[b, a] = k + 1
                stack[size, 0], stack[size, 1] = a, b
                size += 1
    total = max(total, 1e-12)
    u, v = by_x / total, by_y / total
    row.area, row.mean_u, row.mean_v, row.state = size, i0 + u, j0 + v, state
    row.cov_uu, row.cov_uv, row.cov_vv = by_xx / total - u * u, by_xy / total - u * v, by_yy / total - v * v
    row.length, row.width = _extents(stack, size, row)


@kernel
def _extents(pixels: Indices, size: int, row: Any) -> tuple[float, float]:
    """Length and width [px] of a region: the extents of its pixels along and across the long axis of its moments."""
    i0, j0 = row.peak_u, row.peak_v
    angle = 0.5 * math.atan2(2.0 * row.cov_uv, row.cov_uu - row.cov_vv)
    cosine, sine = math.cos(angle), math.sin(angle)
    low_a, high_a, low_c, high_c = 0.0, 0.0, 0.0, 0.0
    for n in range(size):
        x, y = pixels[n, 0] - i0, pixels[n, 1] - j0
        along, across = cosine * x + sine * y, cosine * y - sine * x
        low_a, high_a = min(low_a, along), max(high_a, along)
        low_c, high_c = min(low_c, across), max(high_c, across)
    return high_a - low_a + 1.0, high_c - low_c + 1.0
