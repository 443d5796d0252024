"""The frame's own noise, from what Gaussian fits of some sections leave over."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from extraction.config import StripeConfig
from extraction.linalg import Symmetric4, Vector4, cholesky, factor4, solve, solve4
from extraction.noise import QUANTISATION_VARIANCE, PixelNoise
from extraction.order import kth_smallest
from extraction.stripe.sections.fit import peak_of
from extraction.stripe.sections.ground import Ground, ground_at
from extraction.stripe.sections.model import SINGULAR, Mask, Peak, Records, slopes
from extraction.stripe.view import Pixels, StripeView
from geometry.compiled import kernel

Array = NDArray[np.float64]

_BINS = 24  # of signal
_FEWEST = 8  # sections that say something
_ROUNDS = 4  # of reweighting; the weights need not be exact
_SIGNIFICANT = 9.0  # of a likelihood ratio: three σ
# of a section's pixels: derivatives of the mean (0 … 3), signal, bin, then what `_residuals` sums, the light among it
_SIGNAL, _BIN, _LIGHT, _SQUARE, _COLUMNS = 4, 5, 7, 9, 10
_MISFIT = 4.0  # a section whose χ² is that many times the median is no Gaussian peak and says nothing on noise


def estimate_noise(
    view: StripeView, section: NDArray[np.int32], fits: Records, ground: Ground, config: StripeConfig, dark_dn2: float
) -> PixelNoise:
    """Variance model of the frame by weighted least squares on the fits' squared residuals.

    fits: records of SECTION, all converged (M,), fitted with equal weights; ground: that was taken off. What the config
    states is taken, the rest is estimated; without enough sections ``dark_dn2`` stands for the dark noise. Clipped
    plateaus say nothing.
    """
    known = (config.read_noise_dn, config.gain_dn_per_e, config.speckle_contrast)
    variances = [np.nan if k is None else float(k) ** power for k, power in zip(known, (2, 1, 2), strict=True)]
    variances[0] += QUANTISATION_VARIANCE
    if None in known and np.count_nonzero(fits["dof"] > 0) >= _FEWEST:
        bins = _residuals(view.pixels, section, fits, ground, view.clip_dn, view.black_dn)
        variances = _variances(bins, np.array(variances)).tolist()
    elif known[0] is None:
        variances[0] = dark_dn2
    a, c, k2 = (0.0 if np.isnan(v) else v for v in variances)
    return PixelNoise(max(a, QUANTISATION_VARIANCE), c, view.black_dn, k2)


@kernel
def _residuals(
    pixels: Pixels, section: NDArray[np.int32], fits: Records, ground: Ground, clip: float, black: float
) -> Array:
    """In bins of the signal (B, 5), finer towards the dark: fitted pixels; sums of what unit variances of the three
    terms leave in the residual, and of its square.

    Of sections that are a Gaussian peak. The residual of a fit with equal weights is (1 - H) of the noise, H the hat
    matrix: E r² = Σ (1 - H)² variance; with H = J F⁻¹ Jᵀ that is v (1 - 2 H) + xᵀ (Jᵀ V J) x for x = F⁻¹ j.
    """
    (grey, left_out), longest, n, largest = pixels, 0, 0, 1e-9
    ratio, out = np.empty(len(fits)), np.zeros((_BINS, 5))
    for i in range(len(fits)):
        if fits[i].dof > 0:
            longest = max(longest, fits[i].high - fits[i].low)
            ratio[n] = fits[i].chi2 / fits[i].dof
            n += 1
    worst = _MISFIT * kth_smallest(ratio[:n], n // 2)
    for i in range(len(fits)):
        if fits[i].dof > 0 and fits[i].chi2 <= worst * fits[i].dof:
            largest = max(largest, _largest_signal(grey, left_out, section[i], peak_of(fits[i]), fits[i], clip))
    own, step = np.empty((_COLUMNS, longest)), math.sqrt(largest) / _BINS
    for i in range(len(fits)):
        if not (fits[i].dof > 0 and fits[i].chi2 <= worst * fits[i].dof):
            continue
        peak, n = peak_of(fits[i]), 0
        for row in range(fits[i].low, fits[i].high):
            y = float(grey[row, section[i]])
            if y < clip and (left_out.size == 0 or not left_out[row, section[i]]):
                y -= ground_at(ground, i, float(row)) if len(ground.origin) else 0.0
                mean, j = slopes(peak, row)
                own[0, n], own[1, n], own[2, n], own[3, n] = j
                own[_SIGNAL, n], own[_LIGHT, n], own[_SQUARE, n] = mean - peak.background, mean - black, (y - mean) ** 2
                n += 1
        fisher, shot, speckle = _sums(own, n)
        definite, factor = factor4(fisher, SINGULAR)
        if not definite:
            continue
        inverse = _inverse(factor)
        _left(own, n, inverse, _between(inverse, shot), _between(inverse, speckle), step)
        for k in range(n):
            b = min(int(own[_BIN, k]), _BINS - 1)
            out[b, 0] += 1.0
            for c in range(4):
                out[b, 1 + c] += own[_SQUARE - 3 + c, k]
    return out


@kernel(inline=True)
def _sums(own: Array, n: int) -> tuple[Symmetric4, Symmetric4, Symmetric4]:
    """Sums of j jᵀ over n pixels, each with weight one, its light and its squared signal."""
    f = g = h = Symmetric4(0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    for k in range(n):
        p = _square(Vector4(own[0, k], own[1, k], own[2, k], own[3, k]))
        signal = own[_SIGNAL, k]
        f, g, h = _add(f, p, 1.0), _add(g, p, max(own[_LIGHT, k], 0.0)), _add(h, p, signal * signal)
    return f, g, h


@kernel(fastmath=True)
def _left(own: Array, n: int, inverse: Symmetric4, shot: Symmetric4, speckle: Symmetric4, step: float) -> None:
    """What unit variances leave in n pixels' residuals, to the rows before the squares; and their bins."""
    one, light, more = own[_SQUARE - 3], own[_LIGHT], own[_SQUARE - 1]
    signal, bins, j0, j1, j2, j3 = own[_SIGNAL], own[_BIN], own[0], own[1], own[2], own[3]
    for k in range(n):
        p = _square(Vector4(j0[k], j1[k], j2[k], j3[k]))
        hat, s = _product(inverse, p), max(signal[k], 0.0)
        one[k] = 1.0 - hat
        light[k] = (1.0 - 2.0 * hat) * max(light[k], 0.0) + _product(shot, p)
        more[k] = (1.0 - 2.0 * hat) * (signal[k] * signal[k]) + _product(speckle, p)
        bins[k] = math.sqrt(s) / step


