"""Compiled maximum-likelihood fit of one spot in a window of pixels.

The estimate solves Σ (d - μ) ∂μ / V = 0 by Fisher scoring with Levenberg's damping, V (`PixelNoise`) following μ;
where V is that of the camera this is the likelihood's equation up to O(1/signal).
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from extraction.gaussian import bell_row
from extraction.linalg import cholesky, solve
from extraction.noise import PixelNoise, pixel_variance
from extraction.spots.model import (
    BELLS,
    BY_U,
    BY_V,
    FACTOR,
    POWER_X,
    POWER_Y,
    SLOPED,
    Array,
    Mask,
    Records,
    Spot,
    centre_by_terms,
    moved,
)
from geometry.compiled import kernel

SINGULAR = 1e-13  # of nine terms' information: a thousand times what its sums round to
WIDEST = 0.25  # variance along a spot, in squares of the window's side, beyond which a fit is given up
MOST_DAMPING = 1e3  # where even so short a step does not help, the spot is no Gaussian: a spark at MIN_VARIANCE_PX2
STEP_TOLERANCE = 1e-2  # a step below this share of its own standard deviation ends the iteration
LATE, LATE_TOLERANCE = 10, 0.1  # after so many steps: weights that follow the fit can make it swing by a little


class Window(NamedTuple):
    """Grey levels of a window (R, C) [DN], and which of its pixels are used (R, C)."""

    grey: Array
    use: Mask


class Windows(NamedTuple):
    """The windows of N spots (N, R, C), each from the first pixel of its plane on."""

    grey: Array
    use: Mask


# of one spot: number of its candidate; the window's place in the image and size; terms of its model
PLACE = np.dtype([(name, np.int64) for name in ("candidate", "left", "top", "columns", "rows", "terms")])


class SpotFit(NamedTuple):
    """A fitted spot: Cov(u, v) by the weights [px²], infinite where there is none; χ²; steps; whether it settled."""

    spot: Spot
    cov_uu: float
    cov_uv: float
    cov_vv: float
    chi2: float
    iterations: int
    converged: bool


FIT = np.dtype(
    [
        *((name, np.float64) for name in ("cov_uu", "cov_uv", "cov_vv", "chi2")),
        *((name, np.int64) for name in ("iterations", "clipped", "foreign", "left_out")),
        ("converged", np.bool_),
    ],
    align=True,
)


class FittedSpots(NamedTuple):
    """What N fits found: records of SPOT and of FIT. clipped, foreign, left_out: pixels, see `frame`."""

    spot: Records
    fit: Records


class Scoring(NamedTuple):
    """Fisher scoring at a spot: weights 1/V (R, C), information (9, 9), its lower triangle, and score (9,)."""

    weight: Array
    fisher: Array
    score: Array


class Scratch(NamedTuple):
    """Room for the sums of a window (5, 5, 5), those of a row (5, 5), and a row's bell (C,)."""

    moments: Array
    sums: Array
    bell: Array


@kernel
def window_of(windows: Windows, k: int, place: Any) -> Window:
    """Window k, of the size that its record of a PLACE array says."""
    return Window(windows.grey[k, : place.rows, : place.columns], windows.use[k, : place.rows, : place.columns])


@kernel
def _scoring(rows: int, columns: int) -> Scoring:
    return Scoring(np.zeros((rows, columns)), np.zeros((SLOPED, SLOPED)), np.zeros(SLOPED))


@kernel(fastmath=True)
def _row_sums(
    window: Window, j: int, spot: Spot, noise: PixelNoise, old: Array, new: Array, scratch: Scratch
) -> tuple[float, float]:
    """Write row j's weights 1/V to ``new`` and its sums by powers of x; → χ² with old and with new weights.

    sums: of w g², w g, w, w r g, w r with g the bell and r the residual.
    """
    bell, sums, grey, use = scratch.bell, scratch.sums, window.grey[j], window.use[j]
    before_weight, weight = old[j], new[j]
    level, slope = spot.level + spot.slope_u * spot.u + spot.slope_v * j, spot.slope_u
    a0 = a1 = a2 = a3 = a4 = b0 = b1 = b2 = b3 = c0 = c1 = c2 = 0.0
    d0 = d1 = d2 = e0 = e1 = before = chi2 = 0.0
    for i in range(len(bell)):
        x, g = i - spot.u, bell[i]
        signal = spot.height * g
        mu = signal + level + slope * x
        w = 1.0 / pixel_variance(noise, mu, signal)
        w = w if use[i] else 0.0
        r = grey[i] - mu
        before += before_weight[i] * r * r
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
def _score(
    window: Window, spot: Spot, noise: PixelNoise, old: Array, new: Scoring, scratch: Scratch
) -> tuple[float, float]:
    """Fill ``new`` at a spot; → χ² with the weights ``old`` (R, C) and with the new ones.

    All sums are moments about the centre: of the terms' products, and of the terms with the residual.
    """
    moments, sums = scratch.moments, scratch.sums
    moments[:] = 0.0
    before, chi2 = 0.0, 0.0
    for j in range(window.grey.shape[0]):
        y = j - spot.v
        bell_row(spot.u, spot.a, spot.h * y, 0.5 * spot.c * y * y, scratch.bell)
        row = _row_sums(window, j, spot, noise, old, new.weight, scratch)
        before, chi2 = before + row[0], chi2 + row[1]
        for kind in range(5):
            degree, power = 4 - kind if kind < 2 else (1 if kind == 4 else 2), 1.0
            for b in range(degree + 1):
                for a in range(degree + 1 - b):
                    moments[kind, a, b] += sums[kind, a] * power
                power *= y
    _assemble(moments, new)
    return before, chi2


