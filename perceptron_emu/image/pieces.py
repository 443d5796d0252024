"""Pieces of light on the chip: drawn on sub-pixels, multiplied by their speckle, summed over each pixel."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from geometry.compiled import kernel
from perceptron_emu.image.deposit import REACH, GaussianSpots, convolved, deposit, spread
from perceptron_emu.image.speckle import SpeckleField, row_of_grains

Float32 = NDArray[np.float32]
Index = NDArray[np.int64]


class SpotPieces(NamedTuple):
    """Spots that are drawn together: where each piece's begin and the last one's end (P + 1,), how far its speckle has
    moved (P, 2) [sub-pixels: u, v], and the sub-pixels of a pixel's side.
    """

    bounds: Index
    moved: Index
    q: int


class _Lit(NamedTuple):
    """A piece's light on sub-pixels (H, W): rows spread along u, and of each the first column with light and the one
    after the last.
    """

    rows: Float32
    reached: Index


@kernel(fastmath=True)
def draw_pieces(
    electrons: Float32, spots: GaussianSpots, pieces: SpotPieces, taps: Float32, speckle: SpeckleField
) -> None:
    """Add the light of pieces to the electrons (H, W). taps: of the splines, where all spots are alike; else empty."""
    for p in range(len(pieces.bounds) - 1):
        begin, end = pieces.bounds[p], pieces.bounds[p + 1]
        _draw_piece(
            electrons,
            GaussianSpots(spots.u[begin:end], spots.v[begin:end], spots.weight[begin:end], spots.sigma[begin:end]),
            pieces.q,
            pieces.moved[p],
            taps,
            speckle,
        )


@kernel(fastmath=True)
def _draw_piece(
    electrons: Float32, spots: GaussianSpots, q: int, moved: Index, taps: Float32, speckle: SpeckleField
) -> None:
    height, width = electrons.shape
    left, right, top, bottom, sigma = np.inf, -np.inf, np.inf, -np.inf, 0.0
    for k in range(len(spots.u)):
        left, right = min(left, spots.u[k]), max(right, spots.u[k])
        top, bottom = min(top, spots.v[k]), max(bottom, spots.v[k])
        sigma = max(sigma, spots.sigma[k])
    # the piece's own box; it may stand out over the image's border
    reach = REACH * sigma + 1
    u0, u1, v0, v1 = (
        math.floor(left - reach),
        math.ceil(right + reach),
        math.floor(top - reach),
        math.ceil(bottom + reach),
    )
    if u1 < 0 or v1 < 0 or u0 >= width or v0 >= height:
        return
    lit = _light(((v1 - v0 + 1) * q, (u1 - u0 + 1) * q), _on_sub_pixels(spots, u0, v0, q), taps)
    columns = lit.rows.shape[1]
    light, grains, real, imaginary = np.empty((4, columns), np.float32)
    total = np.empty(columns, np.float32)
    row, column = v0 * q - moved[1], u0 * q - moved[0]
    for v in range(max(v0, 0), min(v1 + 1, height)):
        first, last = columns, 0
        total[:] = 0
        for j in range((v - v0) * q, (v - v0 + 1) * q):
            a, b = _across(lit, j, taps, light)
            if a >= b:
                continue
            first, last = min(first, a), max(last, b)
            n = b - a
            row_of_grains(speckle, row + j, column + a, real[:n], imaginary[:n], grains[:n])
            _add_product(light[a:b], grains[:n], total[a:b])
        for u in range(max(u0 + first // q, 0), min(u0 + (last + q - 1) // q, width)):
            sum_ = np.float32(0)
            for i in range((u - u0) * q, (u - u0 + 1) * q):
                sum_ += total[i]
            electrons[v, u] += sum_


@kernel
def _on_sub_pixels(spots: GaussianSpots, u0: int, v0: int, q: int) -> GaussianSpots:
    """The spots in a grid of q × q sub-pixels a pixel, whose first pixel is (u0, v0)."""
    return GaussianSpots((spots.u - u0 + 0.5) * q - 0.5, (spots.v - v0 + 0.5) * q - 0.5, spots.weight, spots.sigma * q)


@kernel
def _light(shape: tuple[int, int], spots: GaussianSpots, taps: Float32) -> _Lit:
    """Light on sub-pixels: splines spread along u alone, or, without taps, the whole of it."""
    rows, columns = shape
    grid, reached = np.zeros(shape, np.float32), np.empty((rows, 2), np.int64)
    reached[:, 0], reached[:, 1] = columns, 0
    if len(taps) == 0:
        deposit(grid, spots)
        reached[:, 0], reached[:, 1] = 0, columns
        return _Lit(grid, reached)
    spread(grid, spots, reached)
    reach = len(taps) // 2
    line = np.zeros(columns + 2 * reach, np.float32)
    for j in range(rows):
        if reached[j, 0] >= reached[j, 1]:
            continue
        a, b = max(reached[j, 0] - reach, 0), min(reached[j, 1] + reach, columns)
        for i in range(a, b):
            line[reach + i] = grid[j, i]
        convolved(line[a : b + 2 * reach], taps, grid[j, a:b])
        line[reach + a : reach + b] = 0
        reached[j, 0], reached[j, 1] = a, b
    return _Lit(grid, reached)


@kernel(fastmath=True)
def _across(lit: _Lit, j: int, taps: Float32, light: Float32) -> tuple[int, int]:
    """Set light to row j, spread along v too; from which column to which it has any."""
    rows, reached = lit
    if len(taps) == 0:
        for i in range(len(light)):
            light[i] = rows[j, i]
        return 0, len(light)
    reach = len(taps) // 2
    above, below = max(j - reach, 0), min(j + reach + 1, len(rows))
    first, last = len(light), 0
    for k in range(above, below):
        if reached[k, 0] < reached[k, 1]:
            first, last = min(first, reached[k, 0]), max(last, reached[k, 1])
    if first >= last:
        return 0, 0
    light[first:last] = 0
    for k in range(above, below):
        a, b = reached[k, 0], reached[k, 1]
        if a < b:
            _add(light[a:b], taps[reach + k - j], rows[k, a:b])
    return first, last


@kernel(fastmath=True)
def _add(row: Float32, weight: np.float32, other: Float32) -> None:
    for i in range(len(row)):
        row[i] += weight * other[i]


@kernel(fastmath=True)
def _add_product(light: Float32, grains: Float32, total: Float32) -> None:
    for i in range(len(total)):
        total[i] += light[i] * grains[i]
