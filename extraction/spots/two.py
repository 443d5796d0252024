"""Compiled joint fit of two near spots: two bells of one shape on one background, and whether they explain a window
better than one does.

Parameters q: u, v and height of either spot, the shape's precision a, h, c, the background. Fisher scoring with
Levenberg's damping, as of single spots; the variances follow the fit.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from extraction.gaussian import bell_row
from extraction.linalg import cholesky, solve
from extraction.noise import PixelNoise, pixel_variance
from extraction.spots.error.influence import CORE
from extraction.spots.fit import SINGULAR, Window, Windows, fit_window, window_of
from extraction.spots.model import (
    FLAT,
    MIN_VARIANCE_PX2,
    PIXEL_VARIANCE_PX2,
    Array,
    Mask,
    Records,
    Spot,
    long_axis,
    precision,
    spot_of,
)
from geometry.compiled import kernel

FULL_WIDTH = math.sqrt(8.0 * math.log(2.0))  # at half maximum, in σ
FAINTEST = 0.15  # height of the fainter over the brighter: less is a grain or a wing
LEAST_F = 20.0  # of the three parameters that a second spot adds; Gaussian noise gets there once in 10^5 and more
LEAST_RESIDUAL = 0.06  # rms of the single fit over its signal: a bent arc of a 1 mm string leaves as much
MOMENTS = 5  # along a spot, from the nought-th to the fourth
# share of a single fit's residual, in squares, that these must explain where it is two spots; and of what LEAST_F asks
# of these: the moments tell nearly all that a second spot does
EXPLAINED, NEARLY = 0.6, 0.8
APART = 0.67  # of one spot's variance along an axis: what two, 1.2 full widths apart, make of it by their places
START_PX2 = 0.3  # of a start, as of single fits
STEPS, TOLERANCE, MOST_DAMPING = 25, 1e-3, 1e6
TERMS = 10
U, V, HEIGHT, A, H, C, LEVEL = (0, 3), (1, 4), (2, 5), 6, 7, 8, 9


class NearPeak(NamedTuple):
    """A refused peak that may be the second spot: place in the window [px], height [DN]; none of no height."""

    u: float
    v: float
    height: float


class TwoSpots(NamedTuple):
    """A joint fit: parameters (10,), bells (2, R, C), means and variances (R, C), their derivatives (R, C, 10); whether
    it settled within the window.
    """

    q: Array
    bells: Array
    mean: Array
    variance: Array
    slopes: Array
    converged: bool


class _State(NamedTuple):
    """What a joint fit sees at a place, see `TwoSpots`; its information (10, 10), lower triangle, and score (10,)."""

    bells: Array
    mean: Array
    variance: Array
    slopes: Array
    fisher: Array
    score: Array


@kernel
def flat_topped(windows: Windows, place: Records, spots: Records, out: Mask) -> None:
    """Mark the fits (N,) whose residual two spots leave: less in the middle, more beside it along an axis."""
    term, gram, right = np.empty(MOMENTS), np.empty((MOMENTS, MOMENTS)), np.empty(MOMENTS)
    factor, by = np.empty((MOMENTS, MOMENTS)), np.empty(MOMENTS)
    for k in range(len(spots)):
        window, spot = window_of(windows, k, place[k]), spot_of(spots[k])
        rows, columns = window.grey.shape
        cosine, sine, along = long_axis(spot)
        square, light, n = 0.0, 0.0, 0
        gram[:], right[:] = 0.0, 0.0
        for j in range(rows):
            y = j - spot.v
            for i in range(columns):
                x = i - spot.u
                distance = spot.a * x * x + 2.0 * spot.h * x * y + spot.c * y * y
                bell = math.exp(-0.5 * distance)
                if not window.use[j, i] or bell <= CORE:
                    continue
                signal = spot.height * bell
                left = window.grey[j, i] - signal - (spot.level + spot.slope_u * i + spot.slope_v * j)
                t = along * (cosine * x + sine * y)
                square, light, n = square + left * left, light + signal * signal, n + 1
                value = signal
                for r in range(MOMENTS):  # a weighted fit leaves something of the lower ones too
                    term[r] = value
                    value *= t
                for r in range(MOMENTS):
                    right[r] += term[r] * left
                    for s in range(r + 1):
                        gram[r, s] += term[r] * term[s]
        out[k] = False
        if n <= 2 * MOMENTS or square < LEAST_RESIDUAL**2 * light:
            continue
        if not cholesky(gram, 0.0, SINGULAR, MOMENTS, factor):
            continue
        solve(factor, right, MOMENTS, by)
        explained = 0.0
        for r in range(MOMENTS):
            explained += by[r] * right[r]
        asked = 3.0 * LEAST_F / (3.0 * LEAST_F + n - (TERMS - 1))
        out[k] = by[MOMENTS - 1] < 0.0 and explained > max(EXPLAINED, NEARLY * asked) * square


@kernel
def fit_two(cut: Window, one: Spot, near: NearPeak, law: PixelNoise) -> tuple[bool, TwoSpots]:
    """The better joint fit from two starts, and whether it stands: one spot does not explain the window as well.

    one: the single fit, seen from this window.
    """
    window = Window(cut.grey[:, :], cut.use[:, :])  # of the kind that other fits are compiled for
    rows, columns = window.grey.shape
    single = fit_window(window, one, FLAT, law, STEPS)
    base = single.spot if single.converged else one
    best, cost = _joint(window, _along_the_axis(base, near), law)
    if near.height > 0.0:
        other, other_cost = _joint(window, _from_the_peak(one, near), law)
        # on a tie the peak's: it is the one that is seen
        if other.converged and not (best.converged and cost < other_cost * (1.0 - TOLERANCE)):
            best, cost = other, other_cost
    if not best.converged:
        return False, best
    q, spot = best.q, single.spot
    high, low = max(q[2], q[5]), min(q[2], q[5])
    if not low > FAINTEST * high:
        return False, best
    core, before, after, left2, light = 0, 0.0, 0.0, 0.0, 0.0
    for j in range(rows):
        y = j - spot.v
        for i in range(columns):
            signal = q[2] * best.bells[0, j, i] + q[5] * best.bells[1, j, i]
            if not window.use[j, i] or signal <= CORE * high:
                continue
            x = i - spot.u
            bell = math.exp(-0.5 * (spot.a * x * x + 2.0 * spot.h * x * y + spot.c * y * y))
            left, rest = window.grey[j, i] - spot.level - spot.height * bell, window.grey[j, i] - best.mean[j, i]
            core, left2, light = core + 1, left2 + left * left, light + signal * signal
            before += left * left / best.variance[j, i]
            after += rest * rest / best.variance[j, i]
    freedom = core - (TERMS - 1)
    if freedom < 3:
        return False, best
    stands = left2 > LEAST_RESIDUAL**2 * light and before - after > LEAST_F * 3.0 * after / freedom
    return stands, best


@kernel
def full_widths_apart(q: Array) -> float:
    """Distance of the two in full widths at half maximum along their line, the pixel's share taken off."""
    x, y = q[3] - q[0], q[4] - q[1]
    det = q[A] * q[C] - q[H] * q[H]
    uu, uv, vv = q[C] / det - PIXEL_VARIANCE_PX2, -q[H] / det, q[A] / det - PIXEL_VARIANCE_PX2
    return math.sqrt(max((vv * x * x - 2.0 * uv * x * y + uu * y * y) / (uu * vv - uv * uv), 0.0)) / FULL_WIDTH


