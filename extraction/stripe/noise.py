"""The frame's own noise, from what Gaussian fits of some sections leave over."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from extraction.config import StripeConfig
from extraction.linalg import Symmetric4, Vector4, factor4, solve4
from extraction.noise import QUANTISATION_VARIANCE, PixelNoise
from extraction.stripe.fit import Pixels, peak_of
from extraction.stripe.model import SINGULAR, Records, slopes
from extraction.stripe.view import StripeView
from geometry.compiled import kernel

Array = NDArray[np.float64]

_BINS = 24  # of signal
_ROUNDS = 4  # of reweighting; the weights need not be exact
_SIGNIFICANT = 9.0  # of a likelihood ratio: three σ
_MISFIT = 4.0  # a section whose χ² is that many times the median is no Gaussian peak and says nothing on noise


def estimate_noise(
    view: StripeView, section: NDArray[np.int32], fits: Records, config: StripeConfig, dark_dn2: float
) -> PixelNoise:
    """Variance model of the frame by weighted least squares on the fits' squared residuals.

    fits: records of SECTION, all converged (M,), fitted with equal weights. What the config states is taken,
    the rest is estimated; without enough sections ``dark_dn2`` stands for the dark noise. Clipped plateaus say nothing.
    """
    section, fits = section[fits["dof"] > 0], fits[fits["dof"] > 0]
    known = (config.read_noise_dn, config.gain_dn_per_e, config.speckle_contrast)
    variances = [None if k is None else k**power for k, power in zip(known, (2, 1, 2), strict=True)]
    if variances[0] is not None:
        variances[0] += QUANTISATION_VARIANCE
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
    return PixelNoise(max(a, QUANTISATION_VARIANCE), c, view.black_dn, k2)


def _binned_residuals(view: StripeView, section: NDArray[np.int32], fits: Records) -> tuple[Array, Array, Array]:
    """Over pixels of like signal: mean terms (1, μ - black, signal²) (B, 3), mean square residual, pixels (B,)."""
    chi2 = fits["chi2"] / np.maximum(fits["dof"], 1)
    good = chi2 <= _MISFIT * np.median(chi2)
    table = _residuals(view.pixels, section[good], fits[good], view.clip_dn, view.black_dn)
    bins = _binned(table)
    filled = bins[:, 0] > 0
    pixels = bins[filled, 0]
    means = bins[filled, 1:] / pixels[:, None]
    return means[:, :3], means[:, 3], pixels


class SectionNoise(NamedTuple):
    """Room for one section's pixels: slopes of the mean, F⁻¹ of them (n, 4); signal, μ - black, residual (n, 3)."""

    slope: Array
    solved: Array
    level: Array


@kernel
def _residuals(pixels: Pixels, section: NDArray[np.int32], fits: Records, clip: float, black: float) -> Array:
    """Per fitted pixel (P, 5): signal; what unit variances of the three terms leave in the residual; its square.

    The residual of a fit with equal weights is (1 - H) of the noise, H the hat matrix: E r² = Σ (1 - H)² variance.
    """
    most, longest = 0, 0
    for i in range(len(fits)):
        n = fits[i].high - fits[i].low
        most, longest = most + n, max(longest, n)
    out, count = np.empty((most, 5)), 0
    room = SectionNoise(np.empty((longest, 4)), np.empty((longest, 4)), np.empty((longest, 3)))
    slope, level, grey, left_out = room.slope, room.level, pixels.grey, pixels.left_out
    for i in range(len(fits)):
        n, peak = 0, peak_of(fits[i])
        fisher = Symmetric4(0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
        for row in range(fits[i].low, fits[i].high):
            y = float(grey[row, section[i]])
            if y < clip and (left_out.size == 0 or not left_out[row, section[i]]):
                mean, j = slopes(peak, row)
                fisher = _add_square(fisher, j)
                slope[n, 0], slope[n, 1], slope[n, 2], slope[n, 3] = j
                level[n, 0], level[n, 1], level[n, 2] = mean - peak.background, mean - black, y - mean
                n += 1
        definite, factor = factor4(fisher, SINGULAR)
        if definite:
            _spread(room, n, factor, out[count:])
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
def _spread(room: SectionNoise, n: int, factor: Symmetric4, out: Array) -> None:
    """One section's rows of `_residuals`, of its n pixels and the factor of F."""
    slope, solved, level = room.slope, room.solved, room.level
    for a in range(n):
        x = solve4(factor, Vector4(slope[a, 0], slope[a, 1], slope[a, 2], slope[a, 3]))
        solved[a, 0], solved[a, 1], solved[a, 2], solved[a, 3] = x
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
def _add_square(f: Symmetric4, j: Vector4) -> Symmetric4:
    """F + j jᵀ."""
    return Symmetric4(
        f.a00 + j.a0 * j.a0, f.a01 + j.a0 * j.a1, f.a02 + j.a0 * j.a2, f.a03 + j.a0 * j.a3, f.a11 + j.a1 * j.a1,
        f.a12 + j.a1 * j.a2, f.a13 + j.a1 * j.a3, f.a22 + j.a2 * j.a2, f.a23 + j.a2 * j.a3, f.a33 + j.a3 * j.a3,
    )  # fmt: skip


def _non_negative(terms: Array, squares: Array, pixels: Array, variances: Array, free: list[int]) -> Array:
    """The free variances ≥ 0; a squared Gaussian residual has variance 2 v²."""
    from scipy.optimize import nnls  # a third of a second, and most commands need none of it

    out = variances.copy()
    weight = np.sqrt(pixels)
    goal = squares - terms @ variances
    for _ in range(_ROUNDS):
        out[free] = nnls(terms[:, free] * weight[:, None], goal * weight)[0]
        weight = np.sqrt(pixels) / np.maximum(terms @ out, QUANTISATION_VARIANCE)
    return out


def _explains_more(terms: Array, squares: Array, pixels: Array, camera: Array, speckled: Array) -> bool:
    """Whether speckle is significant: without it the flanks, where the position comes from, are weighted better."""
    weight = np.sqrt(pixels / 2) / np.maximum(terms @ camera, QUANTISATION_VARIANCE)
    misfit = [float(np.sum((weight * (squares - terms @ v)) ** 2)) for v in (camera, speckled)]
    return misfit[0] - misfit[1] > _SIGNIFICANT
