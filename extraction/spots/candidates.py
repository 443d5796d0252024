"""Candidates for string spots: peaks that stand above their surroundings, and the shape of the region around each."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from extraction.config import DetectConfig
from extraction.reasons import Reason
from extraction.spots.blur import BLOCK_PX, Image32
from extraction.spots.prepare import Prepared
from geometry.compiled import kernel

Array = NDArray[np.float64]
Indices = NDArray[np.int64]
Marks = NDArray[np.uint8]

RING_PX = 13  # half side of the square ring whose median is a peak's background
PEAK_RADIUS_PX = 2
MAX_REGION_PX = 6000
USUAL_PEAKS, MAX_PEAKS = 4_000, 200_000  # room for peaks: at first, at most

# rows of the region table
PEAK_U, PEAK_V, SMOOTH_PEAK, RING, RING_NOISE, UNEVEN = range(6)
AREA, MEAN_U, MEAN_V, COV_UU, COV_UV, COV_VU, COV_VV, LENGTH, WIDTH, STATE = range(6, 16)
COLUMNS = 16
# values of STATE
WHOLE, ESCAPED, JOINED = 0, 1, 2

# what `refusal` counts; a later one hides the others
REASONS = (
    "",
    Reason.TOO_WIDE,
    Reason.TOO_LONG,
    Reason.PART_OF_BRIGHTER,
    Reason.TOO_FAINT,
    Reason.IN_THE_NOISE,
)
# pairs of places that Batcher's odd-even merge sort of eight values compares
EXCHANGES = (
    (0, 1), (2, 3), (4, 5), (6, 7), (0, 2), (1, 3), (4, 6), (5, 7), (1, 2), (5, 6), (0, 4), (1, 5), (2, 6), (3, 7),
    (2, 4), (3, 5), (1, 2), (3, 4), (5, 6),
)  # fmt: skip
PLACE = 2**32 - 1  # bits of a peak's key that hold its place in reading order


@dataclass(frozen=True, eq=False)
class Candidates:
    """Peaks of the blurred image, brightest first, and why each was refused ("" while it stands).

    peak_uv_px: brightest pixel (N, 2). height_dn: over its surroundings; ring_dn, ring_noise_dn, uneven_dn: those,
    their spread, and how much one side is brighter than the other (N,).
    mean_uv_px, cov_uv_px2: moments (N, 2), (N, 2, 2) of the region above `region_level` of the height.
    area_px, length_px, width_px: of that region, along and across its long axis (N,).
    refusal: place in REASONS (N,). later: reason of those that were refused after they were localised.
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
    refusal: NDArray[np.uint8]
    owner: NDArray[np.int16]
    later: Mapping[int, str] = field(default_factory=dict)

    def __len__(self) -> int:
        """The number of candidates, refused ones included."""
        return len(self.refusal)

    @cached_property
    def reason(self) -> tuple[str, ...]:
        """Why each was refused (N,), "" while it stands."""
        return tuple(self.later.get(k, REASONS[code]) for k, code in enumerate(self.refusal))

    def refused(self, index: NDArray[np.intp], reasons: NDArray[np.object_]) -> Candidates:
        """The same, with the reasons of the candidates ``index`` (N,) replaced by ``reasons`` (N,)."""
        return replace(self, later={**self.later, **dict(zip(index.tolist(), reasons, strict=True))})


