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

from geometry.compiled import kernel

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]
Work = tuple[Array, Array, Array]  # moments (5, 5, 5), a row's sums (5, 5), a row's bell (C,)

# the terms are bells (the first six) or one, times x^POWER_X y^POWER_Y FACTOR
POWER_X = np.array([0, 1, 0, 2, 1, 0, 0, 1, 0])
POWER_Y = np.array([0, 0, 1, 0, 1, 2, 0, 0, 1])
FACTOR = np.array([1.0, 1.0, 1.0, 0.5, 1.0, 0.5, 1.0, 1.0, 1.0])
RESULT_COLUMNS = 14  # what `fit_window` writes
PIXEL_VARIANCE_PX2 = 1.0 / 12.0
MIN_VARIANCE_PX2 = 0.03  # narrower than any lens images: one pixel's spike
MAX_STEP_PX = 1.0
WIDEST = 0.25  # variance along a spot, in squares of the window's side, beyond which a fit is given up
MOST_DAMPING = 1e3  # where even so short a step does not help, the spot is no Gaussian: a spark at MIN_VARIANCE_PX2
STEP_TOLERANCE = 1e-2  # a step below this share of its own standard deviation ends the iteration
LATE, LATE_TOLERANCE = 10, 0.1  # after so many steps: weights that follow the fit can make it swing by a little


@kernel(fastmath=True)
def _bell_row(p: Array, y: float, bell: Array) -> None:
    """exp(-½ (a x² + 2 h x y + c y²)) along a row, outwards from its largest pixel by recurrence."""
    n = len(bell)
    first = int(min(max(p[0] - p[4] * y / p[3] + 0.5, 0.0), n - 1.0))
    x, curve = first - p[0], np.exp(-p[3])
    value = np.exp(-0.5 * (p[3] * x * x + 2.0 * p[4] * x * y + p[5] * y * y))
    ratio = np.exp(-p[3] * (x + 0.5) - p[4] * y)
    back, left = curve / ratio, value
    bell[first] = value
    for i in range(first + 1, n):
        value *= ratio
        ratio *= curve
        bell[i] = value
    for i in range(first - 1, -1, -1):
        left *= back
        back *= curve
        bell[i] = left


@kernel(fastmath=True)
def _row_sums(
    data: Array, use: Mask, bell: Array, p: Array, level: float, noise: Array, old: Array, weight: Array, sums: Array
) -> tuple[float, float]:
    """Write one row's weights 1/V and its sums by powers of x to ``sums`` (5, 5); → χ² with old and with new weights.

    level: the row's background at x = 0. sums: of w g², w g, w, w r g, w r with g the bell and r the residual.
    """
    v0, gain, dark, k2, slope = noise[0] + noise[4], noise[1], noise[2], noise[3], p[7]
    a0 = a1 = a2 = a3 = a4 = b0 = b1 = b2 = b3 = c0 = c1 = c2 = 0.0
    d0 = d1 = d2 = e0 = e1 = before = chi2 = 0.0
    for i in range(len(bell)):
        x, g = i - p[0], bell[i]
        signal = p[2] * g
        mu = signal + level + slope * x
        w = 1.0 / (v0 + gain * max(mu - dark, 0.0) + k2 * signal * signal)
        w = w if use[i] else 0.0
        r = data[i] - mu
        before += old[i] * r * r
        weight[i] = w
        wg, wr, xx = w * g, w * r, x * x
        wgg, wrg = wg * g, wr * g
        a0, a1, a2, a3, a4 = a0 + wgg, a1 + wgg * x, a2 + wgg * xx, a3 + wgg * xx * x, a4 + wgg * xx * xx
        b0, b1, b2, b3 = b0 + wg, b1 + wg * x, b2 + wg * xx, b3 + wg * xx * x
        c0, c1, c2 = c0 + w, c1 + w * x, c2 + w * xx
        d0, d1, d2 = d0 + wrg, d1 + wrg * x, d2 + wrg * xx
        e0, e1, chi2 = e0 + wr, e1 + wr * x, chi2 + wr * r
    sums[0, 0], sums[0, 1], sums[0, 2], sums[0, 3], sums[0, 4] = a0, a1, a2, a3, a4
    sums[1, 0], sums[1, 1], sums[1, 2], sums[1, 3] = b0, b1, b2, b3
    sums[2, 0], sums[2, 1], sums[2, 2] = c0, c1, c2
    sums[3, 0], sums[3, 1], sums[3, 2] = d0, d1, d2
    sums[4, 0], sums[4, 1] = e0, e1
    return before, chi2


