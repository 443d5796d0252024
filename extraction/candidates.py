"""Candidates for string spots: peaks that stand above their surroundings, and the shape of the region around each."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from extraction.blur import BLOCK_PX, Image32
from extraction.compiled import compiled, inner, inner_fast
from extraction.config import DetectConfig
from extraction.preprocess import Prepared

Array = NDArray[np.float64]
Indices = NDArray[np.int64]

RING_PX = 13  # half side of the square ring whose median is a peak's background
PEAK_RADIUS_PX = 2
MAX_REGION_PX = 6000
USUAL_PEAKS, MAX_PEAKS = 4_000, 200_000  # room for peaks: at first, at most

# rows of the region table
PEAK_U, PEAK_V, SMOOTH_PEAK, RING, RING_NOISE, UNEVEN = range(6)
AREA, MEAN_U, MEAN_V, COV_UU, COV_UV, COV_VV, LENGTH, WIDTH, STATE = range(6, 15)
COLUMNS = 15
# values of STATE
WHOLE, ESCAPED, JOINED = 0, 1, 2


@dataclass(frozen=True, eq=False)
class Candidates:
    """Peaks of the blurred image, brightest first, and why each was refused ("" while it stands).

    peak_uv_px: brightest pixel (N, 2). height_dn: over its surroundings; ring_dn, ring_noise_dn, uneven_dn: those,
    their spread, and how much one side is brighter than the other (N,).
    mean_uv_px, cov_uv_px2: moments (N, 2), (N, 2, 2) of the region above `region_level` of the height.
    area_px, length_px, width_px: of that region, along and across its long axis (N,).
    owner: 1 + index of the candidate whose region a pixel belongs to, 0 for none (H, W).
    """

    peak_uv_px: Array
    height_dn: Array
    ring_dn: Array
    ring_noise_dn: Array
    uneven_dn: Array
    mean_uv_px: Array
    cov_uv_px2: Array
    area_px: Array
    length_px: Array
    width_px: Array
    reason: tuple[str, ...]
    owner: NDArray[np.int16]

    def __len__(self) -> int:
        """The number of candidates, refused ones included."""
        return len(self.reason)

    def refused(self, index: NDArray[np.intp], reasons: NDArray[np.object_]) -> Candidates:
        """The same, with the reasons of the candidates ``index`` (N,) replaced by ``reasons`` (N,)."""
        every = np.array(self.reason, dtype=object)
        every[index] = reasons
        return replace(self, reason=tuple(every))


def find_candidates(prepared: Prepared, config: DetectConfig, mm_per_px: float) -> Candidates:
    """Peaks above the noise, with the shape of their regions and the reason of each refusal.

    mm_per_px: scale of the laser sheet in the image, for the limits of size that are given in mm.
    """
    peaks = _all_peaks(prepared, config.threshold)
    u, v = peaks.T
    order = np.lexsort((u, v, -prepared.smooth[v, u]))[: config.max_candidates]  # equal ones in reading order
    length = max(config.min_length_px, config.max_length_mm / mm_per_px)
    width = max(config.min_width_px, config.max_width_mm / mm_per_px)
    least = max(config.min_height_dn, 0.0)
    owner = np.zeros(prepared.smooth.shape, np.int16)  # pages that no region touches stay unwritten
    table = _regions(
        prepared.smooth,
        owner,
        peaks[order],
        config.threshold,
        least,
        config.region_level,
        length,
        float(prepared.noise.min()),
    )
    reasons = _reasons(table, config, length, width)
    cov = table[:, [COV_UU, COV_UV, COV_UV, COV_VV]].reshape(-1, 2, 2)
    return Candidates(
        table[:, [PEAK_U, PEAK_V]], table[:, SMOOTH_PEAK] - table[:, RING], table[:, RING], table[:, RING_NOISE],
        table[:, UNEVEN], table[:, [MEAN_U, MEAN_V]], cov, table[:, AREA], table[:, LENGTH], table[:, WIDTH], reasons,
        owner,
    )  # fmt: skip


def _all_peaks(prepared: Prepared, threshold: float) -> Indices:
    """The peaks (N, 2): columns, rows; at most MAX_PEAKS."""
    for most in (USUAL_PEAKS, MAX_PEAKS):
        peaks = np.empty((most, 2), np.int64)
        count = _peaks(
            prepared.smooth, prepared.tops, prepared.background, prepared.noise, threshold, PEAK_RADIUS_PX, peaks
        )
        if count < most:
            break
    return peaks[:count]


def _reasons(table: Array, config: DetectConfig, length_px: float, width_px: float) -> tuple[str, ...]:
    """Why each peak is refused, "" where it is not."""
    height = table[:, SMOOTH_PEAK] - table[:, RING]
    reasons = np.full(len(table), "", dtype=object)
    reasons[table[:, WIDTH] > width_px] = "too_wide"
    reasons[(table[:, LENGTH] > length_px) | (table[:, STATE] == ESCAPED)] = "too_long"
    reasons[table[:, STATE] == JOINED] = "part_of_brighter"
    reasons[height < config.min_height_dn] = "too_faint"
    reasons[height < config.threshold * table[:, RING_NOISE]] = "in_the_noise"
    return tuple(reasons)


@compiled
def _peaks(
    smooth: Image32,
    tops: Image32,
    background: Image32,
    noise: Image32,
    threshold: float,
    radius: int,
    out: Indices,
) -> int:
    """Write to ``out`` (M, 2) the pixels that are the largest within ``radius`` and stand threshold · noise above the
    background; returns their number. tops: as in `Blurred`.
    """
    rows, columns = smooth.shape
    h, w = background.shape
    count, marks = 0, np.empty(2 * BLOCK_PX, np.uint8)
    for bj in range(h):
        first, last = bj * BLOCK_PX, rows if bj == h - 1 else (bj + 1) * BLOCK_PX
        for bi in range(w):
            limit = background[bj, bi] + threshold * noise[bj, bi]
            start, end = bi * BLOCK_PX, columns if bi == w - 1 else (bi + 1) * BLOCK_PX
            if not _above(tops[bj, start:end], limit):
                continue
            for j in range(first, last):
                here, above, below = smooth[j, start:end], smooth[max(j - 1, 0)], smooth[min(j + 1, rows - 1)]
                above, below = above[start:end], below[start:end]
                left, right = smooth[j, max(start - 1, 0) :], smooth[j, min(start + 1, columns - 1) :]
                some, inside = False, start > 0 and end < columns
                for i in range(end - start):  # no branch: for the vector unit
                    value = here[i]
                    mark = (value > limit) & (value >= above[i]) & (value >= below[i])
                    mark &= (value >= left[i]) & (value >= right[i]) if inside else True
                    marks[i] = mark
                    some |= mark
                for i in range(end - start if some else 0):
                    if marks[i] and count < len(out) and _is_peak(smooth, j, start + i, radius):
                        out[count] = start + i, j
                        count += 1
    return count


@inner
def _above(values: Image32, limit: float) -> bool:
    """Whether any value is above the limit."""
    some = False
    for value in values:
        some |= value > limit
    return some


@inner
def _is_peak(smooth: Image32, j: int, i: int, radius: int) -> bool:
    """Whether no pixel within ``radius`` is larger; of equal ones the first in reading order counts."""
    rows, columns = smooth.shape
    here = smooth[j, i]
    for y in range(max(0, j - radius), min(rows, j + radius + 1)):
        for x in range(max(0, i - radius), min(columns, i + radius + 1)):
            other = smooth[y, x]
            if other > here or (other == here and (y < j or (y == j and x < i))):
                return False
    return True


@inner_fast
def _box_sums(smooth: Image32, box: tuple[int, int, int, int], pivot: float) -> tuple[float, float, float]:
    """Sum and sum of squares about the pivot, and number of the pixels of the box (both ends) that the image has."""
    total, square = 0.0, 0.0
    top, bottom = max(0, box[0]), min(len(smooth), box[1] + 1)
    left, right = max(0, box[2]), min(smooth.shape[1], box[3] + 1)
    for y in range(top, bottom):
        for x in range(left, right):
            value = smooth[y, x] - pivot
            total += value
            square += value * value
    return total, square, float(max(bottom - top, 0) * max(right - left, 0))


@inner
def _ring(smooth: Image32, j: int, i: int, radius: int, least_noise: float, sectors: Array, row: Array) -> None:
    """Background, its spread and its unevenness from eight sectors of a square ring around the pixel.

    The background is the brighter side's where an edge passes (third brightest sector); the spread that of the median
    sector, so that an edge or a neighbour in a few sectors does not count as noise. sectors: scratch (2, 8).
    """
    mean, spread = sectors[0], sectors[1]
    pivot, seen = smooth[j, i], 0
    for k in range(8):  # half a side each: left and right without the corners, above and below with them
        low, high = (-radius, 0) if k % 2 == 0 else (1, radius)
        side = radius if k % 4 > 1 else -radius
        if k < 4:
            low, high = max(low, 1 - radius), min(high, radius - 1)
            box = (j + low, j + high, i + side, i + side)
        else:
            box = (j + side, j + side, i + low, i + high)
        total, square, count = _box_sums(smooth, box, pivot)
        if count > 3.0:
            mean[seen] = total / count
            spread[seen] = np.sqrt(max(square / count - mean[seen] ** 2, 0.0))
            seen += 1
    if seen == 0:
        row[RING], row[RING_NOISE] = pivot, np.inf
        return
    _sort(mean, seen)
    _sort(spread, seen)
    row[RING] = pivot + mean[(5 * seen) // 8]
    row[RING_NOISE] = max(spread[(seen - 1) // 2], least_noise)
    row[UNEVEN] = mean[(6 * seen) // 8] - mean[seen // 8]


@inner
def _sort(values: Array, count: int) -> None:
    """Sort the leading ``count`` values in place; there are eight at most."""
    for k in range(1, count):
        value, at = values[k], k
        while at > 0 and values[at - 1] > value:
            values[at] = values[at - 1]
            at -= 1
        values[at] = value


@compiled
def _regions(
    smooth: Image32,
    owner: NDArray[np.int16],
    peaks: NDArray[np.int64],
    threshold: float,
    least: float,
    level: float,
    length: float,
    noise: float,
) -> Array:
    """The region table (N, COLUMNS), in the order of ``peaks`` (brightest first)."""
    stack = np.empty((MAX_REGION_PX + 8, 2), np.int64)
    table, sectors = np.zeros((len(peaks), COLUMNS)), np.empty((2, 8))
    for k in range(len(peaks)):
        i, j = peaks[k, 0], peaks[k, 1]
        row = table[k]
        row[PEAK_U], row[PEAK_V], row[SMOOTH_PEAK] = i, j, smooth[j, i]
        _ring(smooth, j, i, RING_PX, noise, sectors, row)
        height = row[SMOOTH_PEAK] - row[RING]
        if owner[j, i] > 0:
            row[STATE] = JOINED
        elif height >= threshold * row[RING_NOISE] and height >= least:
            _grow(smooth, owner, stack, k, row, row[RING] + level * height, 2.0 * length)
    return table


@inner
def _grow(
    smooth: Image32, owner: NDArray[np.int16], stack: NDArray[np.int64], k: int, row: Array, level: float, reach: float
) -> None:
    """Flood from the peak down to ``level``; write the region's moments and extents to its row of the table."""
    rows, columns = smooth.shape
    i0, j0 = int(row[PEAK_U]), int(row[PEAK_V])
    stack[0, 0], stack[0, 1] = i0, j0
    owner[j0, i0] = k + 1
    size, done, state = 1, 0, WHOLE
    sums = np.zeros(6)
    while done < size:
        i, j = stack[done, 0], stack[done, 1]
        done += 1
        x, y, weight = float(i - i0), float(j - j0), float(smooth[j, i]) - level
        sums[0] += weight
        sums[1] += weight * x
        sums[2] += weight * y
        sums[3] += weight * x * x
        sums[4] += weight * x * y
        sums[5] += weight * y * y
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
    _shape(stack, size, sums, row)
    row[STATE] = state


