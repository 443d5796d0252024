"""SectionPeaks of a stripe: centre minus the brighter surround, in pairs of rows, above the frame's own noise."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from geometry.compiled import kernel

IntArray = NDArray[np.int32]

_SAMPLES = 8000  # of the response, for its robust spread
_PIXELS_SUMMED = 12  # pixels in a response's centre: 4 rows × 3 columns


@dataclass(frozen=True, eq=False)
class SectionPeaks:
    """SectionPlaces to fit, grouped by section and ordered along it.

    section: index of the image column (N,). centre_px: middle of the detection window along it (N,).
    low, high: the half-open range of rows that is this peak's own (N,): it ends midway to its neighbours.
    threshold_dn, noise_dn: of the mean response, centre minus surround.
    """

    section: IntArray
    centre_px: NDArray[np.float64]
    low: IntArray
    high: IntArray
    threshold_dn: float
    noise_dn: float

    def __len__(self) -> int:
        """The number of candidates."""
        return len(self.section)

    def take(self, chosen: NDArray[np.intp]) -> SectionPeaks:
        """The chosen candidates."""
        low, high = self.low[chosen], self.high[chosen]
        return SectionPeaks(self.section[chosen], self.centre_px[chosen], low, high, self.threshold_dn, self.noise_dn)


def detect(image: NDArray[np.generic], threshold_sigma: float, surround_px: int, max_peaks: int) -> SectionPeaks:
    """Peaks along the columns of ``image`` (H, W) integer: a stripe that runs from left to right, several a column.

    The response is the mean over 4 rows × 3 columns minus that of the brighter of the two surrounds at
    ``surround_px``: a step edge does not respond. The threshold is ``threshold_sigma`` robust σ above the
    response's median, quantisation included.
    """
    height, width = image.shape
    if height < 8 or width < 3:
        return _group(np.zeros((0, 3), dtype=np.int32), 0.0, 0.0, height)
    scratch = np.int16 if image.dtype == np.uint8 else np.int32
    sums = np.empty((height // 2 - 1, width), dtype=scratch)
    response = np.empty_like(sums)
    _sum_windows(image, sums)
    _subtract_surround(sums, max(2, surround_px // 2), response)
    sample = response[:: response.size // _SAMPLES // 16 + 1, width // 2 % 16 :: 16].ravel()
    middle = _median(sample)
    spread = max(1.4826 * _median(np.abs(sample - sample.dtype.type(middle))), float(np.sqrt(2 * _PIXELS_SUMMED / 12)))
    threshold = max(middle, 0.0) + threshold_sigma * spread
    found = np.empty((width, max_peaks, 2), dtype=np.int32)
    counts = _peaks(response, threshold, found)
    return _group(_flatten(found, counts), threshold / _PIXELS_SUMMED, spread / _PIXELS_SUMMED, height)


def _median(values: IntArray) -> float:
    middle = len(values) // 2
    return float(np.partition(values, middle)[middle])


def _group(peaks: IntArray, threshold: float, noise: float, height: int) -> SectionPeaks:
    """SectionPeaks of (section, window, response) rows ordered by section, then window."""
    section = np.ascontiguousarray(peaks[:, 0])
    centre = 2 * peaks[:, 1].astype(np.float64) + 1.5
    low, high = np.zeros(len(peaks), dtype=np.int32), np.full(len(peaks), height, dtype=np.int32)
    same = section[1:] == section[:-1]
    middle = np.ceil((centre[1:] + centre[:-1]) / 2).astype(np.int32)
    low[1:][same], high[:-1][same] = middle[same], middle[same]
    return SectionPeaks(section, centre, low, high, threshold, noise)


@kernel
def _sum_windows(image: NDArray[np.generic], sums: IntArray) -> None:
    """Sums over rows 2r … 2r + 3 and columns c - 1 … c + 1; the first and last column take their neighbour's."""
    rows, columns = sums.shape
    pairs = np.empty_like(sums)
    for r in range(rows):
        for c in range(columns):
            pairs[r, c] = image[2 * r, c] + image[2 * r + 1, c] + image[2 * r + 2, c] + image[2 * r + 3, c]
        for c in range(1, columns - 1):
            sums[r, c] = pairs[r, c - 1] + pairs[r, c] + pairs[r, c + 1]
        sums[r, 0], sums[r, columns - 1] = sums[r, 1], sums[r, columns - 2]


@kernel
def _subtract_surround(sums: IntArray, distance: int, response: IntArray) -> None:
    rows, columns = sums.shape
    for r in range(rows):
        above, below = max(r - distance, 0), min(r + distance, rows - 1)
        for c in range(columns):
            response[r, c] = sums[r, c] - max(sums[above, c], sums[below, c])


@kernel
def _peaks(response: IntArray, threshold: float, found: IntArray) -> IntArray:
    """Local maxima above the threshold: (window, response) per column (W, K, 2), strongest K; returns their number."""
    rows, columns = response.shape
    counts = np.zeros(columns, dtype=np.int32)
    block = 64
    for r in range(rows):
        for start in range(0, columns, block):
            stop = min(start + block, columns)
            largest = response[r, start]
            for c in range(start, stop):
                largest = max(largest, response[r, c])
            if largest > threshold:
                for c in range(start, stop):
                    if response[r, c] > threshold and _is_peak(response, r, c):
                        _keep(found, counts, c, r, response[r, c])
    return counts


@kernel
def _is_peak(response: IntArray, r: int, c: int) -> bool:
    """Whether no window within two (four rows) answers more; of equals the first."""
    here = response[r, c]
    for k in range(max(r - 2, 0), r):
        if response[k, c] >= here:
            return False
    answer = True
    for k in range(r + 1, min(r + 3, len(response))):
        answer = answer and response[k, c] <= here
    return answer


@kernel
def _keep(found: IntArray, counts: IntArray, c: int, row: int, response: int) -> None:
    """Append a peak to column ``c``; where the column is full the weakest goes."""
    n = counts[c]
    if n == found.shape[1]:
        weakest = 0
        for k in range(1, n):
            if found[c, k, 1] < found[c, weakest, 1]:
                weakest = k
        if found[c, weakest, 1] >= response:
            return
        for k in range(weakest, n - 1):
            found[c, k, 0], found[c, k, 1] = found[c, k + 1, 0], found[c, k + 1, 1]
        n -= 1
    found[c, n, 0], found[c, n, 1] = row, response
    counts[c] = n + 1


@kernel
def _flatten(found: IntArray, counts: IntArray) -> IntArray:
    total = 0
    for c in range(len(counts)):
        total += counts[c]
    out, n = np.empty((total, 3), dtype=np.int32), 0
    for c in range(len(counts)):
        for k in range(counts[c]):
            out[n, 0], out[n, 1], out[n, 2] = c, found[c, k, 0], found[c, k, 1]
            n += 1
    return out
