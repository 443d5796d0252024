"""Which parts of an image show one level alone, so that blur and distortion are worked out only for the rest."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numba import njit
from numpy.typing import NDArray

CELL_PX = 16  # side of the squares that are told apart
BAND = 4  # rows of cells that are worked on together

Levels = NDArray[np.uint16]
Flags = NDArray[np.bool_]
Boxes = NDArray[np.int64]
Part = tuple[slice, slice]


def sources(u: NDArray[np.float32], v: NDArray[np.float32], reach_px: int, shape: tuple[int, ...]) -> Boxes:
    """For every cell of an image the cells of another, of ``shape``, that it shows something of.

    u, v: where in the other image a pixel (H, W) is taken from; reach_px: how far the blur mixes pixels. Returns first
    and last row, first and last column (h, w, 4).
    """
    boxes = np.empty((*_cells(u.shape), 4), np.int64)
    _reached(v, reach_px, shape[0] - 1, boxes[..., :2])
    _reached(u, reach_px, shape[1] - 1, boxes[..., 2:])
    return boxes


def levels(image: Levels, boxes: Boxes) -> tuple[Levels, Flags]:
    """For every cell (h, w) a level that it shows, and whether it shows several. boxes: `sources` in the image."""
    low, high = np.empty((2, *_cells(image.shape)), np.uint16)
    _extremes(image, low, high)
    level, several = np.empty(boxes.shape[:2], np.uint16), np.empty(boxes.shape[:2], np.bool_)
    _gather(low, high, boxes, level, several)
    return level, several


def fill(target: NDArray[np.float32], level: Levels, several: Flags, scale: NDArray[np.float32]) -> None:
    """Set target (H, W) to level · scale in the cells of a single level other than 0."""
    _fill(target, level, several, scale)


def parts(cells: Flags, shape: tuple[int, ...]) -> Iterator[Part]:
    """Rectangles of the image (H, W), as slices of rows and columns, that hold all the cells and do not overlap."""
    for band, left, right in _runs(cells).tolist():
        yield (
            slice(band * BAND * CELL_PX, min((band + 1) * BAND * CELL_PX, shape[0])),
            slice(left * CELL_PX, min(right * CELL_PX, shape[1])),
        )


def widened(part: Part, reach_px: int, shape: tuple[int, ...]) -> tuple[Part, Part]:
    """A part with reach_px more on every side inside the image (H, W), and the place of the part in it."""
    wide = tuple(slice(max(s.start - reach_px, 0), min(s.stop + reach_px, n)) for s, n in zip(part, shape, strict=True))
    inner = tuple(slice(s.start - w.start, s.stop - w.start) for s, w in zip(part, wide, strict=True))
    return (wide[0], wide[1]), (inner[0], inner[1])


def _cells(shape: tuple[int, ...]) -> tuple[int, int]:
    return -(-shape[0] // CELL_PX), -(-shape[1] // CELL_PX)


@njit(cache=True)
def _reached(place, reach, last, out):  # type: ignore[no-untyped-def]
    """First and last cell (h, w, 2) that a cell's pixels are taken from, by their places (H, W) along one axis."""
    height, width = place.shape
    for b in range(out.shape[0]):
        for a in range(out.shape[1]):
            lowest, highest = np.inf, -np.inf
            for j in range(max(b * CELL_PX - reach, 0), min((b + 1) * CELL_PX + reach, height)):
                for i in range(max(a * CELL_PX - reach, 0), min((a + 1) * CELL_PX + reach, width)):
                    lowest, highest = min(lowest, place[j, i]), max(highest, place[j, i])
            out[b, a, 0] = int(min(max(np.floor(lowest), 0), last)) // CELL_PX
            out[b, a, 1] = int(min(max(np.ceil(highest), 0), last)) // CELL_PX


@njit(cache=True)
def _gather(low, high, boxes, level, several):  # type: ignore[no-untyped-def]
    for b in range(level.shape[0]):
        for a in range(level.shape[1]):
            box = boxes[b, a]
            least, most = low[box[0], box[2]], high[box[0], box[2]]
            for j in range(box[0], box[1] + 1):
                for i in range(box[2], box[3] + 1):
                    least, most = min(least, low[j, i]), max(most, high[j, i])
            level[b, a], several[b, a] = most, least != most


@njit(cache=True)
def _extremes(image, low, high):  # type: ignore[no-untyped-def]
    """Least and largest level of every cell."""
    height, width = image.shape
    least, most = np.empty(width, np.uint16), np.empty(width, np.uint16)
    for b in range(low.shape[0]):
        least[:], most[:] = 65535, 0
        for j in range(b * CELL_PX, min((b + 1) * CELL_PX, height)):
            row = image[j]
            for i in range(width):
                least[i], most[i] = min(least[i], row[i]), max(most[i], row[i])
        for a in range(low.shape[1]):
            first, last = a * CELL_PX, min((a + 1) * CELL_PX, width)
            low[b, a], high[b, a] = least[first:last].min(), most[first:last].max()


@njit(cache=True, fastmath=True)
def _fill(target, level, several, scale):  # type: ignore[no-untyped-def]
    height, width = target.shape
    for b in range(level.shape[0]):
        for a in range(level.shape[1]):
            if several[b, a] or level[b, a] == 0:
                continue
            first, last, value = a * CELL_PX, min((a + 1) * CELL_PX, width), np.float32(level[b, a])
            for j in range(b * CELL_PX, min((b + 1) * CELL_PX, height)):
                for i in range(first, last):
                    target[j, i] = value * scale[j, i]


@njit(cache=True)
def _runs(cells):  # type: ignore[no-untyped-def]
    """Runs of columns (n, 3) of the bands that hold a cell: number of the band, first column, one past the last."""
    rows, columns = cells.shape
    out, n = np.empty((rows * (columns // 2 + 1), 3), np.int64), 0
    for band in range((rows + BAND - 1) // BAND):
        left = -1
        for i in range(columns + 1):
            here = False
            if i < columns:
                for j in range(band * BAND, min((band + 1) * BAND, rows)):
                    here = here or cells[j, i]
            if here and left < 0:
                left = i
            if not here and left >= 0:
                out[n, 0], out[n, 1], out[n, 2] = band, left, i
                n, left = n + 1, -1
    return out[:n]
