"""Fisher scoring of one Gaussian peak: parameters p = (centre, amplitude, σ, background)."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from geometry.compiled import kernel

Array = NDArray[np.float64]

STEPS = 30
_SINGULAR = 1e-12
TERMS = 15  # of the normal equations: F's upper triangle by rows (10), gradient (4), χ²
_ATOL_PX = 5e-4  # last step of centre and width; the error after it is far smaller


@kernel
def climb(
    x: Array,
    y: Array,
    use: NDArray[np.bool_],
    n: int,
    p: Array,
    bell: Array,
    limits: tuple[float, float, float],
    noise: Array,
    prior: tuple[float, float],
    work: Array,
) -> float:
    """Improve ``p`` in place on ``n`` grey levels y at places x; returns 1 where converged, with F and χ² in ``work``.

    The weights are those of the fitted mean, not of the data (quasi-likelihood): efficient and without their bias.
    x: places along the section: 0, 1, 2 … or any others within 0 … the last.
    limits: saturation, smallest and largest σ. noise: `NoiseModel.as_array`. bell: scratch (n,).
    prior: expected σ and the weight 1/variance of that expectation.
    """
    step = np.empty(4)
    even = x[n - 1] == n - 1 and x[0] == 0
    low, high = x[0], x[0]
    for i in range(1, n):
        low, high = min(low, x[i]), max(high, x[i])
    for _ in range(STEPS):
        if even:
            _even_bell(p[0], p[2], n, bell)
        else:
            for i in range(n):
                bell[i] = math.exp(-0.5 * ((x[i] - p[0]) / p[2]) ** 2)
        _normal_equations(x, y, use, n, p, bell, noise, work)
        work[7] += prior[1]
        work[12] += prior[1] * (prior[0] - p[2])
        if not _solve(work, step):
            return 0.0
        shift = min(max(step[0], -p[2]), p[2])
        wider = min(max(p[2] + step[2], 0.6 * p[2]), 1.6 * p[2])
        change = abs(shift) + abs(wider - p[2])
        p[0] += shift
        p[1] = max(p[1] + step[1], 0.3 * p[1])
        p[2] = min(max(wider, 0.5 * limits[1]), 2 * limits[2])
        p[3] += step[3]
        if not low <= p[0] <= high:
            return 0.0
        if change < _ATOL_PX:
            return 1.0
    return 0.0


@kernel
def _even_bell(centre: float, width: float, n: int, bell: Array) -> None:
    """exp(-d²/2σ²) at 0 … n - 1, outwards from the centre by recurrence: three exponentials in all."""
    first = min(max(int(centre + 0.5), 0), n - 1)
    k = 0.5 / (width * width)
    d = first - centre
    peak, curve = math.exp(-k * d * d), math.exp(-2 * k)
    ratio, value = math.exp(-k * (2 * d + 1)), peak
    back = curve / ratio
    bell[first] = peak
    for i in range(first + 1, n):
        value *= ratio
        ratio *= curve
        bell[i] = value
    value = peak
    for i in range(first - 1, -1, -1):
        value *= back
        back *= curve
        bell[i] = value


@kernel(fastmath=True)
def _normal_equations(
    x: Array, y: Array, use: NDArray[np.bool_], n: int, p: Array, bell: Array, noise: Array, work: Array
) -> None:
    """F = Σ w ∂μ ∂μᵀ, gradient Σ w r ∂μ and χ² = Σ w r², with w = 1 / variance at the fitted mean."""
    f00 = f01 = f02 = f03 = f11 = f12 = f13 = f22 = f23 = f33 = 0.0
    g0 = g1 = g2 = g3 = chi2 = 0.0
    inverse = 1 / p[2]
    for i in range(n):
        t = (x[i] - p[0]) * inverse
        signal = p[1] * bell[i]
        mean = signal + p[3]
        w = 1 / (noise[0] + noise[1] * max(mean - noise[3], 0.0) + noise[2] * signal * signal)
        w = w if use[i] else 0.0
        j0, j1, j2 = signal * t * inverse, bell[i], signal * t * t * inverse
        r = y[i] - mean
        w0, w1, w2 = w * j0, w * j1, w * j2
        f00, f01, f02, f03 = f00 + w0 * j0, f01 + w0 * j1, f02 + w0 * j2, f03 + w0
        f11, f12, f13 = f11 + w1 * j1, f12 + w1 * j2, f13 + w1
        f22, f23, f33 = f22 + w2 * j2, f23 + w2, f33 + w
        g0, g1, g2, g3 = g0 + w0 * r, g1 + w1 * r, g2 + w2 * r, g3 + w * r
        chi2 += w * r * r
    work[0], work[1], work[2], work[3], work[4] = f00, f01, f02, f03, f11
    work[5], work[6], work[7], work[8], work[9] = f12, f13, f22, f23, f33
    work[10], work[11], work[12], work[13], work[14] = g0, g1, g2, g3, chi2


@kernel
def factor(work: Array, u: Array) -> bool:
    """F = UᵀDU by rows, D's reciprocals on the diagonal (10,); False where F is not positive definite."""
    if not work[0] > 0:
        return False
    u[0] = 1 / work[0]
    u[1], u[2], u[3] = work[1] * u[0], work[2] * u[0], work[3] * u[0]
    d1 = work[4] - u[1] * work[1]
    if not d1 > _SINGULAR * work[4]:
        return False
    u[4] = 1 / d1
    e12, e13 = work[5] - u[1] * work[2], work[6] - u[1] * work[3]
    u[5], u[6] = e12 * u[4], e13 * u[4]
    d2 = work[7] - u[2] * work[2] - u[5] * e12
    if not d2 > _SINGULAR * work[7]:
        return False
    u[7] = 1 / d2
    e23 = work[8] - u[2] * work[3] - u[5] * e13
    u[8] = e23 * u[7]
    d3 = work[9] - u[3] * work[3] - u[6] * e13 - u[8] * e23
    if not d3 > _SINGULAR * work[9]:
        return False
    u[9] = 1 / d3
    return True


@kernel
def back(u: Array, b0: float, b1: float, b2: float, b3: float, x: Array) -> None:
    """Solve UᵀDU x = b."""
    y1 = b1 - u[1] * b0
    y2 = b2 - u[2] * b0 - u[5] * y1
    x[3] = (b3 - u[3] * b0 - u[6] * y1 - u[8] * y2) * u[9]
    x[2] = y2 * u[7] - u[8] * x[3]
    x[1] = y1 * u[4] - u[5] * x[2] - u[6] * x[3]
    x[0] = b0 * u[0] - u[1] * x[1] - u[2] * x[2] - u[3] * x[3]


@kernel
def _solve(work: Array, step: Array) -> bool:
    """The scoring step F⁻¹ g; False where F is singular."""
    u = np.empty(10)
    if not factor(work, u):
        return False
    back(u, work[10], work[11], work[12], work[13], step)
    return True


@kernel
def centre_variance(work: Array) -> float:
    """Variance of the centre, a diagonal term of F⁻¹; infinite where singular."""
    u, x = np.empty(10), np.empty(4)
    if not factor(work, u):
        return np.inf
    back(u, 1.0, 0.0, 0.0, 0.0, x)
    return float(x[0])
