"""Two stripes so near that each stands on the other's flank: one fit of both, each centre with its σ."""

from __future__ import annotations

import math

import numpy as np

from extraction.config import StripeConfig
from extraction.linalg import cholesky, solve
from extraction.noise import PixelNoise, pixel_variance
from extraction.stripe.places import Places
from extraction.stripe.sections.climb import STEPS
from extraction.stripe.sections.model import SINGULAR, Array, Records
from extraction.stripe.view import IntArray, Pixels, StripeView
from geometry.compiled import kernel

_PARAMETERS = 6  # two centres, two amplitudes, the common σ and the background
_ATOL_PX = 5e-4
_WIDTH_ERROR = 0.12  # relative, of the σ that the mean profile makes one expect


def fit_pairs(view: StripeView, places: Places, fits: Records, noise: PixelNoise, config: StripeConfig) -> Records:
    """The fits (N,) with those of pairs made jointly: two Gaussians of one σ on one background."""
    first = np.flatnonzero(places.partner > np.arange(len(places)))
    if len(first):
        second = places.partner[first]
        limits = (config.min_width_px, config.max_width_px)
        _fit_pairs(view.pixels, places.section[first], places.centre_px, places.width_px, first.astype(np.int32),
        second,
                   view.clip_dn, limits, noise, fits)  # fmt: skip
    return fits


@kernel
def _fit_pairs(
    pixels: Pixels, section: IntArray, centre: Array, width: Array, first: IntArray, second: IntArray,
    clip: float, limits: tuple[float, float], noise: PixelNoise, table: Records,
) -> None:  # fmt: skip
    grey, left_out = pixels.grey, pixels.left_out
    rows = len(grey)
    fisher, factor = np.empty((_PARAMETERS, _PARAMETERS)), np.empty((_PARAMETERS, _PARAMETERS))
    score, step, slope = np.empty(_PARAMETERS), np.empty(_PARAMETERS), np.empty(_PARAMETERS)
    y, use = np.empty(rows), np.empty(rows, np.bool_)
    for i in range(len(first)):
        a, b = first[i], second[i]
        w = width[a]
        half = max(4, int(3.5 * w + 2.5))
        low = max(0, int(centre[a]) - half)
        high = min(rows, int(centre[b] + 0.5) + half + 1)
        n, used, most, least = high - low, 0, -np.inf, np.inf
        for k in range(n):
            y[k] = float(grey[low + k, section[i]])
            use[k] = y[k] < clip and (left_out.size == 0 or not left_out[low + k, section[i]])
            used += use[k]
            most, least = max(most, y[k]), min(least, y[k])
        table[a].converged, table[b].converged = False, False
        if used <= _PARAMETERS:
            continue
        base = min(y[0], y[n - 1])
        c1, c2, s, bg = centre[a] - low, centre[b] - low, w, base
        p1, p2 = int(min(max(c1 + 0.5, 0), n - 1)), int(min(max(c2 + 0.5, 0), n - 1))
        a1, a2 = max(y[p1] - base, 1.0), max(y[p2] - base, 1.0)
        settled, chi2 = False, 0.0
        for _ in range(STEPS):
            fisher[:], score[:], chi2 = 0.0, 0.0, 0.0
            for k in range(n):
                if not use[k]:
                    continue
                t1, t2 = (k - c1) / s, (k - c2) / s
                e1, e2 = math.exp(-0.5 * t1 * t1), math.exp(-0.5 * t2 * t2)
                signal = a1 * e1 + a2 * e2
                v = 1 / pixel_variance(noise, signal + bg, signal)
                slope[0], slope[1], slope[2], slope[3] = a1 * e1 * t1 / s, e1, a2 * e2 * t2 / s, e2
                slope[4], slope[5] = (a1 * e1 * t1 * t1 + a2 * e2 * t2 * t2) / s, 1.0
                r = y[k] - signal - bg
                chi2 += v * r * r
                for p in range(_PARAMETERS):
                    score[p] += v * r * slope[p]
                    for q in range(p + 1):
                        fisher[p, q] += v * slope[p] * slope[q]
            prior = 1 / (_WIDTH_ERROR * w) ** 2
            fisher[4, 4] += prior
            score[4] += prior * (w - s)
            for p in range(_PARAMETERS):
                for q in range(p):
                    fisher[q, p] = fisher[p, q]
            if not cholesky(fisher, 0.0, SINGULAR, _PARAMETERS, factor):
                break
            solve(factor, score, _PARAMETERS, step)
            d1, d2 = min(max(step[0], -s), s), min(max(step[2], -s), s)
            c1, c2 = c1 + d1, c2 + d2
            a1, a2 = max(a1 + step[1], 0.3 * a1), max(a2 + step[3], 0.3 * a2)
            ds = min(max(step[4], -0.4 * s), 0.6 * s)
            s, bg = min(max(s + ds, 0.5 * limits[0]), 2 * limits[1]), bg + step[5]
            if not (0 <= c1 <= n - 1 and 0 <= c2 <= n - 1 and c1 < c2):
                break
            if abs(d1) + abs(d2) + abs(ds) < _ATOL_PX:
                settled = True
                break
        if settled:
            for which in range(2):
                row = table[a] if which == 0 else table[b]
                score[:] = 0.0
                score[2 * which] = 1.0
                solve(factor, score, _PARAMETERS, step)
                row.variance = step[2 * which]
                score[:] = 0.0
                score[2 * which + 1] = 1.0
                solve(factor, score, _PARAMETERS, step)
                row.amplitude = a1 if which == 0 else a2
                row.snr = row.amplitude / math.sqrt(step[2 * which + 1])
                row.centre = low + (c1 if which == 0 else c2)
                row.width, row.background, row.chi2, row.dof = s, bg, chi2, used - _PARAMETERS
                row.low, row.high, row.clipped, row.converged = low, high, n - used, True
