"""The model of a stripe's section: a Gaussian on a background, and its fit by Fisher scoring."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from extraction.gaussian import bell_row
from extraction.linalg import Symmetric4, Vector4, factor4, solve4
from extraction.noise import PixelNoise, pixel_variance
from geometry.compiled import kernel

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]
Records = NDArray[np.void]

FEWEST_PIXELS = 5  # four parameters and one to spare
SINGULAR = 1e-12  # a peak narrower than a pixel is not told from its background any more
STEPS = 30  # most of a fit; a stripe's section takes four to six
ATOL_PX = 5e-4  # last step of centre and width; the error after it is far smaller, as the steps halve their digits
SHRINK, GROW = 0.6, 1.6  # of the width in one step: beyond, the quadratic form does not hold
LEAST_AMPLITUDE = 0.3  # of the amplitude after a step


class Peak(NamedTuple):
    """Centre [px], amplitude [DN], Gaussian σ [px], background [DN]."""

    centre: float
    amplitude: float
    width: float
    background: float


class Limits(NamedTuple):
    """The smallest grey level that is clipped, smallest and largest σ [px]."""

    clip: float
    min_width: float
    max_width: float


class WidthPrior(NamedTuple):
    """The width that is expected, and the weight 1/variance of that expectation."""

    width: float
    weight: float


class SectionPixels(NamedTuple):
    """Room for the pixels of one section: places along it, grey levels, whether used, and the bell there."""

    x: Array
    y: Array
    use: Mask
    bell: Array


class NormalEquations(NamedTuple):
    """Normal equations by centre, amplitude, σ and background: Fisher information and score; χ²."""

    fisher: Symmetric4
    score: Vector4
    chi2: float


class Climb(NamedTuple):
    """Where a fit ended: whether it settled, the peak, the Fisher information before the last step, χ² there."""

    settled: bool
    peak: Peak
    fisher: Symmetric4
    chi2: float


@kernel
def room(n: int) -> SectionPixels:
    """Room for sections of at most n pixels."""
    return SectionPixels(np.empty(n), np.empty(n), np.ones(n, np.bool_), np.empty(n))


@kernel
def climb(samples: SectionPixels, n: int, start: Peak, limits: Limits, noise: PixelNoise, prior: WidthPrior) -> Climb:
    """Fit the first n samples from ``start``.

    The weights are those of the fitted mean, not of the data (quasi-likelihood): efficient and without their bias.
    SectionPlaces are 0, 1, 2 … or any others within 0 … the last.
    """
    x, bell = samples.x, samples.bell[:n]
    even = x[n - 1] == n - 1 and x[0] == 0
    low, high = x[0], x[0]
    for i in range(1, n):
        low, high = min(low, x[i]), max(high, x[i])
    peak = start
    zero = Symmetric4(0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    fisher, chi2 = zero, 0.0
    for _ in range(STEPS):
        if even:
            bell_row(peak.centre, 1.0 / (peak.width * peak.width), 0.0, 0.0, bell)
        else:
            for i in range(n):
                bell[i] = math.exp(-0.5 * ((x[i] - peak.centre) / peak.width) ** 2)
        normal = _normal_equations(samples, n, peak, noise, prior)
        fisher, chi2 = normal.fisher, normal.chi2
        definite, factor = factor4(fisher, SINGULAR)
        if not definite:
            return Climb(False, peak, fisher, chi2)
        step = solve4(factor, normal.score)
        shift = min(max(step.a0, -peak.width), peak.width)
        width = min(max(peak.width + step.a2, SHRINK * peak.width), GROW * peak.width)
        change = abs(shift) + abs(width - peak.width)
        peak = Peak(
            peak.centre + shift,
            max(peak.amplitude + step.a1, LEAST_AMPLITUDE * peak.amplitude),
            min(max(width, 0.5 * limits.min_width), 2.0 * limits.max_width),  # room beyond what is accepted
            peak.background + step.a3,
        )
        if not low <= peak.centre <= high:
            return Climb(False, peak, fisher, chi2)
        if change < ATOL_PX:
            return Climb(True, peak, fisher, chi2)
    return Climb(False, peak, fisher, chi2)


@kernel(fastmath=True)
def _normal_equations(
    samples: SectionPixels, n: int, peak: Peak, noise: PixelNoise, prior: WidthPrior
) -> NormalEquations:
    """F = Σ w ∂μ ∂μᵀ, score Σ w r ∂μ and χ² = Σ w r² with w = 1 / variance at the fitted mean; the prior with them."""
    x, y, use, bell = samples.x, samples.y, samples.use, samples.bell
    f00 = f01 = f02 = f03 = f11 = f12 = f13 = f22 = f23 = f33 = 0.0
    g0 = g1 = g2 = g3 = chi2 = 0.0
    inverse = 1 / peak.width
    for i in range(n):
        t = (x[i] - peak.centre) * inverse
        signal = peak.amplitude * bell[i]
        mean = signal + peak.background
        w = 1 / pixel_variance(noise, mean, signal)
        w = w if use[i] else 0.0
        j0, j1, j2 = signal * t * inverse, bell[i], signal * t * t * inverse
        r = y[i] - mean
        w0, w1, w2 = w * j0, w * j1, w * j2
        f00, f01, f02, f03 = f00 + w0 * j0, f01 + w0 * j1, f02 + w0 * j2, f03 + w0
        f11, f12, f13 = f11 + w1 * j1, f12 + w1 * j2, f13 + w1
        f22, f23, f33 = f22 + w2 * j2, f23 + w2, f33 + w
        g0, g1, g2, g3 = g0 + w0 * r, g1 + w1 * r, g2 + w2 * r, g3 + w * r
        chi2 += w * r * r
    f22 += prior.weight
    g2 += prior.weight * (prior.width - peak.width)
    return NormalEquations(Symmetric4(f00, f01, f02, f03, f11, f12, f13, f22, f23, f33), Vector4(g0, g1, g2, g3), chi2)


@kernel
def centre_variance(fisher: Symmetric4) -> float:
    """Variance of the centre, a diagonal term of F⁻¹; infinite where singular."""
    definite, factor = factor4(fisher, SINGULAR)
    return solve4(factor, Vector4(1.0, 0.0, 0.0, 0.0)).a0 if definite else np.inf


@kernel
def slopes(peak: Peak, place: float) -> tuple[float, Vector4]:
    """The mean at a place, and its derivatives by the parameters, lengths in σ."""
    t = (place - peak.centre) / peak.width
    bell = math.exp(-0.5 * t * t)
    signal = peak.amplitude * bell
    return signal + peak.background, Vector4(signal * t, bell, signal * t * t, 1.0)
