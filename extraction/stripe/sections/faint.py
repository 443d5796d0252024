"""Faint stripes on a rough ground: each section measured with its neighbours, on a background that may slope."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from extraction.linalg import Symmetric4, Vector4, factor4, solve4
from extraction.noise import PixelNoise, pixel_variance
from extraction.stripe.places import Places
from extraction.stripe.sections.model import SINGULAR, Array, Records
from extraction.stripe.view import IntArray, StripeView
from geometry.compiled import kernel

NEIGHBOURS = 4  # sections on either side that are averaged along the track
_REACH_WIDTHS, _REACH_PX = 2.5, 2.0  # of the window about the track: a rough ground is a line no further
_MOST_PX = 2.0  # from the track; the track is that of all sections
_STEPS = 12


def fit_faint(view: StripeView, places: Places, fits: Records, noise: PixelNoise) -> Records:
    """The fits (N,) with those of faint stripes made from several sections each."""
    for k in np.unique(places.stripe[places.faint]):
        own = np.flatnonzero(places.stripe == k)
        table = fits[own]
        _fit_stripe(view.grey, places.section[own], places.centre_px[own], float(places.width_px[own[0]]), noise, table)
        fits[own] = table
    return fits


@kernel
def _fit_stripe(
    grey: NDArray[Any], section: IntArray, centre: Array, width: float, noise: PixelNoise, table: Records
) -> None:
    half = int(_REACH_WIDTHS * width + _REACH_PX)
    y = np.empty(2 * half + 1)
    for i in range(len(section)):
        for more in (1, 2, 4):  # where a few sections say nothing, more do
            _fit_section(grey, section, centre, width, noise, more * NEIGHBOURS, i, y, table[i])
            if table[i].converged:
                break


@kernel
def _fit_section(
    grey: NDArray[Any], section: IntArray, centre: Array, width: float, noise: PixelNoise, reach: int, i: int,
    y: Array, row: Any,
) -> None:  # fmt: skip
    rows, half = grey.shape[0], len(y) // 2
    a, b = max(0, i - reach), min(len(section), i + reach + 1)
    y[:] = 0.0
    for j in range(a, b):
        for k in range(len(y)):
            x = min(max(centre[j] + k - half, 0.0), rows - 1.001)
            r = int(x)
            t = x - r
            y[k] += (1 - t) * float(grey[r, section[j]]) + t * float(grey[r + 1, section[j]])
    y /= b - a
    c, amplitude, base, slope = 0.0, 0.0, 0.0, 0.0
    row.converged = False
    chi2, fisher = 0.0, Symmetric4(0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    definite = False
    for step in range(_STEPS):
        f00 = f01 = f02 = f03 = f11 = f12 = f13 = f22 = f23 = f33 = 0.0
        g0 = g1 = g2 = g3 = 0.0
        chi2 = 0.0
        for k in range(len(y)):
            x = float(k - half)
            t = (x - c) / width
            bell = math.exp(-0.5 * t * t)
            j0 = amplitude * bell * t / width
            r = y[k] - amplitude * bell - base - slope * x
            f00, f01, f02, f03 = f00 + j0 * j0, f01 + j0 * bell, f02 + j0, f03 + j0 * x
            f11, f12, f13 = f11 + bell * bell, f12 + bell, f13 + bell * x
            f22, f23, f33 = f22 + 1.0, f23 + x, f33 + x * x
            g0, g1, g2, g3 = g0 + r * j0, g1 + r * bell, g2 + r, g3 + r * x
            chi2 += r * r
        if step == 0 or amplitude <= 0:
            f00 += 1.0  # the place is not asked before there is a height
        fisher = Symmetric4(f00, f01, f02, f03, f11, f12, f13, f22, f23, f33)
        definite, factor = factor4(fisher, SINGULAR)
        if not definite:
            break
        s = solve4(factor, Vector4(g0, g1, g2, g3))
        c = c + min(max(s.a0, -0.5 * width), 0.5 * width)
        amplitude, base, slope = amplitude + s.a1, base + s.a2, slope + s.a3
        if abs(c) > _MOST_PX or (step > 1 and amplitude <= 0):
            break
        if step > 1 and abs(s.a0) < 1e-3:
            row.converged = True
            break
    if not row.converged:
        return
    definite, factor = factor4(fisher, SINGULAR)
    spread = max(chi2 / max(len(y) - 4, 1), pixel_variance(noise, base + amplitude, amplitude) / (b - a))
    row.variance = solve4(factor, Vector4(1.0, 0.0, 0.0, 0.0)).a0 * spread
    row.snr = amplitude / math.sqrt(solve4(factor, Vector4(0.0, 1.0, 0.0, 0.0)).a1 * spread)
    row.centre, row.amplitude, row.width, row.background = centre[i] + c, amplitude, width, base
    row.low, row.high = max(0, int(centre[i]) - half), min(rows, int(centre[i]) + half + 1)
    row.chi2, row.dof, row.clipped = float(len(y) - 4), float(len(y) - 4), 0