@kernel
def _covariance_of(spot: Spot) -> tuple[float, float, float]:
    return precision(spot.a, spot.h, spot.c)  # the inverse of a symmetric matrix, either way


@kernel
def _along_the_axis(base: Spot, near: NearPeak) -> Array:
    """A start: two along one spot's long axis; the second is the one nearer to the peak where there is one."""
    uu, uv, vv = _covariance_of(base)
    cosine, sine, along = long_axis(base)
    half = math.sqrt(APART) / along
    x, y = half * cosine, half * sine
    if near.height > 0.0 and (near.u - base.u) * x + (near.v - base.v) * y < 0.0:
        x, y = -x, -y
    q = np.empty(TERMS)
    q[0], q[1], q[2] = base.u - x, base.v - y, base.height
    q[3], q[4], q[5] = base.u + x, base.v + y, base.height
    q[A], q[H], q[C] = precision(uu - x * x, uv - x * y, vv - y * y)
    q[LEVEL] = base.level
    return q


@kernel
def _from_the_peak(one: Spot, near: NearPeak) -> Array:
    """A start: the single spot, narrowed where it is long, and the peak."""
    uu, uv, vv = _covariance_of(one)
    middle, tilt = 0.5 * (uu + vv), 0.5 * (uu - vv)
    half = math.hypot(tilt, uv)
    long, short = middle + half, middle - half
    most = max(2.0 * short, START_PX2)
    long, short = min(max(long, START_PX2), most), min(max(short, START_PX2), most)
    middle, turn = 0.5 * (long + short), 0.5 * (long - short) / half if half > 0.0 else 0.0
    q = np.empty(TERMS)
    q[0], q[1], q[2], q[3], q[4], q[5] = one.u, one.v, one.height, near.u, near.v, near.height
    q[A], q[H], q[C] = precision(middle + turn * tilt, turn * uv, middle - turn * tilt)
    q[LEVEL] = one.level
    return q


