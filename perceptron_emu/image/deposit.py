"""Light on pixels: every node a Gaussian spot, integrated over each pixel."""

from __future__ import annotations

import math
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from geometry.compiled import kernel
from geometry.special import ndtr

Float32 = NDArray[np.float32]
Array = NDArray[np.float64]
Index = NDArray[np.int64]

REACH = 4.5  # σ: what lies outside is 7e-6 of the light
STEPS_A_SIGMA = 1024  # of the table of the normal distribution; interpolated, it is exact to 3e-8
_EDGE = 6  # σ: the table's ends, 2e-9 of the light lies beyond
NORMAL_CDF = ndtr(np.arange(-_EDGE * STEPS_A_SIGMA, _EDGE * STEPS_A_SIGMA + 2) / STEPS_A_SIGMA)


@kernel(inline=True)
def _cdf(z: float) -> float:
    place = min(max((z + _EDGE) * STEPS_A_SIGMA, 0.0), 2.0 * _EDGE * STEPS_A_SIGMA)
    i = int(place)
    below, above = NORMAL_CDF[i], NORMAL_CDF[i + 1]
    value: float = below + (place - i) * (above - below)
    return value


class GaussianSpots(NamedTuple):
    """Gaussian spots (N,): centres u, v and σ in pixels of a grid, (0, 0) the centre of the first; weight: their
    light.
    """

    u: Array
    v: Array
    weight: Array
    sigma: Array

    def part(self, which: Index | slice) -> GaussianSpots:
        """Some of them, in that order."""
        return GaussianSpots(self.u[which], self.v[which], self.weight[which], self.sigma[which])


@kernel(fastmath=True)
def deposit(image: Float32, spots: GaussianSpots) -> None:
    """Add spots to an image (H, W).

    A pixel takes ∫∫ of the spot over its square: the product of two differences of the normal distribution.
    """
    u, v, weight, sigma = spots
    height, width = image.shape
    row = np.empty(width, np.float32)
    for k in range(len(u)):
        reach = REACH * sigma[k]
        u0, u1 = max(0, math.ceil(u[k] - reach - 0.5)), min(width - 1, math.floor(u[k] + reach + 0.5))
        v0, v1 = max(0, math.ceil(v[k] - reach - 0.5)), min(height - 1, math.floor(v[k] + reach + 0.5))
        if u0 > u1 or v0 > v1:
            continue
        scale = 1 / sigma[k]
        last = _cdf((u0 - 0.5 - u[k]) * scale)
        for i in range(u0, u1 + 1):
            here = _cdf((i + 0.5 - u[k]) * scale)
            row[i] = here - last
            last = here
        last = _cdf((v0 - 0.5 - v[k]) * scale)
        for j in range(v0, v1 + 1):
            here = _cdf((j + 0.5 - v[k]) * scale)
            factor = np.float32(weight[k] * (here - last))
            last = here
            for i in range(u0, u1 + 1):
                image[j, i] += factor * row[i]


def gaussian_taps(sigma_px: float, reach_px: int) -> Float32:
    """Weights (2 reach + 1,) of a sampled Gaussian; they add up to 1."""
    taps = np.exp(-0.5 * (np.arange(-reach_px, reach_px + 1) / sigma_px) ** 2)
    return np.asarray(taps / taps.sum(), np.float32)


def spline_taps(sigma: float) -> Float32:
    """What Gaussian and pixel make of a cubic B-spline, at distances of −REACH σ … REACH σ cells.

    Spots of one σ are spread by cubic B-splines; one convolution along each axis divides the spline out again and
    multiplies Gaussian and pixel in (the non-uniform FFT's gridding; the error is below 1e-4 of the peak for σ ≥ 2.5
    cells).
    """
    return _taps(round(sigma, 4))


@lru_cache(maxsize=256)
def _taps(sigma: float) -> Float32:
    reach = math.ceil(REACH * sigma)
    f = np.fft.fftfreq(8 * reach)
    response = np.exp(-2 * (np.pi * sigma * f) ** 2) / np.sinc(f) ** 3  # sinc over the spline's sinc⁴
    half = np.fft.ifft(response).real[: reach + 1]
    taps = np.concatenate([half[:0:-1], half])
    return np.asarray(taps / taps.sum(), np.float32)


@kernel(fastmath=True)
def spread(grid: Float32, spots: GaussianSpots, reached: Index) -> None:
    """Add cubic B-splines to the grid (H, W); reached (H, 2): widened to the first column with light and the one after
    the last.
    """
    u, v, weight = spots.u, spots.v, spots.weight
    height, width = grid.shape
    wx, wy = np.empty(4), np.empty(4)
    for k in range(len(u)):
        i, j = math.floor(u[k]), math.floor(v[k])
        for w, t in ((wx, u[k] - i), (wy, v[k] - j)):
            s = 1 - t
            w[0], w[3] = s * s * s / 6, t * t * t / 6
            w[1] = (4 - 6 * t * t + 3 * t * t * t) / 6
            w[2] = 1 - w[0] - w[1] - w[3]
        left, right = max(i - 1, 0), min(i + 3, width)
        for b in range(4):
            y = j - 1 + b
            if 0 <= y < height and left < right:
                reached[y, 0], reached[y, 1] = min(reached[y, 0], left), max(reached[y, 1], right)
                light = weight[k] * wy[b]
                for x in range(left, right):
                    grid[y, x] += light * wx[x - (i - 1)]


@kernel(fastmath=True)
def convolved(line: Float32, taps: Float32, out: Float32) -> None:
    """Fill out (n,) with the line (n + taps − 1,) convolved; taps: of odd number, the same to either side."""
    reach = len(taps) // 2
    n, middle = len(out), line[reach : reach + len(out)]
    for i in range(n):
        out[i] = taps[reach] * middle[i]
    for k in range(reach):
        weight, before, after = taps[k], line[k : k + n], line[2 * reach - k : 2 * reach - k + n]
        for i in range(n):
            out[i] += weight * (before[i] + after[i])
