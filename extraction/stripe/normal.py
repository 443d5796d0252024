"""Stripe points localised once more along the stripe's own normal, from the pixels that lie there."""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from extraction.config import StripeConfig
from extraction.noise import PixelNoise
from extraction.stripe.fit import Pixels
from extraction.stripe.model import (
    FEWEST_PIXELS,
    Limits,
    Peak,
    Records,
    SectionPixels,
    WidthPrior,
    centre_variance,
    climb,
    room,
)
from extraction.stripe.profile import StripePeaks
from extraction.stripe.view import StripeView
from geometry.compiled import kernel

Array = NDArray[np.float64]

_REACH = 4  # neighbours on each side that give the direction
_BREAK_PX = 4.0  # a neighbour further off the line than this, per section, belongs to another surface
MOST_PIXELS = 4096  # of a band; the rest is left out
WIDTH_ERROR = 0.25  # relative, of the width that the section's fit and the slope make one expect
HALF_BAND_PX = 0.5  # a pixel belongs to the normal that passes its centre this near: each pixel to one, as in a section


class NormalPlaces(NamedTuple):
    """Points (N,): place across and along the sections, slope, and what the section's fit found."""

    across: Array
    along: Array
    slope: Array
    amplitude: Array
    width: Array
    background: Array


# the peak by distance along the normal [px, DN], variance of its centre [px²], χ² per degree of freedom
ALONG_NORMAL = np.dtype(
    [*((name, np.float64) for name in (*Peak._fields, "variance", "chi2_per_dof")), ("converged", np.bool_)], align=True
)


def localise_along_normal(view: StripeView, peaks: StripePeaks, noise: PixelNoise, config: StripeConfig) -> StripePeaks:
    """The same points, each fitted over the pixels within half a pixel of its normal, at their own distances.

    No grey level is interpolated, so the noise stays independent. A point whose fit fails keeps its section's answer.
    """
    along, across = (0, 1) if view.turned else (1, 0)
    own = peaks.uv_px - view.origin_px
    slope = _slopes(own[:, across], own[:, along])
    limits = Limits(view.clip_dn, config.min_width_px, config.max_width_px)
    places = NormalPlaces(own[:, across], own[:, along], slope, peaks.amplitude_dn, peaks.width_px, peaks.background_dn)
    answer = np.zeros(len(peaks), ALONG_NORMAL)
    _fit_normals(view.pixels, places, limits, noise, answer)
    good = answer["converged"]
    length = np.hypot(1.0, slope)
    normal = view.directions(-slope / length, 1 / length)
    uv = peaks.uv_px + answer["centre"][:, None] * normal
    keep = ~good[:, None]
    return replace(
        peaks,
        uv_px=np.where(keep, peaks.uv_px, uv),
        normal=np.where(keep, peaks.normal, normal),
        sigma_px=np.where(good, np.sqrt(answer["variance"]), peaks.sigma_px),
        amplitude_dn=np.where(good, answer["amplitude"], peaks.amplitude_dn),
        width_px=np.where(good, answer["width"], peaks.width_px),
        background_dn=np.where(good, answer["background"], peaks.background_dn),
        chi2_per_dof=np.where(good, answer["chi2_per_dof"], peaks.chi2_per_dof),
    )


@kernel
def _slopes(across: Array, along: Array) -> Array:
    """Slope d(along)/d(across) at each point: the median of those to its near neighbours on the same surface."""
    n = len(across)
    out, some = np.zeros(n), np.empty(2 * _REACH)
    for i in range(n):
        count = 0
        for k in range(max(0, i - _REACH), min(n, i + _REACH + 1)):
            step = across[k] - across[i]
            if step != 0 and abs(step) <= 2 * _REACH and abs(along[k] - along[i]) <= _BREAK_PX * abs(step):
                some[count] = (along[k] - along[i]) / step
                count += 1
        if count >= 2:
            out[i] = np.median(some[:count])
    return out


@kernel
def _fit_normals(pixels: Pixels, places: NormalPlaces, limits: Limits, noise: PixelNoise, answer: Records) -> None:
    """Fit every point along its normal; fill the answer (N,) of ALONG_NORMAL, all zero before."""
    samples = room(MOST_PIXELS)
    for i in range(len(answer)):
        row, slope = answer[i], places.slope[i]
        width = max(places.width[i] / np.hypot(1.0, slope), limits.min_width)  # a section sees it wider by the secant
        n = _collect(pixels, places.across[i], places.along[i], slope, 4 * width + 1, limits.clip, samples)
        if n < FEWEST_PIXELS:
            continue
        start = Peak(0.0, places.amplitude[i], width, places.background[i])
        prior = WidthPrior(width, 1 / (WIDTH_ERROR * width) ** 2)
        found = climb(samples, n, start, limits, noise, prior)
        peak = found.peak
        if not found.settled or abs(peak.centre) > 2 * width or not limits.min_width <= peak.width <= limits.max_width:
            continue
        row.converged, row.variance, row.chi2_per_dof = True, centre_variance(found.fisher), found.chi2 / max(n - 4, 1)
        row.centre, row.amplitude, row.width, row.background = peak.centre, peak.amplitude, peak.width, peak.background


@kernel
def _collect(
    pixels: Pixels, across: float, along: float, slope: float, reach: float, clip: float, samples: SectionPixels
) -> int:
    """Distances along the normal (signed) and grey levels of the pixels of the band."""
    length, grey, left_out = np.hypot(1.0, slope), pixels.grey, pixels.left_out
    rows, columns = grey.shape
    n = 0
    half_c = (reach * abs(slope) + HALF_BAND_PX) / length
    half_r = (reach + HALF_BAND_PX * abs(slope)) / length
    for c in range(max(0, int(np.ceil(across - half_c))), min(columns, int(across + half_c) + 1)):
        for r in range(max(0, int(np.ceil(along - half_r))), min(rows, int(along + half_r) + 1)):
            dc, dr = c - across, r - along
            tangent, normal = (dc + slope * dr) / length, (dr - slope * dc) / length
            inside = -HALF_BAND_PX <= tangent < HALF_BAND_PX and abs(normal) <= reach
            usable = grey[r, c] < clip and (left_out.size == 0 or not left_out[r, c])
            if inside and n < len(samples.x) and usable:
                samples.x[n], samples.y[n] = normal, grey[r, c]
                n += 1
    return n