def find_candidates(prepared: Prepared, config: DetectConfig, mm_per_px: float) -> Candidates:
    """Peaks above the noise, with the shape of their regions and the reason of each refusal.

    mm_per_px: scale of the laser sheet in the image, for the limits of size that are given in mm.
    """
    peaks = np.sort(_all_peaks(prepared, config.threshold))[: config.max_candidates]
    length = max(config.min_length_px, config.max_length_mm / mm_per_px)
    width = max(config.min_width_px, config.max_width_mm / mm_per_px)
    least = max(config.min_height_dn, 0.0)
    owner = np.zeros(prepared.smooth.shape, np.int16)  # pages that no region touches stay unwritten
    noise = float(prepared.noise.min())
    table = _regions(prepared.smooth, owner, peaks, config.threshold, least, config.region_level, length, noise)
    height = table[:, SMOOTH_PEAK] - table[:, RING]
    return Candidates(
        table[:, PEAK_U : PEAK_V + 1], height, table[:, RING], table[:, RING_NOISE], table[:, UNEVEN],
        table[:, MEAN_U : MEAN_V + 1], table[:, COV_UU : COV_VV + 1].reshape(-1, 2, 2), table[:, AREA],
        table[:, LENGTH], table[:, WIDTH], _refusals(table, height, config, length, width), owner,
    )  # fmt: skip


def _all_peaks(prepared: Prepared, threshold: float) -> Indices:
    """The peaks' keys (N,), at most MAX_PEAKS: the smaller the brighter, of equal ones first in reading order."""
    for most in (USUAL_PEAKS, MAX_PEAKS):
        keys = np.empty(most, np.int64)
        count = _peaks(
            prepared.smooth, prepared.tops, prepared.background, prepared.noise, threshold, PEAK_RADIUS_PX, keys
        )
        if count < most:
            break
    return keys[:count]


def _refusals(
    table: Array, height: Array, config: DetectConfig, length_px: float, width_px: float
) -> NDArray[np.uint8]:
    """Why each peak is refused: its place in REASONS."""
    state = table[:, STATE]
    codes = np.zeros(len(table), np.uint8)
    codes[table[:, WIDTH] > width_px] = REASONS.index(Reason.TOO_WIDE)
    codes[(table[:, LENGTH] > length_px) | (state == ESCAPED)] = REASONS.index(Reason.TOO_LONG)
    codes[state == JOINED] = REASONS.index(Reason.PART_OF_BRIGHTER)
    codes[height < config.min_height_dn] = REASONS.index(Reason.TOO_FAINT)
    codes[height < config.threshold * table[:, RING_NOISE]] = REASONS.index(Reason.IN_THE_NOISE)
    return codes


