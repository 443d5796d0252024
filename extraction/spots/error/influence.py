"""Compiled error budget of fitted spots; `budget` says what it is made of.

Pixels lie in flat planes, REACH of weight zero behind each row, REACH such rows before the first and after the last: a
neighbour is a shift.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from extraction.linalg import cholesky, solve
from extraction.noise import PixelNoise, camera_variance, noise_of, pixel_variance
from extraction.spots.fit import SINGULAR, Window, Windows, window_of
from extraction.spots.model import (
    BY_U,
    BY_V,
    SLOPED,
    Array,
    Records,
    Spot,
    background,
    centre_by_terms,
    distance2,
    long_axis,
    seen_from,
    spot_of,
)
from geometry.compiled import kernel

# squared distances of two pixels that are told apart; farther ones are taken as uncorrelated
DISTANCES2 = np.array([0, 1, 2, 4, 5, 8, 9])
CLASSES = len(DISTANCES2)
REACH = 3  # largest lag of DISTANCES2 along an axis [px]
# class of distance, rows down, columns right (LAGS, 3)
LAGS = np.array(
    [
        (k, b, a)
        for k, d in enumerate(DISTANCES2)
        for b in range(-REACH, REACH + 1)
        for a in range(-REACH, REACH + 1)
        if a * a + b * b == d
    ]
)
# those of other pixels by fours that a quarter turn makes of one: class, rows down, columns right (CROSSES, 3)
CROSSES = np.array([lag for lag in LAGS if lag[1] >= 0 and lag[2] > 0])
CORE = 0.2  # share of the height above which a pixel's residual tells of the speckle
BRIGHT = 0.1  # the same for the pixels that the terms are fitted to, when residuals are judged
RIDGE = 1e-11  # terms that the bright pixels do not tell apart
MOST_TERMS = SLOPED + 2  # of the fit, and third and fourth moment along the long axis
# rows of the planes after the terms
SIGNAL, GRAINY, VARIANCE, WEIGHT, RESIDUAL = range(MOST_TERMS, MOST_TERMS + 5)
PLANES = MOST_TERMS + 5
# ⟨x x'⟩ over two points of a pixel [px²], weighted by the correlation of grains of 0.55 px (0.063 at 0.3, 0.018 at 1.3)
WITHIN_PIXEL = 0.05
# columns of `moments` before those of the classes
PRODUCT, CAMERA, SPECKLE = 0, 1, 2


class Budgets(NamedTuple):
    """What `budgets` fills, all zero before.

    camera, white (N, 3, 3), speckle (N, 3, 3, K), skew (N,): as in `ErrorBudget`, white for a height of 1. moments
    (N, 2 + K): of the core's residuals over the height's square, freed of the camera's part; that part; the speckle's
    of contrast 1 by classes of distance.
    """

    camera: Array
    speckle: Array
    white: Array
    skew: Array
    moments: Array


class Scatter(NamedTuple):
    """The weighted terms (n, P) times the camera's variance, and times what speckle multiplies; Σ w e V w eᵀ (n, n)."""

    camera: Array
    speckle: Array
    spread: Array


class Moves(NamedTuple):
    """One spot's part of `Budgets`: Cov of (u, v, skew) by the camera, by speckle and by white errors."""

    camera: Array
    speckle: Array
    white: Array


@kernel
def budgets(windows: Windows, place: Records, spots: Records, noise: Records, out: Budgets) -> None:
    """Fill ``out`` for N fits: records of PLACE, SPOT (from each window's first pixel) and NOISE."""
    for k in range(len(spots)):
        window, spot, law, n = window_of(windows, k, place[k]), spot_of(spots[k]), noise_of(noise[k]), place[k].terms
        rows, columns = window.grey.shape
        planes = np.zeros((PLANES, _plane_size(rows, columns)))
        _fill(window, spot, n, law, planes)
        moves = Moves(out.camera[k], out.speckle[k], out.white[k])
        out.skew[k] = _covariance(planes, columns + REACH, spot, n, moves)
        top, bottom, left, right = _bright_box(window, planes[SIGNAL])
        if bottom <= top:
            continue
        part = np.zeros((PLANES, _plane_size(bottom - top, right - left)))
        bright = Window(window.grey[top:bottom, left:right], window.use[top:bottom, left:right])
        _fill(bright, seen_from(spot, left, top), n, law, part)
        _residual_moments(part, right - left + REACH, n + 2, _largest(planes[SIGNAL]), out.moments[k])


