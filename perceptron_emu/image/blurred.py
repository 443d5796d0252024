"""A picture seen through the lens: bent by its distortion, then blurred, in the cells where that shows."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from geometry.compiled import kernel
from perceptron_emu.image.deposit import convolved
from perceptron_emu.image.level_cells import CELL_PX, Flags

Float32 = NDArray[np.float32]


def gaussian_taps(sigma_px: float, reach_px: int) -> Float32:
    """Weights (2 reach + 1,) of a sampled Gaussian; they add up to 1."""
    taps = np.exp(-0.5 * (np.arange(-reach_px, reach_px + 1) / sigma_px) ** 2)
    return np.asarray(taps / taps.sum(), np.float32)


class PixelPlaces(NamedTuple):
    """Where in a picture an image's pixels (H, W) are taken from: number of the picture's pixel up and left of it, and
    how far it is to the right of and below that one, in [0, 1].
    """

    pixel: NDArray[np.uint32]
    right: Float32
    below: Float32

    @staticmethod
    def of(u: Float32, v: Float32, columns: int) -> PixelPlaces:
        """The places (u, v), each (H, W), in a picture of so many columns."""
        left, top = np.floor(u), np.floor(v)
        pixel = top.astype(np.uint32) * np.uint32(columns) + left.astype(np.uint32)
        return PixelPlaces(pixel, u - left, v - top)


class SourcePicture(NamedTuple):
    """A picture (N,), row after row of so many columns, and where the image's pixels are in it."""

    picture: Float32
    columns: np.uint32
    places: PixelPlaces


class Box(NamedTuple):
    """Part of an image: first row and the one after the last, first column and the one after the last."""

    top: int
    bottom: int
    left: int
    right: int


def draw_blurred(
    target: Float32, picture: Float32, places: PixelPlaces, cells: Flags, taps: Float32, scale: Float32
) -> None:
    """Set target (H, W) to scale times the picture, taken between its pixels linearly and blurred, in the cells.

    places: of the target's pixels in the picture, each with a neighbour to the right and below. taps: of the blur
    along each axis; the image is mirrored at its border.
    """
    _draw(target, SourcePicture(picture.ravel(), np.uint32(picture.shape[1]), places), cells, taps, scale)


@kernel(fastmath=True)
def _draw(target: Float32, source: SourcePicture, cells: Flags, taps: Float32, scale: Float32) -> None:
    """Cells of a row that touch are drawn in one run."""
    reach = len(taps) // 2
    height, width = target.shape
    sharp = np.empty((CELL_PX + 2 * reach, width + 2 * reach), np.float32)
    level = np.empty((CELL_PX + 2 * reach, width), np.float32)
    for b in range(cells.shape[0]):
        top, bottom = b * CELL_PX, min((b + 1) * CELL_PX, height)
        a = 0
        while a < cells.shape[1]:
            if not cells[b, a]:
                a += 1
                continue
            left = a * CELL_PX
            while a < cells.shape[1] and cells[b, a]:
                a += 1
            right = min(a * CELL_PX, width)
            _bent(source, Box(top, bottom, left, right), reach, sharp)
            for j in range(bottom - top + 2 * reach):
                convolved(sharp[j], taps, level[j, : right - left])
            for j in range(top, bottom):
                _across(level[j - top : j - top + len(taps)], taps, scale[j, left:right], target[j, left:right])


@kernel(fastmath=True)
def _bent(source: SourcePicture, box: Box, reach: int, sharp: Float32) -> None:
    """The picture at the pixels of a box and reach around it, between its pixels linearly."""
    picture, columns, (pixel, right_of, below) = source
    top, bottom, left, right = box
    height, width = pixel.shape
    low, high = max(left - reach, 0), min(right + reach, width)
    before, after = low - (left - reach), right + reach - high
    for j in range(top - reach, bottom + reach):
        row, line = _mirrored(j, height), sharp[j - top + reach]
        at, s, t = pixel[row, low:high], right_of[row, low:high], below[row, low:high]
        to = line[before : before + high - low]
        for i in range(len(at)):
            k = at[i]
            upper = picture[k] + s[i] * (picture[k + np.uint32(1)] - picture[k])
            k += columns
            lower = picture[k] + s[i] * (picture[k + np.uint32(1)] - picture[k])
            to[i] = upper + t[i] * (lower - upper)
        for i in range(before):
            line[i] = line[2 * before - i]
        end = before + high - low
        for i in range(after):
            line[end + i] = line[end - 2 - i]


@kernel(inline=True)
def _mirrored(i: int, n: int) -> int:
    return -i if i < 0 else (2 * n - 2 - i if i >= n else i)


@kernel(fastmath=True)
def _across(lines: Float32, taps: Float32, scale: Float32, out: Float32) -> None:
    """Lines (taps, n) blurred across and scaled."""
    reach = len(taps) // 2
    n, middle = len(out), lines[reach]
    for i in range(n):
        out[i] = taps[reach] * middle[i]
    for k in range(reach):
        weight, before, after = taps[k], lines[k], lines[2 * reach - k]
        for i in range(n):
            out[i] += weight * (before[i] + after[i])
    for i in range(n):
        out[i] *= scale[i]
