"""Faint stripes on a rough ground: each section measured with its neighbours, on a background that may slope."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from extraction.order import kth_smallest
from extraction.stripe.places import Places
from extraction.stripe.sections.model import SINGULAR, Array, Records
from extraction.stripe.view import IntArray, StripeView
from geometry.compiled import kernel

NEIGHBOURS = 4  # sections on either side that are averaged along the track
# of the window about the track, in which a rough ground is a polynomial of the fourth degree, as where its ends are
# looked for
_REACH_WIDTHS, _REACH_PX, _TERMS = 4.0, 4.0, 5
_MOST_PX = 2.0  # from the track; the track is that of all sections
_STEPS = 12
_CLOSE_PX = 1e-3  # a step that ends a fit
# where the ground beside a stripe is looked at: σ beyond the window, every n-th section; fewest such places that say
# anything
_AWAY_WIDTHS, _EVERY, _FEWEST = 3.0, 4, 8
# of a faint stripe's sections, that each alone must show; and of their scatter, that nine together must be better than
# to be worth what they blur: on even ground they are by a factor of three
_MOST_SEEN, _GAIN = 0.9, 0.7
_ROUGHER = 1.5  # times the quietest ground: some fifty places that say something of their own differ by a tenth


def fit_faint(view: StripeView, places: Places, fits: Records, least_snr: float) -> Records:
    """The fits (N,) with those of faint stripes made from several sections each: of more where few say nothing.

    Where neighbours add nothing to what each section says alone, the stripe is faint no more, and the sections stay.
    """
    for k in np.unique(places.stripe[places.faint]):
        own = np.flatnonzero(places.stripe == k)
        table = fits[own]
        section, centre, width = places.section[own], places.centre_px[own], float(places.width_px[own[0]])
        _fit_stripe(view.grey, section, centre, width, least_snr, table)
        if _say_enough_alone(fits[own], table, width):
            places.faint[own] = False
        else:
            fits[own] = table
    return fits


def _say_enough_alone(alone: Records, together: Records, width: float) -> bool:
    """Whether sections fitted alone scatter hardly more about those fitted with their neighbours than these claim."""
    apart = np.abs(alone["centre"] - together["centre"])
    both = alone["converged"] & together["converged"] & (apart < _MOST_PX + width)
    if np.count_nonzero(both) < _MOST_SEEN * len(alone):
        return False
    scatter = 1.4826 * float(np.median(apart[both]))
    return float(np.median(np.sqrt(together["variance"][both]))) > _GAIN * scatter


@kernel
def _fit_stripe(
    grey: NDArray[Any], section: IntArray, centre: Array, width: float, least_snr: float, table: Records
) -> None:
    half = int(_REACH_WIDTHS * width + _REACH_PX)
    y, ground = np.empty(2 * half + 1), _ground(half)
    pull = _pull_of_the_ground(grey, section, centre, width, ground)
    for i in range(len(section)):
        for more in (1, 2, 4):
            _fit_section(grey, section, centre, width, more * NEIGHBOURS, i, y, ground, pull, table[i])
            if table[i].converged and table[i].snr >= least_snr:
                break


@kernel
def _pull_of_the_ground(grey: NDArray[Any], section: IntArray, centre: Array, width: float, ground: Array) -> float:
    """σ of the sum of a bell's fall times the grey levels [DN], as the ground beside the stripe has it; 0 if unknown.

    A fit takes most of what pulls at it, so that its residuals do not show it. Of four tracks beside the stripe's own,
    those that are not much rougher than the quietest: on some there are other things.
    """
    n, rows = ground.shape[1], grey.shape[0]
    half = n // 2
    away = half + _AWAY_WIDTHS * width
    y, fall, values = np.empty(n), np.empty(n), np.empty(len(section) // _EVERY + 1)
    for k in range(n):
        t = (k - half) / width
        fall[k] = math.exp(-0.5 * t * t) * t / width
    _less_ground(fall, ground)
    least, found, tracks = np.inf, np.zeros(4), 0
    for track in range(4):
        seen, offset = 0, (track - 2.0 if track < 2 else track - 1.0) * away
        for i in range(0, len(section), _EVERY):
            if half <= centre[i] + offset <= rows - 1 - half:
                _mean_section(grey, section, centre, offset, NEIGHBOURS, i, y)
                total = 0.0
                for k in range(n):
                    total += fall[k] * y[k]
                values[seen] = abs(total)
                seen += 1
        if seen >= _FEWEST:
            found[tracks] = 1.4826 * kth_smallest(values[:seen], seen // 2)
            least = min(least, found[tracks])
            tracks += 1
    total, alike = 0.0, 0
    for k in range(tracks):
        if found[k] <= _ROUGHER * least:
            total, alike = total + found[k] ** 2, alike + 1
    return math.sqrt(total / alike) if alike > 0 else 0.0


@kernel
def _mean_section(
    grey: NDArray[Any], section: IntArray, centre: Array, offset: float, reach: int, i: int, y: Array
) -> int:
    """Fill y (n,) with the mean along the track of the sections within ``reach``, ``offset`` beside it; how many."""
    rows, half = grey.shape[0], len(y) // 2
    a, b = max(0, i - reach), min(len(section), i + reach + 1)
    y[:] = 0.0
    for j in range(a, b):
        for k in range(len(y)):
            x = min(max(centre[j] + offset + k - half, 0.0), rows - 1.001)
            r = int(x)
            t = x - r
            y[k] += (1 - t) * float(grey[r, section[j]]) + t * float(grey[r + 1, section[j]])
    y /= b - a
    return b - a


@kernel
def _ground(half: int) -> Array:
    """Orthonormal polynomials (_TERMS, 2 half + 1) of the pixels of a window."""
    out = np.empty((_TERMS, 2 * half + 1))
    for j in range(_TERMS):
        for k in range(out.shape[1]):
            out[j, k] = ((k - half) / half) ** j
        for _ in range(2):
            for i in range(j):
                share = 0.0
                for k in range(out.shape[1]):
                    share += out[i, k] * out[j, k]
                for k in range(out.shape[1]):
                    out[j, k] -= share * out[i, k]
        square = 0.0
        for k in range(out.shape[1]):
            square += out[j, k] * out[j, k]
        for k in range(out.shape[1]):
            out[j, k] /= math.sqrt(square)
    return out


@kernel
def _less_ground(values: Array, ground: Array) -> None:
    """Take off what polynomials make of the values (n,)."""
    for j in range(_TERMS):
        share = 0.0
        for k in range(len(values)):
            share += ground[j, k] * values[k]
        for k in range(len(values)):
            values[k] -= share * ground[j, k]


@kernel
def _fit_section(
    grey: NDArray[Any], section: IntArray, centre: Array, width: float, reach: int, i: int, y: Array, ground: Array,
    pull: float, row: Any,
) -> None:  # fmt: skip
    """A bell of known σ on a polynomial ground, fitted to the mean of the sections within ``reach`` along the track.

    pull: of the ground, see above.
    """
    rows, half, n = grey.shape[0], len(y) // 2, len(y)
    _mean_section(grey, section, centre, 0.0, reach, i, y)
    level = y[half]
    _less_ground(y, ground)
    bell, fall = np.empty(n), np.empty(n)
    c, amplitude, chi2 = 0.0, 0.0, 0.0
    f00 = f01 = f11 = 0.0
    row.converged = False
    for step in range(_STEPS):
        for k in range(n):
            t = (k - half - c) / width
            bell[k] = math.exp(-0.5 * t * t)
            fall[k] = bell[k] * t / width
        _less_ground(bell, ground)
        _less_ground(fall, ground)
        f00 = f01 = f11 = g0 = g1 = 0.0
        for k in range(n):
            f00, f01, f11 = f00 + fall[k] * fall[k], f01 + fall[k] * bell[k], f11 + bell[k] * bell[k]
            g0, g1 = g0 + fall[k] * y[k], g1 + bell[k] * y[k]
        if step == 0:  # the place is not asked before there is a height
            amplitude = g1 / f11
            if not amplitude > 0.0:
                return
            continue
        det = f00 * f11 - f01 * f01
        if not det > SINGULAR * f00 * f11:
            return
        amplitude, move = (f00 * g1 - f01 * g0) / det, (f11 * g0 - f01 * g1) / det
        if not amplitude > 0.0:
            return
        move = min(max(move / amplitude, -0.5 * width), 0.5 * width)
        c += move
        if abs(c) > _MOST_PX:
            return
        if abs(move) < _CLOSE_PX:
            row.converged = True
            break
    if not row.converged:
        return
    for k in range(n):
        chi2 += (y[k] - amplitude * bell[k]) ** 2
    dof = n - _TERMS - 2.0
    base = level - amplitude * math.exp(-0.5 * (c / width) ** 2)
    det = f00 * f11 - f01 * f01
    by_residuals = f11 / det * chi2 / dof
    row.variance = max(by_residuals, (pull / f00) ** 2) / (amplitude * amplitude)
    row.snr = amplitude / math.sqrt(f00 / det * chi2 / dof)
    row.chi2, row.floor, row.dof, row.clipped = dof, 0.0, dof, 0
    row.centre, row.amplitude, row.width, row.background = centre[i] + c, amplitude, width, base
    row.low, row.high = max(0, int(centre[i]) - half), min(rows, int(centre[i]) + half + 1)