@kernel
def _plane_size(rows: int, columns: int) -> int:
    return (rows + 2 * REACH) * (columns + REACH) + 2 * REACH


@kernel
def _fill(window: Window, spot: Spot, n: int, noise: PixelNoise, planes: Array) -> None:
    """The model's terms at every pixel, signal, what speckle multiplies, camera variance, weight and residual.

    After the fit's n terms: third and fourth moment along the long axis. A spot is no perfect Gaussian along its
    string (dim light on the rest of it, the sheet's wings); without these terms that would pass for speckle. Where the
    light falls off within a pixel, its bright part's few grains rule: speckle multiplies more than the mean light.
    """
    cosine, sine, along = long_axis(spot)
    stride = window.grey.shape[1] + REACH
    for j in range(window.grey.shape[0]):
        for i in range(window.grey.shape[1]):
            x, y, at = i - spot.u, j - spot.v, (j + REACH) * stride + i + REACH
            fall, drop = spot.a * x + spot.h * y, spot.h * x + spot.c * y  # of the light's logarithm
            bell = math.exp(-0.5 * distance2(spot, x, y))
            signal, t = spot.height * bell, along * (cosine * x + sine * y)
            mu = signal + background(spot, i, j)
            planes[0, at], planes[1, at], planes[2, at] = bell, bell * x, bell * y
            planes[3, at], planes[4, at], planes[5, at] = 0.5 * bell * x * x, bell * x * y, 0.5 * bell * y * y
            planes[6, at] = 1.0
            if n == SLOPED:
                planes[7, at], planes[8, at] = i, j
            planes[n, at] = signal * (t * t * t - 3.0 * t) / 6.0
            planes[n + 1, at] = signal * (t * t * (t * t - 6.0) + 3.0) / 24.0
            planes[SIGNAL, at], planes[VARIANCE, at] = signal, camera_variance(noise, mu)
            planes[GRAINY, at] = signal * math.sqrt(1.0 + WITHIN_PIXEL * (fall * fall + drop * drop))
            if window.use[j, i]:
                planes[WEIGHT, at] = 1.0 / pixel_variance(noise, mu, signal)
                planes[RESIDUAL, at] = window.grey[j, i] - mu


@kernel
def _bright_box(window: Window, signal: Array) -> tuple[int, int, int, int]:
    """Top, bottom, left, right of the bright pixels in use: there a spot is a Gaussian, its wings do not matter."""
    rows, columns = window.use.shape
    least, stride = BRIGHT * _largest(signal), columns + REACH
    top, bottom, left, right = rows, 0, columns, 0
    for j in range(rows):
        for i in range(columns):
            if window.use[j, i] and signal[(j + REACH) * stride + i + REACH] > least:
                top, bottom, left, right = min(top, j), max(bottom, j + 1), min(left, i), max(right, i + 1)
    return top, bottom, left, right


@kernel(fastmath=True)
def _dot(first: Array, second: Array) -> float:
    """Sum of products of two rows of one length."""
    total = 0.0
    for i in range(len(first)):
        total += first[i] * second[i]
    return total


@kernel
def _largest(values: Array) -> float:
    """The largest of a row; numba's own brings all that raises errors about axes, a second to compile."""
    largest: float = values[0]
    for i in range(1, len(values)):
        largest = max(largest, values[i])
    return largest


