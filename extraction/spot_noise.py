"""Compiled covariance of a fitted spot under camera noise and speckle, and what its residuals say about the speckle.

The speckle's error of pixel i is c · s_i · e_i with s the spot's signal, e of unit variance and Gaussian correlation
ρ(r) = exp(-r²/(4 ℓ²)), ℓ the grain. A linear estimate moves by Σ h_i · error_i with the influence h_i = F⁻¹ J_i w_i,
so that Cov = Σ h V_camera hᵀ + c² Σ_ij h_i s_i ρ_ij s_j h_jᵀ, whatever the weights w were.
"""

from __future__ import annotations

import numpy as np

from extraction.compiled import compiled
from extraction.gaussian_fit import Array, Mask, cholesky, solve

# what `spot_noise` writes
CAMERA, SPECKLE = 0, 3  # uu, uv, vv of Cov(u, v) from the camera, and from speckle of contrast 1
EXCESS, EXPECTED = 6, 7  # Σ (residual² - camera's share) / signal², and what speckle of contrast 1 makes of it
SKEW, SKEW_CAMERA, SKEW_SPECKLE = 8, 9, 10  # third moment left along the long axis, its variances as above
COLUMNS = 11

CORE = 0.2  # share of the height above which a pixel's residual tells of the speckle


@compiled
def spot_noise(data: Array, use: Mask, p: Array, n: int, noise: Array, grain: float, out: Array) -> None:
    """Write COLUMNS numbers about the fit ``p`` of ``data`` over ``use``; arguments as in `gaussian_fit.fit_window`."""
    rows, columns = data.shape
    e = np.zeros((rows, columns, 10))
    g = np.zeros((rows, columns))
    camera, weight = np.ones((rows, columns)), np.zeros((rows, columns))
    _basis(data, use, p, noise, e, g, camera, weight)
    fisher, factor = np.zeros((9, 9)), np.zeros((9, 9))
    for j in range(rows):
        for i in range(columns):
            if use[j, i]:
                for r in range(n):
                    for s in range(r + 1):
                        fisher[r, s] += weight[j, i] * e[j, i, r] * e[j, i, s]
    out[:] = np.inf
    if not cholesky(fisher, 0.0, n, factor):
        return
    influence = np.zeros((rows, columns, 3))  # of u, v and the skew
    _influence(use, p, n, weight, e, factor, influence)
    out[:] = 0.0
    near = _neighbourhood(use, g, grain, influence)
    for j in range(rows):
        for i in range(columns):
            if use[j, i]:
                h, b = influence[j, i], near[j, i]
                out[0] += h[0] * h[0] * camera[j, i]
                out[1] += h[0] * h[1] * camera[j, i]
                out[2] += h[1] * h[1] * camera[j, i]
                out[9] += h[2] * h[2] * camera[j, i]
                out[3] += h[0] * g[j, i] * b[0]
                out[4] += h[0] * g[j, i] * b[1]
                out[5] += h[1] * g[j, i] * b[1]
                out[10] += h[2] * g[j, i] * b[2]
                residual = data[j, i] - g[j, i] - p[6] - p[7] * e[j, i, 7] - p[8] * e[j, i, 8]
                out[8] += h[2] * residual
    _excess(data, use, p, n, weight, e, g, camera, grain, factor, out)


@compiled
def _basis(data: Array, use: Mask, p: Array, noise: Array, e: Array, g: Array, camera: Array, weight: Array) -> None:
    """Basis functions e (0-8 as in the fit, 9 the third moment along the long axis), signal g, variances, weights."""
    rows, columns = data.shape
    mid_u, mid_v = 0.5 * (columns - 1), 0.5 * (rows - 1)
    angle = 0.5 * np.arctan2(-2.0 * p[4], p[5] - p[3])  # long axis: the small eigenvalue of the precision
    cosine, sine = np.cos(angle), np.sin(angle)
    along = np.sqrt(max(p[3] * cosine**2 + 2.0 * p[4] * cosine * sine + p[5] * sine**2, 1e-12))
    for j in range(rows):
        for i in range(columns):
            x, y = i - p[0], j - p[1]
            bell = np.exp(-0.5 * (p[3] * x * x + 2.0 * p[4] * x * y + p[5] * y * y))
            g[j, i] = p[2] * bell
            e[j, i, 0], e[j, i, 1], e[j, i, 2] = bell, bell * x, bell * y
            e[j, i, 3], e[j, i, 4], e[j, i, 5] = 0.5 * bell * x * x, bell * x * y, 0.5 * bell * y * y
            e[j, i, 6], e[j, i, 7], e[j, i, 8] = 1.0, i - mid_u, j - mid_v
            t = along * (cosine * x + sine * y)
            e[j, i, 9] = g[j, i] * (t * t * t - 3.0 * t) / 6.0
            mu = g[j, i] + p[6] + p[7] * (i - mid_u) + p[8] * (j - mid_v)
            camera[j, i] = noise[0] + noise[1] * max(mu - noise[2], 0.0)
            if use[j, i]:
                weight[j, i] = 1.0 / (camera[j, i] + noise[3] * g[j, i] * g[j, i])