@kernel
def _state(rows: int, columns: int) -> _State:
    return _State(
        np.empty((2, rows, columns)), np.empty((rows, columns)), np.empty((rows, columns)),
        np.empty((rows, columns, TERMS)), np.empty((TERMS, TERMS)), np.empty(TERMS),
    )  # fmt: skip


@kernel
def _see(window: Window, q: Array, law: PixelNoise, old: Array, out: _State) -> tuple[float, float]:
    """Fill ``out`` at q; → χ² with the variances ``old`` (R, C) and with its own."""
    rows, columns = window.grey.shape
    fisher, score = out.fisher, out.score
    fisher[:], score[:] = 0.0, 0.0
    before, chi2, a, h, c = 0.0, 0.0, q[A], q[H], q[C]
    for j in range(rows):
        y0, y1 = j - q[1], j - q[4]
        bell_row(q[0], a, h * y0, 0.5 * c * y0 * y0, out.bells[0, j])
        bell_row(q[3], a, h * y1, 0.5 * c * y1 * y1, out.bells[1, j])
        for i in range(columns):
            x0, x1, g0, g1 = i - q[0], i - q[3], out.bells[0, j, i], out.bells[1, j, i]
            light0, light1 = q[2] * g0, q[5] * g1
            signal = light0 + light1
            mean, t = signal + q[LEVEL], out.slopes[j, i]
            variance = pixel_variance(law, mean, signal)
            t[0], t[1], t[2] = light0 * (a * x0 + h * y0), light0 * (h * x0 + c * y0), g0
            t[3], t[4], t[5] = light1 * (a * x1 + h * y1), light1 * (h * x1 + c * y1), g1
            t[6] = -0.5 * (light0 * x0 * x0 + light1 * x1 * x1)
            t[7] = -(light0 * x0 * y0 + light1 * x1 * y1)
            t[8] = -0.5 * (light0 * y0 * y0 + light1 * y1 * y1)
            t[9] = 1.0
            out.mean[j, i], out.variance[j, i] = mean, variance
            if window.use[j, i]:
                r, w = window.grey[j, i] - mean, 1.0 / variance
                before += r * r / old[j, i]
                chi2 += w * r * r
                _add(t, w, w * r, fisher, score)
    return before, chi2


@kernel(fastmath=True)
def _add(t: Array, w: float, wr: float, fisher: Array, score: Array) -> None:
    for r in range(TERMS):
        row, wt = fisher[r], w * t[r]
        score[r] += wr * t[r]
        for s in range(TERMS):  # more than the lower triangle: one loop of a fixed length
            row[s] += wt * t[s]


@kernel
def _is_pair(q: Array) -> bool:
    a, h, c = q[A], q[H], q[C]
    narrowest = 2.0 / (MIN_VARIANCE_PX2 + PIXEL_VARIANCE_PX2)
    return bool(q[2] > 0.0 and q[5] > 0.0 and a > 0.0 and a * c > h * h and a + c < narrowest)


@kernel
def _joint(window: Window, q: Array, law: PixelNoise) -> tuple[TwoSpots, float]:
    """The joint fit from a start, and its χ²."""
    rows, columns = window.grey.shape
    now, trial = _state(rows, columns), _state(rows, columns)
    factor, step, new = np.zeros((TERMS, TERMS)), np.zeros(TERMS), np.empty(TERMS)
    now.variance[:] = 1.0
    damping, converged = 1e-3, False
    chi2 = _see(window, q, law, now.variance, now)[1] if _is_pair(q) else np.inf
    for _ in range(STEPS if chi2 < np.inf else 0):
        if cholesky(now.fisher, damping, SINGULAR, TERMS, factor):
            solve(factor, now.score, TERMS, step)
            gain = 0.0
            for r in range(TERMS):
                new[r] = q[r] + step[r]
                gain += step[r] * now.score[r]
            if _is_pair(new):
                same, after = _see(window, new, law, now.variance, trial)
                small = gain < TOLERANCE
                if small or same <= chi2:
                    for r in range(TERMS):
                        q[r] = new[r]
                    now, trial = trial, now
                    chi2 = after
                    damping = 0.1 * damping if damping > 1e-6 else 0.0
                    if small and damping < 1e-2:
                        converged = True
                        break
                    continue
        damping = max(8.0 * damping, 1e-3)
        if damping > MOST_DAMPING:
            break
    for k in range(2):
        converged = converged and 0.0 <= q[U[k]] < columns and 0.0 <= q[V[k]] < rows
    return TwoSpots(q, now.bells, now.mean, now.variance, now.slopes, converged), chi2