@kernel(fastmath=True)
def _lagged_dots(first: Array, second: Array, stride: int, out: Array) -> None:
    """Add to ``out`` (K,) the sums of products of all pairs of pixels of each class of distance, one of each row."""
    start = REACH * stride + REACH
    end = len(first) - start
    inside = first[start:end]
    out[0] += _dot(inside, second[start:end])
    for k, b, a in CROSSES:
        along, across = b * stride + a, b - a * stride
        one, two = second[start + along : end + along], second[start - along : end - along]
        three, four = second[start + across : end + across], second[start - across : end - across]
        total = 0.0
        for i in range(len(inside)):
            total += inside[i] * ((one[i] + two[i]) + (three[i] + four[i]))
        out[k] += total


@kernel(fastmath=True)
def _gram(first: Array, second: Array, n: int, out: Array) -> None:
    """Sums of products out (n, n) of symmetric pairs of planes (n, P)."""
    for r in range(n):
        for s in range(r + 1):
            out[r, s] = _dot(first[r], second[s])
            out[s, r] = out[r, s]


@kernel(fastmath=True)
def _mix(matrix: Array, planes: Array, n: int, out: Array) -> None:
    """Out (m, P) = matrix (m, n) · planes (n, P), three planes at a time."""
    for a in range(out.shape[0]):
        row, r = out[a], n % 3
        row[:] = 0.0
        for k in range(r):
            factor, plane = matrix[a, k], planes[k]
            for i in range(len(row)):
                row[i] += factor * plane[i]
        while r < n:
            f0, f1, f2 = matrix[a, r], matrix[a, r + 1], matrix[a, r + 2]
            p0, p1, p2 = planes[r], planes[r + 1], planes[r + 2]
            for i in range(len(row)):
                row[i] += f0 * p0[i] + f1 * p1[i] + f2 * p2[i]
            r += 3


@kernel(fastmath=True)
def _scaled(planes: Array, factor: Array, n: int) -> Array:
    """The first n planes, each pixel times ``factor`` (P,)."""
    out = np.empty((n, planes.shape[1]))
    for r in range(n):
        plane, row = planes[r], out[r]
        for i in range(len(row)):
            row[i] = plane[i] * factor[i]
    return out


@kernel
def _covariance(planes: Array, stride: int, spot: Spot, n: int, moves: Moves) -> float:
    """Covariance (3, 3) of (u, v, skew) by camera, (3, 3, K) by speckle of contrast 1 and (3, 3) by independent errors
    of 1 grey level in all pixels; returns the skew.
    """
    fisher, factor = np.zeros((n + 1, n + 1)), np.zeros((n + 1, n + 1))
    weighted = _scaled(planes, planes[WEIGHT], n + 1)
    _gram(weighted, planes, n + 1, fisher)
    if not cholesky(fisher, 0.0, SINGULAR, n, factor):
        moves.camera[:] = np.nan
        return 0.0
    moved, freed = np.empty((3, planes.shape[1])), np.empty((3, planes.shape[1]))
    _mix(_influence(spot, fisher, factor, n), weighted, n + 1, moved)
    skew = 0.0
    for i in range(planes.shape[1]):
        skew += moved[2, i] * planes[RESIDUAL, i]
        for a in range(3):
            freed[a, i] = moved[a, i] * planes[VARIANCE, i]
    _gram(freed, moved, 3, moves.camera)
    _gram(moved, moved, 3, moves.white)
    for i in range(planes.shape[1]):
        for a in range(3):
            freed[a, i] = moved[a, i] * planes[GRAINY, i]
    _lagged(freed, stride, moves.speckle)
    return skew


@kernel
def _influence(spot: Spot, fisher: Array, factor: Array, n: int) -> Array:
    """Influence (3, n + 1) of a grey level on u, v and the skew, in terms of the weighted basis."""
    out, unit = np.zeros((3, n + 1)), np.zeros(n)
    first, second, share = np.zeros(n), np.zeros(n), np.zeros(n)
    uu, uv, vv = centre_by_terms(spot)
    unit[BY_U] = 1.0
    solve(factor, unit, n, first)
    unit[BY_U], unit[BY_V] = 0.0, 1.0
    solve(factor, unit, n, second)
    # what the fit leaves of the third moment: the part that is orthogonal to all its terms
    solve(factor, fisher[n], n, share)
    size = fisher[n, n]
    for r in range(n):
        out[0, r] = uu * first[r] + uv * second[r]
        out[1, r] = uv * first[r] + vv * second[r]
        size -= share[r] * fisher[n, r]
    size = max(size, 1e-30)
    for r in range(n):
        out[2, r] = -share[r] / size
    out[2, n] = 1.0 / size
    return out


