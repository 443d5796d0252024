"""The frame's own noise, from what Gaussian fits of some sections leave over."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import nnls

from extraction.stripe_config import StripeConfig
from extraction.stripe_fit import AMPLITUDE, BACKGROUND, CENTRE, CHI2, DOF, HIGH, LOW, WIDTH, NoiseModel

Array = NDArray[np.float64]

QUANTISATION_DN2 = 1.0 / 12.0
_ROUNDS = 4  # of reweighting; the weights need not be exact
_SIGNIFICANT = 9.0  # of a likelihood ratio: three σ
_MISFIT = 4.0  # a section whose χ² is that many times the median is no Gaussian peak and says nothing on noise


def estimate_noise(
    image: NDArray[np.generic], section: NDArray[np.int32], fits: Array, black_dn: float, config: StripeConfig
) -> NoiseModel:
    """Variance model of the frame by weighted least squares on squared residuals, each over 1 - its leverage.

    fits: rows of `fit_sections`, all converged (M, 12). What the config states is taken, the rest is estimated;
    without enough sections the noise is quantisation alone.
    """
    known = (config.read_noise_dn, config.gain_dn_per_e, config.speckle_contrast)
    variances = [None if k is None else k**power for k, power in zip(known, (2, 1, 2), strict=True)]
    if variances[0] is not None:
        variances[0] += QUANTISATION_DN2
    if None in variances and len(fits) >= 8:
        free = [i for i, v in enumerate(variances) if v is None]
        terms, squares = _squared_residuals(image, section, fits, black_dn)
        start = np.array([0.0 if v is None else v for v in variances])
        variances = list(_non_negative(terms, squares, start, free))
        if 2 in free and len(free) > 1:
            camera = _non_negative(terms, squares, start, free[:-1])
            if not _explains_more(terms, squares, camera, np.array(variances)):
                variances = list(camera)
    a, c, k2 = (0.0 if v is None else float(v) for v in variances)
    return NoiseModel(max(a, QUANTISATION_DN2), c, float(np.sqrt(k2)), black_dn)


def _squared_residuals(
    image: NDArray[np.generic], section: NDArray[np.int32], fits: Array, black_dn: float
) -> tuple[Array, Array]:
    """Per pixel: the three terms (1, μ - black, signal²) (P, 3), and residual² over 1 - leverage (P,)."""
    chi2 = fits[:, CHI2] / np.maximum(fits[:, DOF], 1)
    good = chi2 <= _MISFIT * np.median(chi2)
    fits, section = fits[good], section[good]
    offset = np.arange(int(np.max(fits[:, HIGH] - fits[:, LOW])))
    row = fits[:, LOW, None] + offset  # (M, n)
    inside = row < fits[:, HIGH, None]
    y = image[np.where(inside, row, fits[:, LOW, None]).astype(int), section[:, None]].astype(float)
    t = (row - fits[:, CENTRE, None]) / fits[:, WIDTH, None]
    bell = np.exp(-0.5 * t * t)
    signal = fits[:, AMPLITUDE, None] * bell
    mean = signal + fits[:, BACKGROUND, None]
    slopes = np.stack([signal * t, bell, signal * t * t, np.ones_like(t)], -1) * inside[..., None]
    normal = np.swapaxes(slopes, 1, 2) @ slopes
    normal[:, range(4), range(4)] *= 1 + 1e-9
    leverage = np.sum((slopes @ np.linalg.inv(normal)) * slopes, axis=-1)
    keep = inside & (leverage < 0.8)
    squares = (y - mean)[keep] ** 2 / (1 - leverage[keep])
    return np.column_stack([np.ones(keep.sum()), np.maximum(mean[keep] - black_dn, 0), signal[keep] ** 2]), squares


def _non_negative(terms: Array, squares: Array, variances: Array, free: list[int]) -> Array:
    """The free variances ≥ 0; a squared Gaussian residual has variance 2 v²."""
    out = variances.copy()
    weight = np.ones(len(squares))
    for _ in range(_ROUNDS):
        goal = squares - terms @ variances
        out[free] = nnls(terms[:, free] * weight[:, None], goal * weight)[0]
        weight = 1 / np.maximum(terms @ out, QUANTISATION_DN2)
    return out


def _explains_more(terms: Array, squares: Array, camera: Array, speckled: Array) -> bool:
    """Whether speckle is significant: without it the flanks, where the position comes from, are weighted better."""
    weight = 1 / np.maximum(terms @ camera, QUANTISATION_DN2)
    misfit = [float(np.sum((weight * (squares - terms @ v)) ** 2)) / 2 for v in (camera, speckled)]
    return misfit[0] - misfit[1] > _SIGNIFICANT
