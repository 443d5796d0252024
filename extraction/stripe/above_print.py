"""What stands above a print: a lamp lights white squares to one level, a laser's light comes on top of that.

Squares and gaps of a checkerboard are ridges as high as a stripe across them, and as long together. Above the white's
own level there is nothing of them.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from extraction.noise import QUANTISATION_VARIANCE

_TILE_PX = 64  # of the picture, that has one level of white: some squares, more than a stripe is wide
# of a tile's pixels, that are no brighter than white: squares are half of it, less what a stripe covers
_WHITE = 85.0
_NOISE = 2.0  # times the tile's noise above it, where white does not reach
_EVERY = 2  # n-th pixel of a tile that is looked at


def level_of_print(grey: NDArray[Any]) -> NDArray[np.float32]:
    """The grey level that a print lit by a lamp does not reach (H, W) [DN].

    White's level tile by tile, straight on between their middles, and the noise of neighbouring pixels above it.
    """
    rows, columns = grey.shape
    high, wide = max(1, round(rows / _TILE_PX)), max(1, round(columns / _TILE_PX))
    level = np.empty((high, wide), np.float32)
    for i in range(high):
        for j in range(wide):
            tile = grey[i * rows // high : (i + 1) * rows // high, j * columns // wide : (j + 1) * columns // wide]
            beside = np.diff(tile[::_EVERY].astype(float), axis=1)
            noise = 1.4826 * np.median(np.abs(beside)) / np.sqrt(2) if beside.size else 0.0
            noise = max(float(noise), QUANTISATION_VARIANCE**0.5)
            level[i, j] = np.percentile(tile[::_EVERY, ::_EVERY], _WHITE) + _NOISE * noise
    return np.ascontiguousarray(_between(_between(level, rows).T, columns).T, np.float32)


def means_along(grey: NDArray[Any], sections: int, axis: int) -> NDArray[Any]:
    """Means of so many pixels along an axis, in whole grey levels; beyond the border its last pixel again."""
    beyond = [(0, 0), (0, 0)]
    beyond[axis] = (sections // 2, sections - sections // 2)
    total = np.moveaxis(np.cumsum(np.pad(grey.astype(np.int64), beyond, mode="edge"), axis=axis), axis, 0)
    means = (total[sections:] - total[:-sections] + sections // 2) // sections
    return np.ascontiguousarray(np.moveaxis(means, 0, axis)).astype(grey.dtype)


def _between(level: NDArray[Any], rows: int) -> NDArray[np.float64]:
    """Rows (N, …) that are means of ``rows`` / N each, straight on between their middles (rows, …)."""
    at = np.clip((np.arange(rows) + 0.5) * len(level) / rows - 0.5, 0, len(level) - 1)
    low = np.minimum(at.astype(int), max(len(level) - 2, 0))
    share = (at - low)[:, None]
    return np.asarray((1 - share) * level[low] + share * level[np.minimum(low + 1, len(level) - 1)])
