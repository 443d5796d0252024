"""Compiled maximum-likelihood fit of one oriented Gaussian spot in a window of pixels.

Model of a pixel (x columns, y rows from the spot's centre u, v; A height, b background, p q the background's slope):

    μ = A exp(-½ (a x² + 2 h x y + c y²)) + b + p i + q j,    (i, j from the window's first pixel)

[a h; h c] is the inverse of (blurred spot's covariance + I/12): adding a pixel's own variance 1/12 is its integration,
right to the fourth order in pixel/σ. The form has no angle, so that round spots are not singular.

Noise of a pixel: V = v₀ + g · (μ - m) + k² · (μ - background)²: what is there at grey level m, shot noise with gain g,
and the speckle's multiplicative term with contrast k. The estimate solves Σ (d - μ) ∂μ / V = 0 by Fisher scoring with
Levenberg's damping, V following μ; where V is that of the camera this is the likelihood's equation up to O(1/signal).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from extraction.compiled import compiled, inner, inner_fast

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

# columns of a fit's parameter vector
U, V, HEIGHT, PREC_UU, PREC_UV, PREC_VV, BACKGROUND, SLOPE_U, SLOPE_V = range(9)
RESULT_COLUMNS = 14  # what `fit_window` writes
PIXEL_VARIANCE_PX2 = 1.0 / 12.0
MIN_VARIANCE_PX2 = 0.03  # narrower than any lens images: one pixel's spike
MAX_STEP_PX = 1.0
STEP_TOLERANCE = 1e-2  # a step below this share of its own standard deviation ends the iteration


@inner_fast
def _weights_and_sums(
    data: Array, use: Mask, p: Array, n: int, noise: Array, weight: Array, fisher: Array, score: Array
) -> float:
    """Fill the weights 1/V and the sums of Fisher scoring in the basis g·(1, x, y, x²/2, xy, y²/2), 1, i, j; → χ²."""
    rows, columns = data.shape
    e = np.zeros(9)
    for r in range(9):
        score[r] = 0.0
        for s in range(9):
            fisher[r, s] = 0.0
    chi2 = 0.0
    v0, gain, level, k2 = noise[0] + noise[4], noise[1], noise[2], noise[3]
    step_ratio = np.exp(-p[3])
    for j in range(rows):
        y = j - p[1]
        x = -p[0]
        g = np.exp(-0.5 * (p[3] * x * x + 2.0 * p[4] * x * y + p[5] * y * y))
        ratio = np.exp(-p[3] * (x + 0.5) - p[4] * y)
        for i in range(columns):
            x = i - p[0]
            if use[j, i]:
                signal = p[2] * g
                mu = signal + p[6] + p[7] * i + p[8] * j
                w = 1.0 / (v0 + gain * max(mu - level, 0.0) + k2 * signal * signal)
                weight[j, i] = w
                residual = data[j, i] - mu
                chi2 += w * residual * residual
                e[0] = g
                e[1] = g * x
                e[2] = g * y
                e[3] = 0.5 * g * x * x
                e[4] = g * x * y
                e[5] = 0.5 * g * y * y
                e[6] = 1.0
                e[7] = i
                e[8] = j
                for r in range(n):
                    we = w * e[r]
                    score[r] += we * residual
                    for s in range(r + 1):
                        fisher[r, s] += we * e[s]
            g *= ratio
            ratio *= step_ratio
    return chi2


@inner_fast
def _chi2(data: Array, use: Mask, p: Array, weight: Array) -> float:
    """Σ weight · residual² of the model ``p``."""
    rows, columns = data.shape
    step_ratio = np.exp(-p[3])
    chi2 = 0.0
    for j in range(rows):
        y = j - p[1]
        x = -p[0]
        g = np.exp(-0.5 * (p[3] * x * x + 2.0 * p[4] * x * y + p[5] * y * y))
        ratio = np.exp(-p[3] * (x + 0.5) - p[4] * y)
        for i in range(columns):
            if use[j, i]:
                residual = data[j, i] - (p[2] * g + p[6] + p[7] * i + p[8] * j)
                chi2 += weight[j, i] * residual * residual
            g *= ratio
            ratio *= step_ratio
    return chi2


@inner
def cholesky(fisher: Array, damping: float, n: int, out: Array) -> bool:
    """Lower factor of fisher + damping · diag(fisher), leading n × n; False where it is not positive definite."""
    for i in range(n):
        for j in range(i + 1):
            total = fisher[i, j]
            if i == j:
                total += damping * fisher[i, i]
            for k in range(j):
                total -= out[i, k] * out[j, k]
            if i == j:
                if not total > 1e-13 * fisher[i, i]:
                    return False
                out[i, i] = np.sqrt(total)
            else:
                out[i, j] = total / out[j, j]
    return True


@inner
def solve(factor: Array, right: Array, n: int, out: Array) -> None:
    """Out = (L Lᵀ)⁻¹ right, leading n."""
    for i in range(n):
        total = right[i]
        for k in range(i):
            total -= factor[i, k] * out[k]
        out[i] = total / factor[i, i]
    for i in range(n - 1, -1, -1):
        total = out[i]
        for k in range(i + 1, n):
            total -= factor[k, i] * out[k]
        out[i] = total / factor[i, i]


@inner
def _moved(p: Array, q: Array, n: int, out: Array) -> bool:
    """Parameters after the step q of the basis coefficients; False where they are no spot any more."""
    height, det = p[2], p[3] * p[5] - p[4] * p[4]
    du = (p[5] * q[1] - p[4] * q[2]) / (det * height)
    dv = (p[3] * q[2] - p[4] * q[1]) / (det * height)
    if not abs(du) + abs(dv) < np.inf:
        return False
    scale = min(1.0, MAX_STEP_PX / max(abs(du), abs(dv), 1e-12))
    out[0] = p[0] + scale * du
    out[1] = p[1] + scale * dv
    # the height and the widths move by factors: they stay positive
    out[2] = height * min(max(1.0 + scale * q[0] / height, 0.3), 3.0)
    for k in range(3, 6):
        out[k] = p[k] - scale * q[k] / height
    for k in range(6, n):
        out[k] = p[k] + scale * q[k]
    for k in range(n, 9):
        out[k] = p[k]
    trace, det = out[3] + out[5], out[3] * out[5] - out[4] * out[4]
    if not (out[2] > 0.0 and det > 0.0 and out[3] > 0.0):
        return False
    return bool(trace < 2.0 / (MIN_VARIANCE_PX2 + PIXEL_VARIANCE_PX2))


@compiled
def fit_window(data: Array, use: Mask, start: Array, n: int, noise: Array, max_iterations: int, out: Array) -> float:
    """Fit one spot in ``data`` (rows, columns) over the pixels ``use``; the compiled core of every ML localisation.

    start: the nine parameters. n: 7 with a constant, 9 with a sloped background.
    noise: v₀, g, m, k², and what the weights add to v₀ for the model's own error.
    out (14,): parameters 0-8, Cov(u, v) as uu, uv, vv 9-11, χ² 12, iterations 13. Returns 1 where it converged, else 0.
    """
    p, trial, q = np.zeros(9), np.zeros(9), np.zeros(9)
    for k in range(9):
        p[k] = start[k]
    weight, fisher, factor = np.zeros(data.shape), np.zeros((9, 9)), np.zeros((9, 9))
    score = np.zeros(9)
    damping, converged, iteration = 0.0, 0.0, 0
    chi2 = _weights_and_sums(data, use, p, n, noise, weight, fisher, score)
    while iteration < max_iterations:
        iteration += 1
        if cholesky(fisher, damping, n, factor):
            solve(factor, score, n, q)
            decrement = 0.0  # the step's length in standard deviations, squared
            for k in range(n):
                decrement += q[k] * score[k]
            if _moved(p, q, n, trial):
                small = decrement < STEP_TOLERANCE * STEP_TOLERANCE
                if small or _chi2(data, use, trial, weight) <= chi2 * (1.0 + 1e-12):
                    for k in range(9):
                        p[k] = trial[k]
                    damping = 0.1 * damping if damping > 1e-4 else 0.0
                    chi2 = _weights_and_sums(data, use, p, n, noise, weight, fisher, score)
                    if small:
                        converged = 1.0
                        break
                    continue
        damping = max(8.0 * damping, 1e-3)
        if damping > 1e9:
            break
    for k in range(9):
        out[k] = p[k]
    _position_covariance(p, fisher, factor, n, out)
    out[12], out[13] = chi2, iteration
    return converged


@inner
def _position_covariance(p: Array, fisher: Array, factor: Array, n: int, out: Array) -> None:
    """Write the inverse Fisher information's (u, v) block to out[9:12]; infinite where it has none."""
    out[9], out[10], out[11] = np.inf, 0.0, np.inf
    if not cholesky(fisher, 0.0, n, factor):
        return
    unit, first, second = np.zeros(9), np.zeros(9), np.zeros(9)
    unit[1] = 1.0
    solve(factor, unit, n, first)
    unit[1], unit[2] = 0.0, 1.0
    solve(factor, unit, n, second)
    # (q₁, q₂) = A · P · (du, dv) with P the spot's precision matrix
    det = (p[3] * p[5] - p[4] * p[4]) * p[2]
    s00, s01, s11 = p[5] / det, -p[4] / det, p[3] / det
    c00, c01, c11 = first[1], first[2], second[2]
    out[9] = s00 * s00 * c00 + 2 * s00 * s01 * c01 + s01 * s01 * c11
    out[10] = s00 * s01 * c00 + (s00 * s11 + s01 * s01) * c01 + s01 * s11 * c11
    out[11] = s01 * s01 * c00 + 2 * s01 * s11 * c01 + s11 * s11 * c11


def model_planes(parameters: Array, shape: tuple[int, ...]) -> tuple[Array, Array, Array]:
    """The model's bell and x, y from the spots (N, R, C) over windows of one shape, for parameters (N, 9).

    The same model as the compiled one, for whole stacks.
    """
    p = parameters[:, :, None, None]
    x, y = np.arange(shape[1]) - p[:, U], np.arange(shape[0])[:, None] - p[:, V]
    bell = np.exp(-0.5 * (p[:, PREC_UU] * x * x + 2.0 * p[:, PREC_UV] * x * y + p[:, PREC_VV] * y * y))
    return bell, x, y