@kernel(inline=True)
def _largest_signal(grey: NDArray[Any], left_out: Mask, section: int, peak: Peak, row: Any, clip: float) -> float:
    """That of the fitted pixels, which is the one's nearest to the centre."""
    nearest = np.inf
    for r in range(row.low, row.high):
        if float(grey[r, section]) < clip and (left_out.size == 0 or not left_out[r, section]):
            nearest = min(nearest, abs(r - peak.centre))
    t = nearest / peak.width
    return float(peak.amplitude * math.exp(-0.5 * t * t))


@kernel
def _square(j: Vector4) -> Symmetric4:
    """The matrix j jᵀ."""
    return Symmetric4(
        j.a0 * j.a0, j.a0 * j.a1, j.a0 * j.a2, j.a0 * j.a3, j.a1 * j.a1,
        j.a1 * j.a2, j.a1 * j.a3, j.a2 * j.a2, j.a2 * j.a3, j.a3 * j.a3,
    )  # fmt: skip


@kernel
def _add(f: Symmetric4, p: Symmetric4, w: float) -> Symmetric4:
    """F + w P."""
    return Symmetric4(
        f.a00 + w * p.a00, f.a01 + w * p.a01, f.a02 + w * p.a02, f.a03 + w * p.a03, f.a11 + w * p.a11,
        f.a12 + w * p.a12, f.a13 + w * p.a13, f.a22 + w * p.a22, f.a23 + w * p.a23, f.a33 + w * p.a33,
    )  # fmt: skip


@kernel
def _product(f: Symmetric4, p: Symmetric4) -> float:
    """The sum of the products of all terms: jᵀ F j of p = j jᵀ."""
    mixed = f.a01 * p.a01 + f.a02 * p.a02 + f.a03 * p.a03 + f.a12 * p.a12 + f.a13 * p.a13 + f.a23 * p.a23
    return f.a00 * p.a00 + f.a11 * p.a11 + f.a22 * p.a22 + f.a33 * p.a33 + 2.0 * mixed


@kernel
def _inverse(factor: Symmetric4) -> Symmetric4:
    a = solve4(factor, Vector4(1.0, 0.0, 0.0, 0.0))
    b = solve4(factor, Vector4(0.0, 1.0, 0.0, 0.0))
    c = solve4(factor, Vector4(0.0, 0.0, 1.0, 0.0))
    d = solve4(factor, Vector4(0.0, 0.0, 0.0, 1.0))
    return Symmetric4(a.a0, b.a0, c.a0, d.a0, b.a1, c.a1, d.a1, c.a2, d.a2, d.a3)


@kernel
def _between(f: Symmetric4, s: Symmetric4) -> Symmetric4:
    """F S F."""
    a, b = Vector4(f.a00, f.a01, f.a02, f.a03), Vector4(f.a01, f.a11, f.a12, f.a13)
    c, d = Vector4(f.a02, f.a12, f.a22, f.a23), Vector4(f.a03, f.a13, f.a23, f.a33)
    u, v, w, x = _times(s, a), _times(s, b), _times(s, c), _times(s, d)
    return Symmetric4(
        _dot(a, u), _dot(a, v), _dot(a, w), _dot(a, x), _dot(b, v),
        _dot(b, w), _dot(b, x), _dot(c, w), _dot(c, x), _dot(d, x),
    )  # fmt: skip