@kernel
def _assemble(moments: Array, out: Scoring) -> None:
    """The lower triangle of the information and the score from the moments (5, 5, 5)."""
    for r in range(SLOPED):
        for s in range(r + 1):
            kind = 0 if r < BELLS else (1 if s < BELLS else 2)
            factor = FACTOR[r] * FACTOR[s]
            out.fisher[r, s] = factor * moments[kind, POWER_X[r] + POWER_X[s], POWER_Y[r] + POWER_Y[s]]
        out.score[r] = FACTOR[r] * moments[3 if r < BELLS else 4, POWER_X[r], POWER_Y[r]]


@kernel
def _lost(spot: Spot, rows: int, columns: int) -> bool:
    """Whether the fit has left the window, or found a stripe's piece: no end within it."""
    endless = (spot.a + spot.c) > WIDEST * max(rows, columns) ** 2 * (spot.a * spot.c - spot.h * spot.h)
    return endless or not (-1.0 < spot.u < columns and -1.0 < spot.v < rows)


@kernel
def fit_window(window: Window, start: Spot, n: int, noise: PixelNoise, max_iterations: int) -> SpotFit:
    """Fit one spot to a window; the compiled core of every localisation by maximum likelihood.

    n: FLAT terms with a constant background, or SLOPED ones.
    """
    rows, columns = window.grey.shape
    now, trial = _scoring(rows, columns), _scoring(rows, columns)
    scratch = Scratch(np.zeros((5, 5, 5)), np.zeros((5, 5)), np.empty(columns))
    factor, q, spot = np.zeros((SLOPED, SLOPED)), np.zeros(SLOPED), start
    damping, converged, iteration = 0.0, False, 0
    chi2 = _score(window, spot, noise, now.weight, now, scratch)[1]
    while iteration < max_iterations and not converged and damping <= MOST_DAMPING:
        iteration += 1
        if cholesky(now.fisher, damping, SINGULAR, n, factor):
            solve(factor, now.score, n, q)
            decrement = 0.0  # the step's length in standard deviations, squared
            for k in range(n):
                decrement += q[k] * now.score[k]
            is_spot, new = moved(spot, q, n)
            if is_spot:
                small = decrement < (STEP_TOLERANCE if iteration <= LATE else LATE_TOLERANCE) ** 2
                same, after = _score(window, new, noise, now.weight, trial, scratch)
                if small or same <= chi2 * (1.0 + 1e-12):
                    spot, chi2 = new, after
                    now, trial = trial, now
                    damping = 0.1 * damping if damping > 1e-4 else 0.0
                    converged = small
                    if _lost(spot, rows, columns):
                        break
                    continue
        damping = max(8.0 * damping, 1e-3)
    uu, uv, vv = _centre_covariance(spot, now.fisher, factor, n)
    return SpotFit(spot, uu, uv, vv, chi2, iteration, converged)


@kernel
def _centre_covariance(spot: Spot, fisher: Array, factor: Array, n: int) -> tuple[float, float, float]:
    """Cov(u, v) as uu, uv, vv: a block of the inverse information; infinite where it has none."""
    if not cholesky(fisher, 0.0, SINGULAR, n, factor):
        return np.inf, 0.0, np.inf
    unit, first, second = np.zeros(SLOPED), np.zeros(SLOPED), np.zeros(SLOPED)
    unit[BY_U] = 1.0
    solve(factor, unit, n, first)
    unit[BY_U], unit[BY_V] = 0.0, 1.0
    solve(factor, unit, n, second)
    s00, s01, s11 = centre_by_terms(spot)
    c00, c01, c11 = first[BY_U], first[BY_V], second[BY_V]
    return (
        s00 * s00 * c00 + 2 * s00 * s01 * c01 + s01 * s01 * c11,
        s00 * s01 * c00 + (s00 * s11 + s01 * s01) * c01 + s01 * s11 * c11,
        s01 * s01 * c00 + 2 * s01 * s11 * c01 + s11 * s11 * c11,
    )


@kernel
def write_fit(fit: SpotFit, found: FittedSpots, k: int) -> None:
    """Write a fit to the records k."""
    spot, to, row = fit.spot, found.spot[k], found.fit[k]
    to.u, to.v, to.height, to.a, to.h, to.c = spot.u, spot.v, spot.height, spot.a, spot.h, spot.c
    to.level, to.slope_u, to.slope_v = spot.level, spot.slope_u, spot.slope_v
    row.cov_uu, row.cov_uv, row.cov_vv, row.chi2 = fit.cov_uu, fit.cov_uv, fit.cov_vv, fit.chi2
    row.iterations, row.converged = fit.iterations, fit.converged
