"""The frame's own noise, from what Gaussian fits of some sections leave over."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import nnls

from extraction.config import StripeConfig
from extraction.stripe.columns import AMPLITUDE, BACKGROUND, CENTRE, CHI2, DOF, HIGH, LOW, WIDTH
from extraction.stripe.fit import NoiseModel
from extraction.stripe.solve import TERMS, back, factor
from extraction.stripe.view import StripeView
from geometry.compiled import kernel

Array = NDArray[np.float64]

QUANTISATION_DN2 = 1.0 / 12.0
_BINS = 24  # of signal
_ROUNDS = 4  # of reweighting; the weights need not be exact
_SIGNIFICANT = 9.0  # of a likelihood ratio: three σ
_MISFIT = 4.0  # a section whose χ² is that many times the median is no Gaussian peak and says nothing on noise


def estimate_noise(
    view: StripeView, section: NDArray[np.int32], fits: Array, config: StripeConfig, dark_dn2: float
) -> NoiseModel:
    """Variance model of the frame by weighted least squares on the fits' squared residuals.

    fits: rows of `fit_sections`, all converged (M, 12), fitted with equal weights. What the config states is taken,
    the rest is estimated; without enough sections ``dark_dn2`` stands for the dark noise. Clipped plateaus say nothing.
    """
    section, fits = section[fits[:, DOF] > 0], fits[fits[:, DOF] > 0]
    known = (config.read_noise_dn, config.gain_dn_per_e, config.speckle_contrast)
    variances = [None if k is None else k**power for k, power in zip(known, (2, 1, 2), strict=True)]
    if variances[0] is not None:
        variances[0] += QUANTISATION_DN2
    if None in variances and len(fits) >= 8:
        free = [i for i, v in enumerate(variances) if v is None]
        terms, squares, pixels = _binned_residuals(view, section, fits)
        start = np.array([0.0 if v is None else v for v in variances])
        variances = list(_non_negative(terms, squares, pixels, start, free))
        if 2 in free and len(free) > 1:
            camera = _non_negative(terms, squares, pixels, start, free[:-1])
            if not _explains_more(terms, squares, pixels, camera, np.array(variances)):
                variances = list(camera)
    elif variances[0] is None:
        variances[0] = dark_dn2
    a, c, k2 = (0.0 if v is None else float(v) for v in variances)
    return NoiseModel(max(a, QUANTISATION_DN2), c, float(np.sqrt(k2)), view.black_dn)


def _binned_residuals(view: StripeView, section: NDArray[np.int32], fits: Array) -> tuple[Array, Array, Array]:
    """Over pixels of like signal: mean terms (1, μ - black, signal²) (B, 3), mean square residual, pixels (B,)."""
    chi2 = fits[:, CHI2] / np.maximum(fits[:, DOF], 1)
    good = chi2 <= _MISFIT * np.median(chi2)
    place = view.grey, view.left_out, view.clip_dn, view.black_dn
    table = _residuals(*place, section[good], fits[good])
    bins = _binned(table)
    filled = bins[:, 0] > 0
    pixels = bins[filled, 0]
    means = bins[filled, 1:] / pixels[:, None]
    return means[:, :3], means[:, 3], pixels


@kernel
def _residuals(
    grey: NDArray[np.generic],
    left_out: NDArray[np.bool_],
    clip: float,
    black: float,
    section: NDArray[np.int32],
    fits: Array,
) -> Array:
    """Per fitted pixel (P, 5): signal; what unit variances of the three terms leave in the residual; its square.

    The residual of a fit with equal weights is (1 - H) of the noise, H the hat matrix: E r² = Σ (1 - H)² variance.
    """
    most, longest = 0, 0
    for i in range(len(fits)):
        n = int(fits[i, HIGH] - fits[i, LOW])
        most, longest = most + n, max(longest, n)
    out, count = np.empty((most, 5)), 0
    slope, solved, level = np.empty((longest, 4)), np.empty((longest, 4)), np.empty((longest, 3))
    work, u = np.zeros(TERMS), np.empty(10)
    for i in range(len(fits)):
        n = 0
        for k in range(10):
            work[k] = 0.0
        for row in range(int(fits[i, LOW]), int(fits[i, HIGH])):
            y = float(grey[row, section[i]])
            if y < clip and (left_out.size == 0 or not left_out[row, section[i]]):
                mean = _slopes(fits[i], row, slope[n])
                _add_square(slope[n], work)
                level[n, 0], level[n, 1], level[n, 2] = mean - fits[i, BACKGROUND], mean - black, y - mean
                n += 1
        if factor(work, u):
            _spread(slope, solved, level, n, u, out[count:])
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


@kernel(fastmath=True)
def _spread(slope: Array, solved: Array, level: Array, n: int, u: Array, out: Array) -> None:
    """One section's rows of `_residuals`; level: signal, μ - black and residual (n, 3)."""
    for a in range(n):
        back(u, slope[a, 0], slope[a, 1], slope[a, 2], slope[a, 3], solved[a])
    for a in range(n):
        out[a, 0], out[a, 1], out[a, 2], out[a, 3] = level[a, 0], 0.0, 0.0, 0.0
        out[a, 4] = level[a, 2] ** 2
        for b in range(n):
            hat = 0.0
            for k in range(4):
                hat += solved[a, k] * slope[b, k]
            share = (1.0 - hat if a == b else hat) ** 2
            out[a, 1] += share
            out[a, 2] += share * max(level[b, 1], 0.0)
            out[a, 3] += share * level[b, 0] ** 2


@kernel
def _slopes(fit: Array, row: int, j: Array) -> float:
    """The mean at a pixel, its derivatives by centre, amplitude, σ and background (lengths in σ) in ``j``."""
    t = (row - fit[CENTRE]) / fit[WIDTH]
    bell = math.exp(-0.5 * t * t)
    signal = fit[AMPLITUDE] * bell
    j[0], j[1], j[2], j[3] = signal * t, bell, signal * t * t, 1.0
    return float(signal + fit[BACKGROUND])


@kernel
def _add_square(j: Array, work: Array) -> None:
    """Add j jᵀ to the upper triangle by rows."""
    k = 0
    for a in range(4):
        for b in range(a, 4):
            work[k] += j[a] * j[b]
            k += 1


def _non_negative(terms: Array, squares: Array, pixels: Array, variances: Array, free: list[int]) -> Array:
    """The free variances ≥ 0; a squared Gaussian residual has variance 2 v²."""
    out = variances.copy()
    weight = np.sqrt(pixels)
    goal = squares - terms @ variances
    for _ in range(_ROUNDS):
        out[free] = nnls(terms[:, free] * weight[:, None], goal * weight)[0]
        weight = np.sqrt(pixels) / np.maximum(terms @ out, QUANTISATION_DN2)
    return out


def _explains_more(terms: Array, squares: Array, pixels: Array, camera: Array, speckled: Array) -> bool:
    """Whether speckle is significant: without it the flanks, where the position comes from, are weighted better."""
    weight = np.sqrt(pixels / 2) / np.maximum(terms @ camera, QUANTISATION_DN2)
    misfit = [float(np.sum((weight * (squares - terms @ v)) ** 2)) for v in (camera, speckled)]
    return misfit[0] - misfit[1] > _SIGNIFICANT
