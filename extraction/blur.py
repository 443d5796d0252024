"""The matched blur, and on the same pass over memory what detection wants to know of it: block moments, column tops."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from extraction.compiled import compiled_fast, inner_fast

Array = NDArray[np.float64]
Image32 = NDArray[np.float32]

BLOCK_PX = 16  # background and noise are constant over such a block and interpolated between
ROW_STEP = 4  # rows of a block that its moments are taken from
RADIUS_IN_SIGMA = 2.4
RADIUS_PX = 4  # of the kernel that is compiled; others are OpenCV's
UNIT = 256  # the compiled kernel's weights are whole numbers of this sum: exact in 16 bits for an image of 8


@dataclass(frozen=True, eq=False)
class Blurred:
    """A blurred image: smooth (H, W) [DN], kernel: its row (K,).

    mean, variance (h, w): of every block, from every fourth row. tops (h, W): largest value of every column in the rows
    of a block.
    """

    smooth: Image32
    kernel: Array
    mean: Image32
    variance: Image32
    tops: Image32


def blur(image: NDArray[Any], sigma_px: float) -> Blurred:
    """The image (H, W) blurred by a Gaussian that is cut at 2.4 σ, mirrored at the border pixel."""
    radius = max(1, int(np.ceil(RADIUS_IN_SIGMA * sigma_px)))
    kernel = cv2.getGaussianKernel(2 * radius + 1, sigma_px, cv2.CV_64F)[:, 0]
    rows, columns = image.shape
    h, w = max(1, rows // BLOCK_PX), max(1, columns // BLOCK_PX)
    mean, variance, tops = (
        np.empty((h, w), np.float32),
        np.empty((h, w), np.float32),
        np.empty((h, columns), np.float32),
    )
    if radius == RADIUS_PX and min(rows, columns) > RADIUS_PX:
        middle = 2 * np.rint(UNIT // 2 * kernel[RADIUS_PX])
        side = np.rint(0.5 * (UNIT - middle) * np.cumsum(kernel[RADIUS_PX + 1 :]) / kernel[RADIUS_PX + 1 :].sum())
        weights = np.concatenate([[middle], np.diff(side, prepend=0.0)]).astype(np.uint16)
        kernel = np.concatenate([weights[:0:-1], weights]) / UNIT
        smooth = np.empty(image.shape, np.float32)
        whole = np.empty(columns, np.uint16 if image.dtype == np.uint8 else np.uint32)
        _blur(np.ascontiguousarray(image), weights, whole, smooth, mean, variance, tops)
    else:
        filtered = cv2.sepFilter2D(image, cv2.CV_32F, kernel, kernel, borderType=cv2.BORDER_REFLECT_101)
        smooth = np.asarray(filtered, dtype=np.float32)
        _survey(smooth, mean, variance, tops)
    return Blurred(smooth, np.asarray(kernel, dtype=np.float64), mean, variance, tops)


@compiled_fast
def _blur(
    image: NDArray[Any],
    weights: NDArray[Any],
    whole: NDArray[Any],
    smooth: Image32,
    mean: Image32,
    variance: Image32,
    tops: Image32,
) -> None:
    """Fill all from smooth on. whole (W,): scratch. A block's rows are looked at while they are in the cache."""
    padded = np.empty(image.shape[1] + 2 * RADIUS_PX, np.float32)
    shares = np.empty(RADIUS_PX + 1, np.float32)
    for k in range(RADIUS_PX + 1):
        shares[k] = weights[k] / float(UNIT * UNIT)
    for block in range(len(mean)):
        first, last = _rows(block, len(mean), len(image))
        for j in range(first, last):
            _down(image, j, weights, whole)
            _along(whole, padded, shares, smooth[j])
        _survey_rows(smooth, first, last, mean[block], variance[block], tops[block])


@compiled_fast
def _survey(smooth: Image32, mean: Image32, variance: Image32, tops: Image32) -> None:
    for block in range(len(mean)):
        first, last = _rows(block, len(mean), len(smooth))
        _survey_rows(smooth, first, last, mean[block], variance[block], tops[block])


@inner_fast
def _rows(block: int, blocks: int, rows: int) -> tuple[int, int]:
    """First and behind the last row of a block; the last block takes the rest."""
    return block * BLOCK_PX, rows if block == blocks - 1 else (block + 1) * BLOCK_PX


@inner_fast
def _down(image: NDArray[Any], j: int, w: NDArray[Any], whole: NDArray[Any]) -> None:
    """Weighted sum (W,) of nine rows, in whole numbers; two loops, as LLVM gives up on nine sources of one."""
    end = len(image) - 1
    a1, a2, a3, a4 = image[abs(j - 1)], image[abs(j - 2)], image[abs(j - 3)], image[abs(j - 4)]
    b1, b2 = image[end - abs(end - j - 1)], image[end - abs(end - j - 2)]
    b3, b4 = image[end - abs(end - j - 3)], image[end - abs(end - j - 4)]
    here, w0, w1, w2, w3, w4 = image[j], w[0], w[1], w[2], w[3], w[4]
    for i in range(len(whole)):
        whole[i] = w0 * here[i] + w1 * (a1[i] + b1[i]) + w2 * (a2[i] + b2[i])
    for i in range(len(whole)):
        whole[i] += w3 * (a3[i] + b3[i]) + w4 * (a4[i] + b4[i])


@inner_fast
def _along(whole: NDArray[Any], padded: Image32, w: Image32, out: Image32) -> None:
    """The same along the row, into grey levels (W,)."""
    n = len(whole)
    middle = padded[RADIUS_PX : RADIUS_PX + n]
    for i in range(n):
        middle[i] = np.float32(whole[i])
    for k in range(1, RADIUS_PX + 1):
        padded[RADIUS_PX - k] = padded[RADIUS_PX + k]
        padded[RADIUS_PX - 1 + n + k] = padded[RADIUS_PX - 1 + n - k]
    w0, w1, w2, w3, w4 = w[0], w[1], w[2], w[3], w[4]
    for i in range(n):
        near = w0 * padded[i + 4] + w1 * (padded[i + 3] + padded[i + 5]) + w2 * (padded[i + 2] + padded[i + 6])
        out[i] = near + w3 * (padded[i + 1] + padded[i + 7]) + w4 * (padded[i] + padded[i + 8])


@inner_fast
def _survey_rows(smooth: Image32, first: int, last: int, mean: Image32, variance: Image32, tops: Image32) -> None:
    """Moments (w,) of a row of blocks and largest values (W,) of its columns."""
    columns = len(tops)
    total, square, count = np.zeros(columns), np.zeros(columns), 0
    tops[:] = smooth[first]
    for j in range(first, last, ROW_STEP):
        row = smooth[j]
        second, third, fourth = smooth[min(j + 1, last - 1)], smooth[min(j + 2, last - 1)], smooth[min(j + 3, last - 1)]
        count += 1
        for i in range(columns):
            tops[i] = max(row[i], second[i], third[i], fourth[i], tops[i])
        for i in range(columns):
            value = np.float64(row[i])
            total[i] += value
            square[i] += value * value
    for k in range(len(mean)):
        start, end = k * BLOCK_PX, columns if k == len(mean) - 1 else (k + 1) * BLOCK_PX
        middle, spread = 0.0, 0.0
        for i in range(start, end):
            middle += total[i]
            spread += square[i]
        middle, spread = middle / (count * (end - start)), spread / (count * (end - start))
        mean[k], variance[k] = middle, max(spread - middle * middle, 0.0)