@kernel
def _scoring_sums(
    data: Array, use: Mask, p: Array, noise: Array, old: Array, weight: Array, work: Work, fisher: Array, score: Array
) -> tuple[float, float]:
    """Weights 1/V and the sums of Fisher scoring at p; → χ² with the weights ``old`` and with the new ones.

    The terms are g·(1, x, y, x²/2, xy, y²/2), 1, x, y with g the bell: all sums are moments about the centre.
    """
    moments, sums, bell = work
    moments[:] = 0.0
    before, chi2 = 0.0, 0.0
    for j in range(data.shape[0]):
        y = j - p[1]
        _bell_row(p, y, bell)
        level = p[6] + p[7] * p[0] + p[8] * j
        change = _row_sums(data[j], use[j], bell, p, level, noise, old[j], weight[j], sums)
        before, chi2 = before + change[0], chi2 + change[1]
        for kind in range(5):
            degree, power = 4 - kind if kind < 2 else (1 if kind == 4 else 2), 1.0
            for b in range(degree + 1):
                for a in range(degree + 1 - b):
                    moments[kind, a, b] += sums[kind, a] * power
                power *= y
    _assemble(moments, fisher, score)
    return before, chi2


@kernel
def _assemble(moments: Array, fisher: Array, score: Array) -> None:
    """The lower triangle of the Fisher information (9, 9) and the score (9,) from the moments (5, 5, 5)."""
    for r in range(9):
        for s in range(r + 1):
            kind = 0 if r < 6 else (1 if s < 6 else 2)
            fisher[r, s] = FACTOR[r] * FACTOR[s] * moments[kind, POWER_X[r] + POWER_X[s], POWER_Y[r] + POWER_Y[s]]
        score[r] = FACTOR[r] * moments[3 if r < 6 else 4, POWER_X[r], POWER_Y[r]]


@kernel
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


@kernel
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


@kernel
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
    out[6], out[7], out[8] = p[6] + scale * q[6], p[7], p[8]
    if n == 9:  # the slopes' terms are about the spot's centre
        out[6] -= scale * (q[7] * p[0] + q[8] * p[1])
        out[7] += scale * q[7]
        out[8] += scale * q[8]
    trace, det = out[3] + out[5], out[3] * out[5] - out[4] * out[4]
    if not (out[2] > 0.0 and det > 0.0 and out[3] > 0.0):
        return False
    return bool(trace < 2.0 / (MIN_VARIANCE_PX2 + PIXEL_VARIANCE_PX2))


@kernel
def fit_window(data: Array, use: Mask, start: Array, n: int, noise: Array, max_iterations: int, out: Array) -> float:
    """Fit one spot in ``data`` (rows, columns) over the pixels ``use``; the compiled core of every ML localisation.

    start: the nine parameters. n: 7 with a constant, 9 with a sloped background.
    noise: v₀, g, m, k², and what the weights add to v₀ for the model's own error.
    out (14,): parameters 0-8, Cov(u, v) as uu, uv, vv 9-11, χ² 12, iterations 13. Returns 1 where it converged, else 0.
    """
    p, trial, q = start[:9].copy(), np.zeros(9), np.zeros(9)
    weight, fisher, score = np.zeros(data.shape), np.zeros((9, 9)), np.zeros(9)
    next_weight, next_fisher, next_score = np.zeros(data.shape), np.zeros((9, 9)), np.zeros(9)
    factor, work = np.zeros((9, 9)), (np.zeros((5, 5, 5)), np.zeros((5, 5)), np.empty(data.shape[1]))
    damping, converged, iteration = 0.0, 0.0, 0
    chi2 = _scoring_sums(data, use, p, noise, weight, weight, work, fisher, score)[1]
    while iteration < max_iterations and converged == 0.0 and damping <= MOST_DAMPING:
        iteration += 1
        if cholesky(fisher, damping, n, factor):
            solve(factor, score, n, q)
            decrement = 0.0  # the step's length in standard deviations, squared
            for k in range(n):
                decrement += q[k] * score[k]
            if _moved(p, q, n, trial):
                small = decrement < (STEP_TOLERANCE if iteration <= LATE else LATE_TOLERANCE) ** 2
                same, new = _scoring_sums(data, use, trial, noise, weight, next_weight, work, next_fisher, next_score)
                if small or same <= chi2 * (1.0 + 1e-12):
                    p, trial, chi2 = trial, p, new
                    weight, next_weight = next_weight, weight
                    fisher, next_fisher, score, next_score = next_fisher, fisher, next_score, score
                    damping = 0.1 * damping if damping > 1e-4 else 0.0
                    converged = 1.0 if small else 0.0
                    if (p[3] + p[5]) > WIDEST * max(data.shape) ** 2 * (p[3] * p[5] - p[4] * p[4]):
                        break  # a stripe's piece: no end within the window
                    if not (-1.0 < p[0] < data.shape[1] and -1.0 < p[1] < data.shape[0]):
                        break
                    continue
        damping = max(8.0 * damping, 1e-3)
    for k in range(9):
        out[k] = p[k]
    _position_covariance(p, fisher, factor, n, out)
    out[12], out[13] = chi2, iteration
    return converged


@kernel
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