@compiled
def _influence(use: Mask, p: Array, n: int, weight: Array, e: Array, factor: Array, influence: Array) -> None:
    """How far one grey level in a pixel moves u, v and the skew (the third moment after the fit took its part)."""
    rows, columns = use.shape
    unit, first, second = np.zeros(9), np.zeros(9), np.zeros(9)
    unit[1] = 1.0
    solve(factor, unit, n, first)
    unit[1], unit[2] = 0.0, 1.0
    solve(factor, unit, n, second)
    cross, share, size = np.zeros(9), np.zeros(9), 0.0
    for j in range(rows):
        for i in range(columns):
            if use[j, i]:
                size += weight[j, i] * e[j, i, 9] ** 2
                for r in range(n):
                    cross[r] += weight[j, i] * e[j, i, r] * e[j, i, 9]
    solve(factor, cross, n, share)
    for r in range(n):
        size -= share[r] * cross[r]
    det = (p[3] * p[5] - p[4] * p[4]) * p[2]
    for j in range(rows):
        for i in range(columns):
            if use[j, i]:
                a, b, skew = 0.0, 0.0, e[j, i, 9]
                for r in range(n):
                    a += first[r] * e[j, i, r]
                    b += second[r] * e[j, i, r]
                    skew -= share[r] * e[j, i, r]
                w = weight[j, i]
                influence[j, i, 0] = w * (p[5] * a - p[4] * b) / det
                influence[j, i, 1] = w * (p[3] * b - p[4] * a) / det
                influence[j, i, 2] = w * skew / max(size, 1e-30)


@compiled
def _neighbourhood(use: Mask, g: Array, grain: float, influence: Array) -> Array:
    """Σ_j ρ_ij s_j h_j for every pixel i (rows, columns, 3)."""
    rows, columns, count = influence.shape
    out = np.zeros((rows, columns, count))
    reach = int(np.ceil(3.5 * grain))
    for b in range(-reach, reach + 1):
        for a in range(-reach, reach + 1):
            rho = 1.0 if a == 0 and b == 0 else np.exp(-(a * a + b * b) / (4.0 * grain * grain))
            if rho < 1e-3:
                continue
            for j in range(max(0, -b), min(rows, rows - b)):
                for i in range(max(0, -a), min(columns, columns - a)):
                    if use[j + b, i + a]:
                        f = rho * g[j + b, i + a]
                        for k in range(count):
                            out[j, i, k] += f * influence[j + b, i + a, k]
    return out


@compiled
def _excess(  # the residuals' share of the speckle
    data: Array, use: Mask, p: Array, n: int, weight: Array, e: Array, g: Array, camera: Array, grain: float,
    factor: Array, out: Array,
) -> None:  # fmt: skip
    """Compare the core's residuals with speckle of contrast 1, the part that the fit takes away subtracted."""
    rows, columns = use.shape
    scaled = np.zeros((rows, columns, n))
    for j in range(rows):
        for i in range(columns):
            for r in range(n):
                scaled[j, i, r] = weight[j, i] * e[j, i, r]
    near = _neighbourhood(use, g, grain, scaled)
    inner = np.zeros((n, n))
    for j in range(rows):
        for i in range(columns):
            if use[j, i]:
                for r in range(n):
                    for s in range(n):
                        inner[r, s] += scaled[j, i, r] * g[j, i] * near[j, i, s]
    q, step = np.zeros(9), np.zeros(9)
    for j in range(rows):
        for i in range(columns):
            if use[j, i] and g[j, i] > CORE * p[2]:
                residual = data[j, i] - g[j, i] - p[6] - p[7] * e[j, i, 7] - p[8] * e[j, i, 8]
                q[:] = e[j, i, :9]
                solve(factor, q, n, step)
                variance, leverage = g[j, i] ** 2, 0.0
                for r in range(n):
                    variance -= 2.0 * step[r] * near[j, i, r] * g[j, i]
                    leverage += step[r] * e[j, i, r] * weight[j, i]
                    for s in range(n):
                        variance += step[r] * inner[r, s] * step[s]
                out[6] += (residual**2 - camera[j, i] * max(1.0 - leverage, 0.0)) / g[j, i] ** 2
                out[7] += max(variance, 0.0) / g[j, i] ** 2
