"""The frame's own noise, from what Gaussian fits of some sections leave over."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from extraction.config import StripeConfig
from extraction.linalg import Symmetric4, Vector4, cholesky, factor4, solve, solve4
from extraction.noise import QUANTISATION_VARIANCE, PixelNoise
from extraction.order import kth_smallest
from extraction.stripe.sections.fit import peak_of
from extraction.stripe.sections.ground import Ground, ground_at
from extraction.stripe.sections.model import SINGULAR, Records, slopes
from extraction.stripe.view import Pixels, StripeView
from geometry.compiled import kernel

Array = NDArray[np.float64]

_BINS = 24  # of signal
_FEWEST = 8  # sections that say something
_ROUNDS = 4  # of reweighting; the weights need not be exact
_SIGNIFICANT = 9.0  # of a likelihood ratio: three σ
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
        bins = _binned(_residuals(view.pixels, section, fits, ground, view.clip_dn, view.black_dn))
        variances = _variances(bins, np.array(variances)).tolist()
    elif known[0] is None:
        variances[0] = dark_dn2
    a, c, k2 = (0.0 if np.isnan(v) else v for v in variances)
    return PixelNoise(max(a, QUANTISATION_VARIANCE), c, view.black_dn, k2)


@kernel
def _residuals(
    pixels: Pixels, section: NDArray[np.int32], fits: Records, ground: Ground, clip: float, black: float
) -> Array:
    """Per fitted pixel (P, 5): signal; what unit variances of the three terms leave in the residual; its square.

    Of sections that are a Gaussian peak. The residual of a fit with equal weights is (1 - H) of the noise, H the hat
    matrix: E r² = Σ (1 - H)² variance; with H = J F⁻¹ Jᵀ that is v (1 - 2 H) + xᵀ (Jᵀ V J) x for x = F⁻¹ j.
    """
    (grey, left_out), most, longest, n = pixels, 0, 0, 0
    ratio = np.empty(len(fits))
    for i in range(len(fits)):
        if fits[i].dof > 0:
            rows = fits[i].high - fits[i].low
            most, longest = most + rows, max(longest, rows)
            ratio[n] = fits[i].chi2 / fits[i].dof
            n += 1
    worst = _MISFIT * kth_smallest(ratio[:n], n // 2)
    out, count, slope = np.empty((most, 5)), 0, np.empty((longest, 4))
    zero = Symmetric4(0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    for i in range(len(fits)):
        if not (fits[i].dof > 0 and fits[i].chi2 <= worst * fits[i].dof):
            continue
        peak, own, n = peak_of(fits[i]), out[count:], 0
        fisher, shot, speckle = zero, zero, zero
        for row in range(fits[i].low, fits[i].high):
            y = float(grey[row, section[i]])
            if y < clip and (left_out.size == 0 or not left_out[row, section[i]]):
                y -= ground_at(ground, i, float(row)) if len(ground.origin) else 0.0
                mean, j = slopes(peak, row)
                signal, light = mean - peak.background, mean - black
                slope[n, 0], slope[n, 1], slope[n, 2], slope[n, 3] = j
                fisher = _add_square(fisher, j, 1.0)
                shot, speckle = _add_square(shot, j, max(light, 0.0)), _add_square(speckle, j, signal * signal)
                own[n, 0], own[n, 1], own[n, 2], own[n, 3] = signal, 1.0, max(light, 0.0), signal * signal
                own[n, 4] = (y - mean) ** 2
                n += 1
        definite, factor = factor4(fisher, SINGULAR)
        if not definite:
            continue
        for k in range(n):
            j = Vector4(slope[k, 0], slope[k, 1], slope[k, 2], slope[k, 3])
            x = solve4(factor, j)
            hat = x.a0 * j.a0 + x.a1 * j.a1 + x.a2 * j.a2 + x.a3 * j.a3
            own[k, 1] = 1.0 - hat
            own[k, 2] = (1.0 - 2.0 * hat) * own[k, 2] + _form(shot, x)
            own[k, 3] = (1.0 - 2.0 * hat) * own[k, 3] + _form(speckle, x)
        count += n
    return out[:count]


@kernel
def _binned(table: Array) -> Array:
    """Pixels and sums of the other columns of ``table`` (P, 5) in bins of its first (B, 5), finer towards the dark."""
    out, largest = np.zeros((_BINS, 5)), 1e-9
    for i in range(len(table)):
        largest = max(largest, table[i, 0])
    for i in range(len(table)):
        k = min(int(_BINS * math.sqrt(max(table[i, 0], 0.0) / largest)), _BINS - 1)
        out[k, 0] += 1.0
        for c in range(1, 5):
            out[k, c] += table[i, c]
    return out


@kernel
def _add_square(f: Symmetric4, j: Vector4, w: float) -> Symmetric4:
    """F + w j jᵀ."""
    a, b, c, d = w * j.a0, w * j.a1, w * j.a2, w * j.a3
    return Symmetric4(
        f.a00 + a * j.a0, f.a01 + a * j.a1, f.a02 + a * j.a2, f.a03 + a * j.a3, f.a11 + b * j.a1,
        f.a12 + b * j.a2, f.a13 + b * j.a3, f.a22 + c * j.a2, f.a23 + c * j.a3, f.a33 + d * j.a3,
    )  # fmt: skip


@kernel
def _form(f: Symmetric4, x: Vector4) -> float:
    """The form xᵀ F x."""
    a = f.a00 * x.a0 + 2.0 * (f.a01 * x.a1 + f.a02 * x.a2 + f.a03 * x.a3)
    b = f.a11 * x.a1 + 2.0 * (f.a12 * x.a2 + f.a13 * x.a3)
    return float(x.a0 * a + x.a1 * b + x.a2 * (f.a22 * x.a2 + 2.0 * f.a23 * x.a3) + x.a3 * f.a33 * x.a3)


@kernel
def _variances(bins: Array, stated: Array) -> Array:
    """The three variances from the bins of `_binned`; NaN in ``stated`` (3,) asks for one.

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