@kernel(fastmath=True)
def _lagged(q: Array, stride: int, out: Array) -> None:
    """Out (3, 3, K): sums of q_a q_b (3, P) over all pairs of pixels of each class of distance."""
    for a in range(3):
        for b in range(a + 1):
            _lagged_dots(q[a], q[b], stride, out[a, b])
            for k in range(out.shape[2]):
                out[b, a, k] = out[a, b, k]


@kernel
def _residual_moments(planes: Array, stride: int, n: int, height: float, moments: Array) -> None:
    """Moments of the core's residuals after a fit of all n terms to the bright pixels, which are ``planes``."""
    core = np.zeros(planes.shape[1])
    for i in range(planes.shape[1]):
        if planes[SIGNAL, i] <= BRIGHT * height:
            planes[WEIGHT, i] = 0.0
        core[i] = 1.0 if planes[WEIGHT, i] > 0.0 and planes[SIGNAL, i] > CORE * height else 0.0
    weighted = _scaled(planes, planes[WEIGHT], n)
    fisher, factor, inverse, unit = np.zeros((n, n)), np.zeros((n, n)), np.zeros((n, n)), np.zeros(n)
    _gram(weighted, planes, n, fisher)
    if not cholesky(fisher, RIDGE, SINGULAR, n, factor):
        return
    for r in range(n):
        unit[:] = 0.0
        unit[r] = 1.0
        solve(factor, unit, n, inverse[r])
    z, left = np.empty((n, planes.shape[1])), np.zeros(planes.shape[1])
    _mix(inverse, planes, n, z)
    z = _scaled(z, core, n)
    for r in range(n):
        share = _dot(weighted[r], planes[RESIDUAL])
        for i in range(planes.shape[1]):
            left[i] -= z[r, i] * share
    signal = planes[GRAINY] * core
    left += planes[RESIDUAL] * core
    scatter = Scatter(_scaled(weighted, planes[VARIANCE], n), _scaled(weighted, planes[GRAINY], n), np.empty((n, n)))
    _gram(scatter.camera, weighted, n, scatter.spread)
    _moments(scatter, stride, z, signal, moments)
    moments[PRODUCT] = _dot(left, left) - moments[CAMERA] - _dot(planes[VARIANCE], core)
    moments[CAMERA] += _dot(planes[VARIANCE], core)
    moments[SPECKLE] += _dot(signal, signal)
    moments /= height * height


@kernel(fastmath=True)
def _moments(scatter: Scatter, stride: int, z: Array, signal: Array, out: Array) -> None:
    """Camera's and speckle's part (2 + K,) of Σ residual².

    Without the noise of the pixels themselves, which the caller adds. With z = F⁻¹ e (n, P) the residual is
    error_i - z_iᵀ Σ_l w_l e_l error_l, so that only sums over pixels are needed, none over pairs beyond REACH.
    """
    n = len(z)
    pairs, mixed = np.empty((n, n)), np.empty_like(z)
    _gram(z, z, n, pairs)
    for r in range(n):
        for s in range(n):
            out[CAMERA] += pairs[r, s] * scatter.spread[r, s]
        out[CAMERA] -= 2.0 * _dot(scatter.camera[r], z[r])
    _mix(pairs, scatter.speckle, n, mixed)
    for r in range(n):
        for i in range(z.shape[1]):
            mixed[r, i] -= 2.0 * z[r, i] * signal[i]
        _lagged_dots(mixed[r], scatter.speckle[r], stride, out[SPECKLE:])
