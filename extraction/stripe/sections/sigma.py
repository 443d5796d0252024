"""σ made true: what points scatter about a smooth course more than their pixels' noise says, and how far it reaches.

Speckle, texture and the pulse's real shape move neighbouring points alike. Their share is learnt from the points
themselves: residuals about a line over some forty sections, against the σ that the pixels' noise gives.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from extraction.linalg import Symmetric4, Vector4, factor4, solve4
from extraction.order import median, median_of, positions_of
from extraction.stripe.sections.model import SINGULAR, Records
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
# a bend closer than the windows: how much less of the variance its cubics leave, of that of shorter ones how much at
# most, and how much less the shortest ones leave
BEND, SETTLED, CLEAR_BEND = 8.0, 2.5, 1000.0
_BEND_REACH, _SKEW = 6, 1.1  # sections on either side, for a bend; 0.75 under even noise, 1.5 under shot noise alone
_FEWEST_OF_CUBIC = 8  # points that a cubic is laid through
WINDOWS_ABOUT = 2  # on either side, that say with a point's own what it scatters


class SigmaPlaces(NamedTuple):
    """Of each point (N,): section, stripe, whether its stripe is faint, whether it is a ghost."""

    section: NDArray[np.int32]
    stripe: NDArray[np.int32]
    faint: NDArray[np.bool_]
    ghost: NDArray[np.bool_]


class Residuals(NamedTuple):
    """Of each point (N,): its residual, the share of white noise's variance left in it (0: none is known), how many
    points follow it in its window, and the window's number.
    """

    residual: Array
    share: Array
    after: NDArray[np.int64]
    window: NDArray[np.int64]


@kernel
def true_sigma(places: SigmaPlaces, fits: Records) -> float:
    """Raise the variances of ``fits`` (N,) in place to what the points scatter; returns the correlation length.

    In sections; 0 where neighbours are independent. The excess is a variance beside the pixels' own, from the windows
    about each point; pieces too short to say theirs take what the others have in the middle.
    """
    section, stripe, faint, ghost = places
    stripes, total, lengths, middles = 0, 0.0, 0.0, 0.0
    for i in range(len(stripe)):
        stripes = max(stripes, stripe[i] + 1)
    short, own = np.zeros(stripes, np.bool_), np.empty(len(stripe), np.int64)
    for k in range(stripes):
        n = positions_of(stripe, k, own)
        if n == 0:
            continue
        at, centre, variance, width = np.empty(n, np.int64), np.empty(n), np.empty(n), np.empty(n)
        for i in range(n):
            at[i], centre[i], variance[i] = section[own[i]], fits[own[i]].centre, fits[own[i]].variance
            width[i] = fits[own[i]].width
        skew = _skewed(at, centre, width)
        for i in range(n):
            fits[own[i]].variance += skew[i]
        r = _residuals(at, centre, variance)
        known = 0
        for i in range(n):
            known += r.share[i] > 0
        if known < FEWEST:
            short[k] = True
            continue
        excess, more = _excess(r, variance), False
        for i in range(n):
            if faint[own[0]]:  # neighbours share pixels: a line takes some of what they scatter with it
                excess[i] = max(excess[i], 0.0)
            more = more or excess[i] > 0
            variance[i] += excess[i]
            fits[own[i]].variance = max(variance[i] + skew[i], fits[own[i]].floor)
        weight = 0 if ghost[own[0]] else n
        total += weight
        lengths += weight * (_correlation(r, variance) if more else 0.0)
        middles += weight * median(excess)
    if total == 0:
        return 0.0
    for i in range(len(stripe)):
        if short[stripe[i]]:
            fits[i].variance += max(middles / total, 0.0)
    return lengths / total


@kernel
def _skewed(section: NDArray[np.int64], place: Array, width: Array) -> Array:
    """The square of what a bend moves each point (N,) along its section, where the stripe is steep.

    Of a stripe of Gaussian σ s across its own normal a steep section sees one flank nearer the bend than the other:
    the fit's centre is off by some κ s² sin² of the slope. Its sign hangs on how the light came to be that wide, so
    it is no correction but an uncertainty.
    """
    n = len(section)
    out = np.zeros(n)
    for i in range(_BEND_REACH, n - _BEND_REACH):
        a, b = i - _BEND_REACH, i + _BEND_REACH
        if section[b] - section[a] > 2 * _BEND_REACH + 2 or abs(place[b] - place[a]) > STEP_PX * (b - a):
            continue
        slope = (place[b] - place[a]) / (section[b] - section[a])
        bend = (place[b] - 2 * place[i] + place[a]) / _BEND_REACH**2
        squared = slope * slope / (1 + slope * slope)
        out[i] = (_SKEW * bend * width[i] ** 2 * squared * (1 - squared)) ** 2
    for i in range(min(_BEND_REACH, n // 2)):  # the ends take what the points inside have
        last = min(_BEND_REACH, n // 2)
        out[i], out[n - 1 - i] = out[last], out[n - 1 - last]
    return out


@kernel
def _excess(r: Residuals, variance: Array) -> Array:
    """The variance beside the points' own (N,): that of the windows about each; 0 unless together they say otherwise.

    A window with an edge of the profile in it says no more than _MOST times the middle one.
    """
    residual, share, _, window = r
    out = np.zeros(len(variance))
    windows = 0
    for i in range(len(window)):
        windows = max(windows, window[i] + 1)
    square, own, points = np.zeros(windows), np.zeros(windows), np.zeros(windows)
    for i in range(len(variance)):
        if share[i] > 0:
            square[window[i]] += residual[i] ** 2 / share[i]
            own[window[i]] += variance[i]
            points[window[i]] += 1
    number, n = np.zeros(windows, np.int64), 0  # of the windows that hold points
    for w in range(windows):
        if points[w] > 0:
            square[n], own[n], points[n] = square[w] / points[w], own[w] / points[w], points[w]
            n += 1
        number[w] = max(n - 1, 0)
    ratios, excess = np.empty(n), np.empty(n)
    for w in range(n):
        ratios[w], excess[w] = square[w] / own[w], square[w] - own[w]
    usual, freedom, total = _MOST * median_of(ratios, 0, n), 0.0, 0.0
    for w in range(n):
        if ratios[w] <= usual:
            freedom, total = freedom + points[w], total + points[w] * square[w] / own[w]
    ratio = total / freedom
    if abs(ratio - 1) <= SIGNIFICANT * math.sqrt(2 / freedom):
        return out
    if ratio < 1:  # the pixels' noise claims more than there is: clipped flanks, a noise measured on other things
        for i in range(len(out)):
            out[i] = (max(ratio, _LEAST_RATIO) - 1) * variance[i]
        return out
    most, reach = _MOST * max(median_of(excess, 0, n), 0.0), min(WINDOWS_ABOUT, n // 2)
    for i in range(len(out)):
        w = number[window[i]]
        for k in range(w - reach, w + reach + 1):
            out[i] += min(max(excess[min(max(k, 0), n - 1)], 0.0), most) / (2 * reach + 1)
    return out


@kernel
def _correlation(r: Residuals, variance: Array) -> float:
    """Length of exp(-k / L) whose sum is that of the neighbours' correlation, of what scatters more than the pixels."""
    residual, share, after, _ = r
    n, total, taken = len(residual), 0.0, 0
    z = np.empty(n)
    for i in range(n):
        z[i] = min(max(residual[i] / math.sqrt(variance[i]), -_ROBUST), _ROBUST)
    for lag in range(1, MOST_LAGS + 1):
        pairs, product, square = 0, 0.0, 0.0
        for i in range(n - lag):
            if after[i] >= lag and share[i] > 0 and share[i + lag] > 0:
                a, b = z[i], z[i + lag]
                pairs, product, square = pairs + 1, product + a * b, square + 0.5 * (a * a + b * b)
        if pairs < FEWEST // 2 or not product / square >= 2 / math.sqrt(pairs):
            break
        total, taken = total + product / square, lag
    if total <= 0:
        return 0.0
    together = (1 + 2 * total) / (1 - (2 * taken + 1) * 2 / WINDOW)  # the line has taken as much from every lag
    return 1.0 / math.log((together + 1) / (together - 1))


