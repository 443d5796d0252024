"""The matched blur, and on the same pass over memory what detection wants to know of its blocks: moments and tops."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from geometry.compiled import kernel

Array = NDArray[np.float64]
Image32 = NDArray[np.float32]

BLOCK_PX = 16  # background and noise are constant over such a block and interpolated between
ROW_STEP = 4  # rows of a block that its moments are taken from
RADIUS_IN_SIGMA = 2.4  # of the kernel: 98 % of the weight of a Gaussian
RADIUS_PX = 4  # of the kernel that is compiled; others are OpenCV's
UNIT = 256  # the compiled kernel's weights are whole numbers of this sum: exact in 16 bits for an image of 8


@dataclass(frozen=True, eq=False)
class Blurred:
    """A blurred image: smooth (H, W) [DN], kernel: its row (K,).

    mean, variance (h, w): of every block, from every fourth row. tops (h, w): largest value of every block.
    """

    smooth: Image32
    kernel: Array
    mean: Image32
    variance: Image32
    tops: Image32


def blur(image: NDArray[Any], sigma_px: float) -> Blurred:
    """The image (H, W) blurred by a Gaussian that is cut at 2.4 σ, mirrored at the border pixel."""
    radius = max(1, int(np.ceil(RADIUS_IN_SIGMA * sigma_px)))
    rows, columns = image.shape
    h, w = max(1, rows // BLOCK_PX), max(1, columns // BLOCK_PX)
    mean, variance, tops = np.empty((3, h, w), np.float32)
    if radius == RADIUS_PX and min(rows, columns) > RADIUS_PX:
        weights, kernel = _whole_weights(sigma_px)
        smooth = np.empty(image.shape, np.float32)
        whole = np.empty(columns, np.uint16 if image.dtype == np.uint8 else np.uint32)
        _blur(np.ascontiguousarray(image), weights, whole, smooth, mean, variance, tops)
    else:
        kernel = np.asarray(cv2.getGaussianKernel(2 * radius + 1, sigma_px, cv2.CV_64F)[:, 0], dtype=np.float64)
        filtered = cv2.sepFilter2D(image, cv2.CV_32F, kernel, kernel, borderType=cv2.BORDER_REFLECT_101)
        smooth = np.asarray(filtered, dtype=np.float32)
        _survey(smooth, mean, variance, tops)
    return Blurred(smooth, kernel, mean, variance, tops)


@lru_cache(maxsize=16)
def _whole_weights(sigma_px: float) -> tuple[NDArray[np.uint16], Array]:
    """Whole weights (5,) from the kernel's middle outwards, and its row (9,) of sum 1."""
    kernel = cv2.getGaussianKernel(2 * RADIUS_PX + 1, sigma_px, cv2.CV_64F)[:, 0]
    middle = 2 * np.rint(UNIT // 2 * kernel[RADIUS_PX])
    side = np.rint(0.5 * (UNIT - middle) * np.cumsum(kernel[RADIUS_PX + 1 :]) / kernel[RADIUS_PX + 1 :].sum())
    weights = np.concatenate([[middle], np.diff(side, prepend=0.0)]).astype(np.uint16)
    whole = np.concatenate([weights[:0:-1], weights]) / UNIT
    weights.flags.writeable = whole.flags.writeable = False
    return weights, whole


@kernel(fastmath=True)
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
    padded, most = np.empty(image.shape[1] + 2 * RADIUS_PX, np.float32), np.empty(image.shape[1], np.float32)
    shares = np.empty(RADIUS_PX + 1, np.float32)
    for k in range(RADIUS_PX + 1):
        shares[k] = weights[k] / float(UNIT * UNIT)
    for block in range(len(mean)):
        first, last = _rows(block, len(mean), len(image))
        most[:] = 0.0
        for j in range(first, last):
            _down(image, j, weights, whole)
            _along(whole, padded, shares, smooth[j], most)
        _block_tops(most, tops[block])
        _moments(smooth, first, last, mean[block], variance[block])


@kernel(fastmath=True)
def _survey(smooth: Image32, mean: Image32, variance: Image32, tops: Image32) -> None:
    most = np.empty(smooth.shape[1], np.float32)
    for block in range(len(mean)):
        first, last = _rows(block, len(mean), len(smooth))
        most[:] = 0.0
        for j in range(first, last):
            _raise(most, smooth[j])
        _block_tops(most, tops[block])
        _moments(smooth, first, last, mean[block], variance[block])


@kernel(fastmath=True)
def _rows(block: int, blocks: int, rows: int) -> tuple[int, int]:
    """First and behind the last row of a block; the last block takes the rest."""
    return block * BLOCK_PX, rows if block == blocks - 1 else (block + 1) * BLOCK_PX


@kernel(fastmath=True)
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


@kernel(fastmath=True)
def _along(whole: NDArray[Any], padded: Image32, w: Image32, out: Image32, most: Image32) -> None:
    """The same along the row, into grey levels (W,); most (W,): raised to them."""
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
    _raise(most, out)


@kernel(fastmath=True)
def _raise(most: Image32, values: Image32) -> None:
    """Raise ``most`` (W,) to the values, none of which is negative: their bits order as they do, and LLVM has a vector
    maximum for whole numbers only.
    """
    old, new = most.view(np.int32), values.view(np.int32)
    for i in range(len(old)):
        old[i] = max(old[i], new[i])


@kernel(fastmath=True)
def _block_tops(most: Image32, tops: Image32) -> None:
    """Largest value (w,) of each block's columns."""
    for k in range(len(tops)):
        start, end = k * BLOCK_PX, len(most) if k == len(tops) - 1 else (k + 1) * BLOCK_PX
        top = most[start]
        for i in range(start + 1, end):
            top = max(top, most[i])
        tops[k] = top


@kernel(fastmath=True)
def _moments(smooth: Image32, first: int, last: int, mean: Image32, variance: Image32) -> None:
    """Mean and variance (w,) of a row of blocks."""
    columns = smooth.shape[1]
    total, square, count = np.zeros(columns), np.zeros(columns), 0
    for j in range(first, last, ROW_STEP):
        row = smooth[j]
        count += 1
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