@kernel
def _times(s: Symmetric4, a: Vector4) -> Vector4:
    return Vector4(
        s.a00 * a.a0 + s.a01 * a.a1 + s.a02 * a.a2 + s.a03 * a.a3,
        s.a01 * a.a0 + s.a11 * a.a1 + s.a12 * a.a2 + s.a13 * a.a3,
        s.a02 * a.a0 + s.a12 * a.a1 + s.a22 * a.a2 + s.a23 * a.a3,
        s.a03 * a.a0 + s.a13 * a.a1 + s.a23 * a.a2 + s.a33 * a.a3,
    )


@kernel
def _dot(a: Vector4, b: Vector4) -> float:
    return a.a0 * b.a0 + a.a1 * b.a1 + a.a2 * b.a2 + a.a3 * b.a3


@kernel
def _variances(bins: Array, stated: Array) -> Array:
    """The three variances from the bins of `_residuals`; NaN in ``stated`` (3,) asks for one.

    Speckle only where it is significant: without it the flanks, where the position comes from, are weighted better.
    """
    terms, squares, pixels, n = np.empty((_BINS, 3)), np.empty(_BINS), np.empty(_BINS), 0
    for i in range(len(bins)):
        if bins[i, 0] > 0:
            pixels[n], squares[n] = bins[i, 0], bins[i, 4] / bins[i, 0]
            for j in range(3):
                terms[n, j] = bins[i, 1 + j] / bins[i, 0]
            n += 1
    terms, squares, pixels = terms[:n], squares[:n], pixels[:n]
    free = np.empty(3, np.bool_)
    for j in range(3):
        free[j] = math.isnan(stated[j])
    everything = _non_negative(terms, squares, pixels, stated, free)
    if not (free[2] and (free[0] or free[1])):
        return everything
    free[2] = False
    camera = _non_negative(terms, squares, pixels, stated, free)
    misfit = np.zeros(2)
    for i in range(len(pixels)):
        weight = math.sqrt(pixels[i] / 2) / max(_mean(terms[i], camera), QUANTISATION_VARIANCE)
        misfit[0] += (weight * (squares[i] - _mean(terms[i], camera))) ** 2
        misfit[1] += (weight * (squares[i] - _mean(terms[i], everything))) ** 2
    return everything if misfit[0] - misfit[1] > _SIGNIFICANT else camera


@kernel
def _mean(terms: Array, variances: Array) -> float:
    return float(terms[0] * variances[0] + terms[1] * variances[1] + terms[2] * variances[2])


@kernel
def _non_negative(terms: Array, squares: Array, pixels: Array, stated: Array, free: NDArray[np.bool_]) -> Array:
    """The free variances ≥ 0, the others as stated; a squared Gaussian residual has variance 2 v²."""
    out = np.zeros(3)
    for j in range(3):
        if not free[j] and not math.isnan(stated[j]):
            out[j] = stated[j]
    weight, fixed = pixels.copy(), out.copy()
    for _ in range(_ROUNDS):
        matrix, right, square = np.zeros((3, 3)), np.zeros(3), np.ones(3)
        for i in range(len(pixels)):
            goal = squares[i] - _mean(terms[i], fixed)
            for j in range(3):
                right[j] += weight[i] * goal * terms[i, j]
                for k in range(3):
                    matrix[j, k] += weight[i] * terms[i, j] * terms[i, k]
        for j in range(3):
            square[j] = math.sqrt(matrix[j, j]) if matrix[j, j] > 0 else 1.0
        for j in range(3):
            right[j] /= square[j]
            for k in range(3):
                matrix[j, k] /= square[j] * square[k]
        best = _least(matrix, right, free)
        for j in range(3):
            out[j] = best[j] / square[j] if free[j] else fixed[j]
        for i in range(len(pixels)):
            weight[i] = pixels[i] / max(_mean(terms[i], out), QUANTISATION_VARIANCE) ** 2
    return out


@kernel
def _least(matrix: Array, right: Array, free: NDArray[np.bool_]) -> Array:
    """The x ≥ 0, zero where not free, of the least xᵀ A x - 2 bᵀ x, A (3, 3): the best choice of what is zero."""
    best, least, x = np.zeros(3), 0.0, np.zeros(3)
    own, b, factor, y = np.zeros((3, 3)), np.zeros(3), np.zeros((3, 3)), np.zeros(3)
    for choice in range(1, 8):
        n, chosen = 0, np.zeros(3, np.int64)
        allowed = True
        for j in range(3):
            if choice >> j & 1:
                allowed = allowed and free[j]
                chosen[n] = j
                n += 1
        if not allowed:
            continue
        for j in range(n):
            b[j] = right[chosen[j]]
            for k in range(n):
                own[j, k] = matrix[chosen[j], chosen[k]]
        if not cholesky(own, 0.0, SINGULAR, n, factor):
            continue
        solve(factor, b, n, y)
        value, positive = 0.0, True
        x[:] = 0.0
        for j in range(n):
            positive = positive and y[j] >= 0
            value -= y[j] * b[j]  # at the least, the form is - bᵀ x
            x[chosen[j]] = y[j]
        if positive and value < least:
            best, least = x.copy(), value
    return best