@kernel
def _peaks(
    smooth: Image32,
    tops: Image32,
    background: Image32,
    noise: Image32,
    threshold: float,
    radius: int,
    keys: Indices,
) -> int:
    """Write to ``keys`` (M,) the pixels that are the largest within ``radius`` and stand threshold · noise above the
    background; returns their number. tops: as in `Blurred`.
    """
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
            least = np.float32(limits[begin:end].min() * (1.0 - 1e-6))  # not above the limits themselves
            left, right = begin * BLOCK_PX, columns if end == w else end * BLOCK_PX
            for j in range(first, last):
                _mark(smooth, j, left, right, least, marks)
                for eight in range(left // 8, (right + 7) // 8):
                    if eights[eight] == 0:
                        continue
                    for i in range(8 * eight, min(8 * eight + 8, right)):
                        limit = limits[min(i // BLOCK_PX, w - 1)]
                        if marks[i] and smooth[j, i] > limit and count < len(keys) and _is_peak(smooth, j, i, radius):
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
def _ring(smooth: Image32, j: int, i: int, radius: int, least_noise: float, sectors: Array, row: Array) -> None:
    """Background, its spread and its unevenness from eight sectors of a square ring around the pixel.

    The background is the brighter side's where an edge passes (third brightest sector); the spread that of the median
    sector, so that an edge or a neighbour in a few sectors does not count as noise. sectors: scratch (2, 8).
    """
    mean, variance, pivot, seen = sectors[0], sectors[1], float(smooth[j, i]), 0
    sectors[:] = np.inf
    rows, columns = smooth.shape
    for k in range(8):  # half a side each: left and right without the corners, above and below with them
        low, high = (-radius, 1) if k % 2 == 0 else (1, radius + 1)
        side = radius if k % 4 > 1 else -radius
        if k < 4 and 0 <= i + side < columns:
            low, high = max(low, 1 - radius, -j), min(high, radius, rows - j)
            count = high - low
            total, square = _line_sums(smooth[j + low : j + high, i + side], pivot) if count > 3 else (0.0, 0.0)
        elif k >= 4 and 0 <= j + side < rows:
            low, high = max(low, -i), min(high, columns - i)
            count = high - low
            total, square = _line_sums(smooth[j + side, i + low : i + high], pivot) if count > 3 else (0.0, 0.0)
        else:
            count = 0
        if count > 3:
            mean[seen] = total / count
            variance[seen] = square / count - mean[seen] ** 2
            seen += 1
    if seen == 0:
        row[RING], row[RING_NOISE] = pivot, np.inf
        return
    _sort8(mean)
    _sort8(variance)
    row[RING] = pivot + mean[(5 * seen) // 8]
    row[RING_NOISE] = max(np.sqrt(max(variance[(seen - 1) // 2], 0.0)), least_noise)
    row[UNEVEN] = mean[(6 * seen) // 8] - mean[seen // 8]


@kernel
def _sort8(v: Array) -> None:
    """Sort eight values in place, without a branch that could be foretold wrongly (Batcher's odd-even merge sort)."""
    for low, high in EXCHANGES:
        a, b = v[low], v[high]
        v[low], v[high] = min(a, b), max(a, b)


@kernel
def _regions(
    smooth: Image32,
    owner: NDArray[np.int16],
    peaks: Indices,
    threshold: float,
    least: float,
    level: float,
    length: float,
    noise: float,
) -> Array:
    """The region table (N, COLUMNS), in the order of the keys ``peaks`` (brightest first)."""
    stack = np.empty((MAX_REGION_PX + 8, 2), np.int64)
    table, sectors = np.zeros((len(peaks), COLUMNS)), np.empty((2, 8))
    for k in range(len(peaks)):
        place = peaks[k] & PLACE
        j = place // smooth.shape[1]
        i, row = place - j * smooth.shape[1], table[k]
        row[PEAK_U], row[PEAK_V], row[SMOOTH_PEAK] = i, j, smooth[j, i]
        _ring(smooth, j, i, RING_PX, noise, sectors, row)
        height = row[SMOOTH_PEAK] - row[RING]
        if owner[j, i] > 0:
            row[STATE] = JOINED
        elif height >= threshold * row[RING_NOISE] and height >= least:
            _grow(smooth, owner, stack, k, row, row[RING] + level * height, 2.0 * length)
    return table


@kernel
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


@kernel
def _shape(pixels: NDArray[np.int64], size: int, sums: Array, row: Array) -> None:
    """Moments from their sums, and the extents of the pixels along and across the long axis."""
    i0, j0 = row[PEAK_U], row[PEAK_V]
    total = max(sums[0], 1e-12)
    u, v = sums[1] / total, sums[2] / total
    uu, uv, vv = sums[3] / total - u * u, sums[4] / total - u * v, sums[5] / total - v * v
    row[AREA], row[MEAN_U], row[MEAN_V] = size, i0 + u, j0 + v
    row[COV_UU], row[COV_UV], row[COV_VU], row[COV_VV] = uu, uv, uv, vv
    angle = 0.5 * np.arctan2(2.0 * uv, uu - vv)
    cosine, sine = np.cos(angle), np.sin(angle)
    low_a, high_a, low_c, high_c = 0.0, 0.0, 0.0, 0.0
    for n in range(size):
        x, y = pixels[n, 0] - i0, pixels[n, 1] - j0
        along, across = cosine * x + sine * y, cosine * y - sine * x
        low_a, high_a = min(low_a, along), max(high_a, along)
        low_c, high_c = min(low_c, across), max(high_c, across)
    row[LENGTH], row[WIDTH] = high_a - low_a + 1.0, high_c - low_c + 1.0
