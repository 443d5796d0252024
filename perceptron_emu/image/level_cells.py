"""Which parts of an image show one level alone, so that blur and distortion are worked out only for the rest."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from geometry.compiled import kernel

CELL_PX = 16  # side of the squares that are told apart
SOURCE_PX = 4  # side of the squares that they are looked up in; CELL_PX is a multiple

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


def levels(image: Float32, boxes: Boxes) -> tuple[Float32, Flags]:
    """For every cell (h, w) a level that it shows, and whether it shows several. boxes: `sources` in the image."""
    low, high = np.empty((2, *_cells(image.shape, SOURCE_PX)), np.float32)
    _extremes(image, low, high)
    level, several = np.empty(boxes.shape[:2], np.float32), np.empty(boxes.shape[:2], np.bool_)
    _gather(low, high, boxes, level, several)
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
def _gather(low: Float32, high: Float32, boxes: Boxes, level: Float32, several: Flags) -> None:
    for b in range(level.shape[0]):
        for a in range(level.shape[1]):
            top, bottom, left, right = boxes[b, a]
            shown = low[top, left]
            other = False
            for j in range(top, bottom + 1):
                for i in range(left, right + 1):
                    other |= (low[j, i] != shown) | (high[j, i] != shown)
                if other:
                    break
            level[b, a], several[b, a] = shown, other


@kernel(fastmath=True)
def _extremes(image: Float32, low: Float32, high: Float32) -> None:
    """Least and largest level of every square."""
    height, width = image.shape
    least, most = np.empty(width, np.float32), np.empty(width, np.float32)
    for b in range(low.shape[0]):
        row = image[b * SOURCE_PX]
        for i in range(width):
            least[i] = most[i] = row[i]
        for j in range(b * SOURCE_PX + 1, min((b + 1) * SOURCE_PX, height)):
            row = image[j]
            for i in range(width):
                least[i], most[i] = min(least[i], row[i]), max(most[i], row[i])
        for a in range(width // SOURCE_PX):
            lowest, highest = least[a * SOURCE_PX], most[a * SOURCE_PX]
            for i in range(a * SOURCE_PX + 1, (a + 1) * SOURCE_PX):
                lowest, highest = min(lowest, least[i]), max(highest, most[i])
            low[b, a], high[b, a] = lowest, highest
        if width % SOURCE_PX:
            first = width - width % SOURCE_PX
            low[b, -1], high[b, -1] = least[first:].min(), most[first:].max()


@kernel(fastmath=True)
def fill(target: Float32, level: Float32, several: Flags, scale: Float32) -> None:
    """Set target (H, W) to level · scale in the cells of a single level."""
    height, width = target.shape
    for b in range(level.shape[0]):
        for j in range(b * CELL_PX, min((b + 1) * CELL_PX, height)):
            for a in range(level.shape[1]):
                if several[b, a]:
                    continue
                first, last, value = a * CELL_PX, min((a + 1) * CELL_PX, width), np.float32(level[b, a])
                if value == 0:
                    target[j, first:last] = 0
                    continue
                for i in range(first, last):
                    target[j, i] = value * scale[j, i]
