"""σ made true: what points scatter about a smooth course more than their pixels' noise says, and how far it reaches.

Speckle, texture and the pulse's real shape move neighbouring points alike. Their share is learnt from the points
themselves: residuals about a line over some forty sections, against the σ that the pixels' noise gives.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from extraction.linalg import Symmetric4, Vector4, factor4, solve4
from extraction.stripe.find import Places
from extraction.stripe.model import SINGULAR, Records
from geometry.compiled import kernel

Array = NDArray[np.float64]

WINDOW = 41  # sections of a line
STEP_PX = 5.0  # per section, from which the stripe has gone to another surface
FEWEST = 60  # points from which anything is learnt
SIGNIFICANT = 3.0  # of the excess, in its own σ
MOST_LAGS = 7
_LEAST_RATIO = 0.04  # of a variance, that scatter may take it down to
_ROBUST = 3.5  # residuals beyond so many σ are edges of the profile
_MOST = 3.0  # times the middle window's excess: more is an edge or a bend of the profile
WINDOWS_ABOUT = 2  # on either side, that say with a point's own what it scatters


class Residuals(NamedTuple):
    """Of each point (N,): its residual, the share of white noise's variance left in it (0: none is known), how many
    points follow it in its window, and the window's number.
    """

    residual: Array
    share: Array
    after: NDArray[np.int64]
    window: NDArray[np.int64]


def true_sigma(places: Places, fits: Records) -> float:
    """Raise the variances of ``fits`` (N,) in place to what the points scatter; returns the correlation length.

    In sections; 0 where neighbours are independent. The excess is a variance beside the pixels' own, from the windows
    about each point; pieces too short to say theirs take what the others have in the middle.
    """
    lengths, middles, weights, short = [], [], [], []
    for k in range(int(places.stripe.max()) + 1 if len(places) else 0):
        own = np.flatnonzero(places.stripe == k)
        if len(own) == 0:
            continue
        r = _residuals(places.section[own].astype(np.int64), fits["centre"][own].copy())
        if np.count_nonzero(r.share) < FEWEST:
            short.append(own)
            continue
        variance = fits["variance"][own].copy()
        excess = _excess(r, variance)
        if places.faint[own[0]]:  # neighbours share pixels: a line takes some of what they scatter with it
            excess = np.maximum(excess, 0.0)
        fits["variance"][own] = np.maximum(variance + excess, fits["floor"][own])
        lengths.append(_correlation(r, variance + excess, bool(np.any(excess > 0))))
        middles.append(float(np.median(excess)))
        weights.append(0 if places.ghost[own[0]] else len(own))
    if not lengths or sum(weights) == 0:
        return 0.0
    for own in short:
        fits["variance"][own] += max(float(np.average(middles, weights=weights)), 0.0)
    return float(np.average(lengths, weights=weights))


def _excess(r: Residuals, variance: Array) -> Array:
    """The variance beside the points' own (N,): that of the windows about each; 0 unless together they say otherwise.

    A window with an edge of the profile in it says no more than _MOST times the middle one.
    """
    known = r.share > 0
    window = r.window[known]
    n = np.bincount(window).astype(float)
    square = np.bincount(window, weights=r.residual[known] ** 2 / r.share[known]) / np.maximum(n, 1)
    own = np.bincount(window, weights=variance[known]) / np.maximum(n, 1)
    full = n > 0
    square, own, n = square[full], own[full], n[full]
    usual = square / own <= _MOST * np.median(square / own)
    freedom = float(np.sum(n[usual]))
    ratio = float(np.sum(n[usual] * square[usual] / own[usual]) / freedom)
    doubt = SIGNIFICANT * np.sqrt(2 / freedom)
    if abs(ratio - 1) <= doubt:
        return np.zeros(len(variance))
    if ratio < 1:  # the pixels' noise claims more than there is: clipped flanks, a noise measured on other things
        return np.asarray((max(ratio, _LEAST_RATIO) - 1) * variance)
    excess = np.clip(square - own, 0, _MOST * max(float(np.median(square - own)), 0.0))
    reach = min(WINDOWS_ABOUT, len(excess) // 2)
    padded = np.pad(excess, reach, mode="edge")
    smooth = np.convolve(padded, np.ones(2 * reach + 1) / (2 * reach + 1), mode="valid")
    number = np.cumsum(full) - 1
    nearest = np.minimum(r.window, len(number) - 1)
    return np.asarray(smooth[np.maximum(number[nearest], 0)])


def _correlation(r: Residuals, variance: Array, more: bool) -> float:
    """Length of exp(-k / L) whose sum is that of the neighbours' correlation, of what scatters more than the pixels."""
    if not more:
        return 0.0
    z, share, after = r.residual / np.sqrt(variance), r.share, r.after
    total, taken = 0.0, 0
    for lag in range(1, MOST_LAGS + 1):
        pairs = np.flatnonzero((after >= lag) & (share > 0))
        pairs = pairs[(pairs + lag < len(z))]
        pairs = pairs[share[pairs + lag] > 0]
        if len(pairs) < FEWEST // 2:
            break
        a, b = np.clip(z[pairs], -_ROBUST, _ROBUST), np.clip(z[pairs + lag], -_ROBUST, _ROBUST)
        rho = float(np.mean(a * b) / np.mean(0.5 * (a * a + b * b)))
        if rho < 2 / np.sqrt(len(pairs)):
            break
        total, taken = total + rho, lag
    if total <= 0:
        return 0.0
    together = (1 + 2 * total) / (1 - (2 * taken + 1) * 2 / WINDOW)  # the line has taken as much from every lag
    return float(0.5 / np.arctanh(1 / together))