@inner
def _shape(pixels: NDArray[np.int64], size: int, sums: Array, row: Array) -> None:
    """Moments from their sums, and the extents of the pixels along and across the long axis."""
    i0, j0 = row[PEAK_U], row[PEAK_V]
    total = max(sums[0], 1e-12)
    u, v = sums[1] / total, sums[2] / total
    uu, uv, vv = sums[3] / total - u * u, sums[4] / total - u * v, sums[5] / total - v * v
    row[AREA], row[MEAN_U], row[MEAN_V] = size, i0 + u, j0 + v
    row[COV_UU], row[COV_UV], row[COV_VV] = uu, uv, vv
    angle = 0.5 * np.arctan2(2.0 * uv, uu - vv)
    cosine, sine = np.cos(angle), np.sin(angle)
    low_a, high_a, low_c, high_c = 0.0, 0.0, 0.0, 0.0
    for n in range(size):
        x, y = pixels[n, 0] - i0, pixels[n, 1] - j0
        along, across = cosine * x + sine * y, cosine * y - sine * x
        low_a, high_a = min(low_a, along), max(high_a, along)
        low_c, high_c = min(low_c, across), max(high_c, across)
    row[LENGTH], row[WIDTH] = high_a - low_a + 1.0, high_c - low_c + 1.0