@kernel
def _residuals(section: NDArray[np.int64], place: Array, variance: Array) -> Residuals:
    """Each point less the line through the WINDOW of its piece that it is in, the stripe's course taken off before.

    The course is a cubic over three windows; where a bend is closer than that, cubics over the window or parts of it:
    a ball's arc is none of the noise. variance: by the pixels' noise (N,).
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
            _bent(section, place, variance, a, b, residual, share, after)
            number += 1
        start = stop
    return Residuals(residual, share, after, window)


@kernel
def _bent(
    section: NDArray[np.int64], place: Array, variance: Array, a: int, b: int, residual: Array, share: Array,
    after: NDArray[np.int64],
) -> None:  # fmt: skip
    """Where points a … b - 1 lie on a bend, their residuals about cubics over them, or over parts of them, instead.

    A bend is believed where cubics over shorter parts leave about as much of it: a rough surface, whose every detail is
    course to someone and noise to another, has no such length. Of speckle a closer course leaves most.
    """
    straight, own, tried = 0.0, 0.0, np.zeros(b)
    for i in range(a, b):
        straight, own = straight + residual[i] ** 2 / (b - a - 2), own + variance[i] / (b - a)
    if straight <= BEND * own:
        return
    least, best = straight, 0
    for parts in (4, 2, 1):
        if (b - a) // parts < _FEWEST_OF_CUBIC:
            continue
        left = _about_cubics(section, place, a, b, parts, tried)
        known = left <= SETTLED * least if parts < 4 else left * CLEAR_BEND <= straight
        if known and left * BEND <= straight:
            best = parts
        least = min(least, left)
    if best == 0:
        return
    _about_cubics(section, place, a, b, best, tried)
    for k in range(best):
        low, high = a + k * (b - a) // best, a + (k + 1) * (b - a) // best
        for i in range(low, high):
            residual[i], share[i], after[i] = tried[i], 1 - 4.0 / (high - low), high - 1 - i


@kernel
def _about_cubics(section: NDArray[np.int64], place: Array, a: int, b: int, parts: int, out: Array) -> float:
    """Points a … b - 1 about a cubic through each of so many parts of them; the variance that is left."""
    total = 0.0
    for k in range(parts):
        low, high = a + k * (b - a) // parts, a + (k + 1) * (b - a) // parts
        _less_cubic(section, place, low, high, low, high, out)
    for i in range(a, b):
        total += out[i] ** 2
    return total / (b - a - 4 * parts)


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
