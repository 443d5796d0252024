"""Mean and σ of normal noise before a converter rounded it to whole grey levels and cut it at 0."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from geometry.special import ndtr

Array = NDArray[np.float64]

SIGMAS = 32  # that are tried
HALVINGS = 30  # of the interval that holds the mean
SMALLEST_DN = 0.1  # below, of a hundred thousand pixels none leaves its level
FAR = 6.0  # σ beyond which no pixel lies
WIDE_DN = 1.0  # σ from which rounding adds 1/12 to the variance and no more


def unrounded(mean_dn: float, variance_dn2: float) -> tuple[float, float]:
    """Mean and σ of the noise, of the mean and variance of its rounded values.

    Of two and more levels both follow outright (Sheppard's correction is their limit for wide noise); where all pixels
    show one level σ is SMALLEST_DN.
    """
    wide = math.sqrt(max(variance_dn2 - 1 / 12, 0.0))
    if wide > WIDE_DN and mean_dn > FAR * wide:
        return mean_dn, wide
    sigma = np.geomspace(SMALLEST_DN, 2 * math.sqrt(variance_dn2) + 2 * SMALLEST_DN, SIGMAS)
    first = max(0, math.floor(mean_dn - FAR * sigma[-1]))
    edges = np.arange(first, math.ceil(mean_dn + FAR * sigma[-1]) + 1) + 0.5
    low, high = mean_dn - 1 - FAR * sigma, mean_dn + 1 + sigma
    for _ in range(HALVINGS):
        middle = (low + high) / 2
        less = _moments(middle, sigma, edges, first)[0] < mean_dn
        low, high = np.where(less, middle, low), np.where(less, high, middle)
    variance = np.maximum.accumulate(_moments(high, sigma, edges, first)[1])
    at = float(np.interp(variance_dn2, variance, sigma))
    return float(np.interp(at, sigma, high)), at


def _moments(mean: Array, sigma: Array, edges: Array, first: int) -> tuple[Array, Array]:
    """Mean and variance of the rounded values, of noise of means and σ (S,); levels step at edges, the least is
    ``first``.
    """
    above = ndtr((mean[:, None] - edges) / sigma[:, None])
    steps = np.arange(len(edges))
    one = above.sum(1)
    return first + one, ((2 * steps + 1) * above).sum(1) - one**2
