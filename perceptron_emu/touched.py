"""Which parts of an image anything was drawn in, so that nothing is spent on the rest."""

from __future__ import annotations

import math
from collections.abc import Iterator

import cv2
import numpy as np
from numba import njit
from numpy.typing import NDArray

CELL_PX = 16  # side of the squares that are told apart
BAND = 6  # rows of cells that are worked on together

Cells = NDArray[np.uint8]
Part = tuple[slice, slice]


def cells(shape: tuple[int, ...]) -> Cells:
    """Cells of an image (H, W), none of them touched."""
    return np.zeros((-(-shape[0] // CELL_PX), -(-shape[1] // CELL_PX)), np.uint8)


def spread(touched: Cells, offset: tuple[int, int], reach_px: float, shape: tuple[int, ...]) -> Cells:
    """The touched cells of an image (H, W) that everything within reach_px of ``touched`` lies in.

    offset: row and column of cells at which the first of ``touched`` stands in the image; may be negative.
    """
    out = cells(shape)
    rows, columns = (
        slice(max(o, 0), max(min(o + n, m), 0)) for o, n, m in zip(offset, touched.shape, out.shape, strict=True)
    )
    if rows.start < rows.stop and columns.start < columns.stop:
        inner = touched[
            rows.start - offset[0] : rows.stop - offset[0], columns.start - offset[1] : columns.stop - offset[1]
        ]
        out[rows, columns] = inner
    size = 2 * math.ceil(reach_px / CELL_PX) + 1
    return np.asarray(cv2.dilate(out, np.ones((size, size), np.uint8)), np.uint8)


def parts(touched: Cells, shape: tuple[int, ...]) -> Iterator[Part]:
    """Rectangles of the image (H, W), as slices of rows and columns, that hold all touched cells and do not overlap."""
    for band, left, right in _runs(touched).tolist():
        yield (
            slice(band * BAND * CELL_PX, min((band + 1) * BAND * CELL_PX, shape[0])),
            slice(left * CELL_PX, min(right * CELL_PX, shape[1])),
        )


@njit(cache=True)
def _runs(touched):  # type: ignore[no-untyped-def]
    """Runs of columns (n, 3) of the bands in which a cell is touched: number of the band, first, one past the last."""
    rows, columns = touched.shape
    out, n = np.empty((rows * (columns // 2 + 1), 3), np.int64), 0
    for band in range((rows + BAND - 1) // BAND):
        left = -1
        for i in range(columns + 1):
            here = False
            if i < columns:
                for j in range(band * BAND, min((band + 1) * BAND, rows)):
                    here = here or touched[j, i] > 0
            if here and left < 0:
                left = i
            if not here and left >= 0:
                out[n, 0], out[n, 1], out[n, 2] = band, left, i
                n, left = n + 1, -1
    return out[:n]


def widened(part: Part, reach_px: int, shape: tuple[int, ...]) -> tuple[Part, Part]:
    """A part with reach_px more on every side inside the image (H, W), and the place of the part in it."""
    wide = tuple(slice(max(s.start - reach_px, 0), min(s.stop + reach_px, n)) for s, n in zip(part, shape, strict=True))
    inner = tuple(slice(s.start - w.start, s.stop - w.start) for s, w in zip(part, wide, strict=True))
    return (wide[0], wide[1]), (inner[0], inner[1])