@kernel
def _residuals(section: NDArray[np.int64], place: Array) -> Residuals:
    """Each point less the line through the WINDOW of its piece that it is in, the stripe's course taken off before.

    The course is a cubic over three windows: a ball's arc is none of the noise.
    """
    n = len(section)
    residual, share, after, window = np.zeros(n), np.zeros(n), np.zeros(n, np.int64), np.zeros(n, np.int64)
    number = 0
    flat = np.zeros(n)
    start = 0
    while start < n:
        stop = start + 1
        while stop < n and section[stop] - section[stop - 1] <= 2:
            if abs(place[stop] - place[stop - 1]) > STEP_PX * (section[stop] - section[stop - 1]):
                break
            stop += 1
        m = stop - start
        windows = max(1, int(m / WINDOW + 0.5)) if m >= WINDOW // 2 else 0
        for w in range(windows):
            a, b = start + w * m // windows, start + (w + 1) * m // windows
            low, high = max(start, a - WINDOW), min(stop, b + WINDOW)
            if high - low > 2 * WINDOW:
                _less_cubic(section, place, low, high, a, b, flat)
            else:
                for i in range(a, b):
                    flat[i] = place[i] - place[a]
            _less_line(section, flat, a, b, residual)
            for i in range(a, b):
                share[i], after[i], window[i] = 1 - 2.0 / (b - a), b - 1 - i, number
            number += 1
        start = stop
    return Residuals(residual, share, after, window)


@kernel
def _less_line(section: NDArray[np.int64], place: Array, a: int, b: int, out: Array) -> None:
    sx = sy = sxx = sxy = 0.0
    m = b - a
    for k in range(a, b):
        x, y = float(section[k] - section[a]), place[k]
        sx, sy, sxx, sxy = sx + x, sy + y, sxx + x * x, sxy + x * y
    slope = (sxy - sx * sy / m) / (sxx - sx * sx / m)
    for k in range(a, b):
        out[k] = place[k] - sy / m - slope * (float(section[k] - section[a]) - sx / m)


@kernel
def _less_cubic(section: NDArray[np.int64], place: Array, low: int, high: int, a: int, b: int, out: Array) -> None:
    """Points a … b - 1 less the cubic through low … high - 1."""
    middle, scale = float(section[(low + high) // 2]), 0.5 * float(section[high - 1] - section[low])
    f00 = f01 = f02 = f03 = f12 = f13 = f23 = f33 = g0 = g1 = g2 = g3 = 0.0
    base = place[(low + high) // 2]
    for k in range(low, high):
        x, y = (section[k] - middle) / scale, place[k] - base
        x2, x3 = x * x, x * x * x
        f00, f01, f02, f03 = f00 + 1.0, f01 + x, f02 + x2, f03 + x3
        f13, f23, f33 = f13 + x2 * x2, f23 + x2 * x3, f33 + x3 * x3
        g0, g1, g2, g3 = g0 + y, g1 + y * x, g2 + y * x2, g3 + y * x3
    f12 = f03
    definite, factor = factor4(Symmetric4(f00, f01, f02, f03, f02, f12, f13, f13, f23, f33), SINGULAR)
    c = solve4(factor, Vector4(g0, g1, g2, g3)) if definite else Vector4(0.0, 0.0, 0.0, 0.0)
    for k in range(a, b):
        x = (section[k] - middle) / scale
        out[k] = place[k] - base - (c.a0 + x * (c.a1 + x * (c.a2 + x * c.a3)))
