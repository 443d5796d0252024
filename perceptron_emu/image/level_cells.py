"""Which parts of an image show one level alone, so that blur and distortion are worked out only for the rest."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from geometry.compiled import kernel

CELL_PX = 16  # side of the squares that are told apart
SOURCE_PX = 4  # side of the squares that they are looked up in, as `_extremes` has it; CELL_PX is a multiple

Flags = NDArray[np.bool_]
Boxes = NDArray[np.int32]
Float32 = NDArray[np.float32]


def sources(u: Float32, v: Float32, reach_px: int, shape: tuple[int, ...]) -> Boxes:
    """For every cell of an image the small squares of another, of ``shape``, that it shows something of.

    u, v: where in the other image a pixel (H, W) is taken from; reach_px: how far the blur mixes pixels. Returns first
    and last row, first and last column (h, w, 4).
    """
    boxes = np.empty((*_cells(u.shape, CELL_PX), 4), np.int32)
    _reached(v, reach_px, shape[0] - 1, boxes[..., :2])
    _reached(u, reach_px, shape[1] - 1, boxes[..., 2:])
    return boxes


def levels(image: Float32, drawn: NDArray[np.int64], boxes: Boxes) -> tuple[Float32, Flags]:
    """For every cell (h, w) a level that it shows, and whether it shows several. boxes: `sources` in the image.

    drawn: first row and the one after the last, first column and the one after the last, outside of which all is 0.
    """
    low, high = np.zeros((2, *_cells(image.shape, SOURCE_PX)), np.float32)
    squares = np.stack([drawn[::2] // SOURCE_PX, -(-drawn[1::2] // SOURCE_PX)], -1).ravel()
    _extremes(image, squares, low, high)
    level, several = np.empty(boxes.shape[:2], np.float32), np.empty(boxes.shape[:2], np.bool_)
    _gather(low, high, squares, boxes, level, several)
    return level, several


def _cells(shape: tuple[int, ...], side: int) -> tuple[int, int]:
    return -(-shape[0] // side), -(-shape[1] // side)


@kernel
def _reached(place: Float32, reach: int, last: int, out: Boxes) -> None:
    """First and last square (h, w, 2) that a cell's pixels are taken from, by their places (H, W) along one axis."""
    height, width = place.shape
    for b in range(out.shape[0]):
        for a in range(out.shape[1]):
            lowest, highest = np.inf, -np.inf
            for j in range(max(b * CELL_PX - reach, 0), min((b + 1) * CELL_PX + reach, height)):
                for i in range(max(a * CELL_PX - reach, 0), min((a + 1) * CELL_PX + reach, width)):
                    lowest, highest = min(lowest, place[j, i]), max(highest, place[j, i])
            out[b, a, 0] = int(min(max(np.floor(lowest), 0), last)) // SOURCE_PX
            out[b, a, 1] = int(min(max(np.ceil(highest), 0), last)) // SOURCE_PX


@kernel(fastmath=True)
def _gather(
    low: Float32, high: Float32, drawn: NDArray[np.int64], boxes: Boxes, level: Float32, several: Flags
) -> None:
    for b in range(level.shape[0]):
        for a in range(level.shape[1]):
            top, bottom, left, right = boxes[b, a]
            level[b, a], several[b, a] = 0, False
            if bottom < drawn[0] or top >= drawn[1] or right < drawn[2] or left >= drawn[3]:
                continue
            shown = low[top, left]
            other = False
            for j in range(top, bottom + 1):
                for i in range(left, right + 1):
                    other |= (low[j, i] != shown) | (high[j, i] != shown)
                if other:
                    break
            level[b, a], several[b, a] = shown, other


@kernel(fastmath=True)
def _extremes(image: Float32, squares: NDArray[np.int64], low: Float32, high: Float32) -> None:
    """Least and largest level of the squares from a row to another, from a column to another."""
    height, width = image.shape
    top, bottom, left, right = squares
    from_, to = left * SOURCE_PX, min(right * SOURCE_PX, width)
    least, most = np.zeros(low.shape[1] * SOURCE_PX, np.float32), np.zeros(low.shape[1] * SOURCE_PX, np.float32)
    for b in range(top, bottom):
        first, last = b * SOURCE_PX, min((b + 1) * SOURCE_PX, height)
        lows, highs = least[from_:to], most[from_:to]
        row = image[first, from_:to]
        for i in range(len(row)):
            lows[i] = highs[i] = row[i]
        for j in range(first + 1, last):
            row = image[j, from_:to]
            for i in range(len(row)):
                lows[i], highs[i] = min(lows[i], row[i]), max(highs[i], row[i])
        for i in range(width, right * SOURCE_PX):  # beyond the last column
            least[i], most[i] = least[width - 1], most[width - 1]
        for a in range(left, right):
            k = a * SOURCE_PX
            low[b, a] = min(least[k], least[k + 1], least[k + 2], least[k + 3])
            high[b, a] = max(most[k], most[k + 1], most[k + 2], most[k + 3])


@kernel(fastmath=True)
def fill(target: Float32, level: Float32, several: Flags, scale: Float32) -> None:
    """Set target (H, W), of 0, to level · scale in the cells of a single level."""
    height, width = target.shape
    for b in range(level.shape[0]):
        for j in range(b * CELL_PX, min((b + 1) * CELL_PX, height)):
            for a in range(level.shape[1]):
                if several[b, a]:
                    continue
                first, last, value = a * CELL_PX, min((a + 1) * CELL_PX, width), np.float32(level[b, a])
                if value == 0:
                    continue
                for i in range(first, last):
                    target[j, i] = value * scale[j, i]
