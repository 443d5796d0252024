"""Stripe points localised once more along the stripe's own normal, from the pixels that lie there."""

from __future__ import annotations

from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from extraction.config import StripeConfig
from extraction.noise import PixelNoise
from extraction.stripe.profile import StripePeaks
from extraction.stripe.sections.climb import (
    GOING,
    LANES,
    SETTLED,
    Lanes,
    begin,
    chi2_at,
    expected_at,
    fisher_at,
    lanes,
    move,
    peak_at,
    step,
)
from extraction.stripe.sections.ground import Ground, ground_at
from extraction.stripe.sections.model import FEWEST_PIXELS, FitLimits, Peak, Records, centre_variance
from extraction.stripe.view import Pixels, StripeView
from geometry.compiled import kernel

Array = NDArray[np.float64]

_REACH = 4  # neighbours on each side that give the direction
_BREAK_PX = 4.0  # a neighbour further off the line than this, per section, belongs to another surface
MOST_PIXELS = 512  # of a band; one of the widest stripe has some 160
WIDTH_ERROR = 0.25  # relative, of the width that the section's fit and the slope make one expect
HALF_BAND_PX = 0.5  # a pixel belongs to the normal that passes its centre this near: each pixel to one, as in a section


class NormalPlaces(NamedTuple):
    """Points (N,): place across and along the sections, slope, what the section's fit found, and the ground there."""

    across: Array
    along: Array
    slope: Array
    amplitude: Array
    width: Array
    background: Array
    ground: Ground


# the peak by distance along the normal [px, DN], variance of its centre [px²], χ² per degree of freedom
ALONG_NORMAL = np.dtype(
    [*((name, np.float64) for name in (*Peak._fields, "variance", "chi2_per_dof")), ("converged", np.bool_)], align=True
)


def localise_along_normal(
    view: StripeView, peaks: StripePeaks, ground: Ground, noise: PixelNoise, config: StripeConfig
) -> StripePeaks:
    """The same points, each fitted over the pixels within half a pixel of its normal, at their own distances.

    No grey level is interpolated, so the noise stays independent. A point whose fit fails keeps its section's answer.
    """
    along, across = (0, 1) if view.turned else (1, 0)
    own = peaks.uv_px - view.origin_px
    slope = _slopes(own[:, across], own[:, along])
    limits = FitLimits(view.clip_dn, config.min_width_px, config.max_width_px)
    seen = peaks.amplitude_dn, peaks.width_px, peaks.background_dn
    places = NormalPlaces(own[:, across], own[:, along], slope, *seen, ground)
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
def _fit_normals(pixels: Pixels, places: NormalPlaces, limits: FitLimits, noise: PixelNoise, answer: Records) -> None:
    """Fit every point along its normal; fill the answer (N,) of ALONG_NORMAL, all zero before."""
    across, along, slopes, amplitude, widths, background, ground = places
    lane, total, following, n = lanes(MOST_PIXELS // 2, True), len(answer), 0, 0
    state, own, filled = lane.state, np.zeros(LANES, np.int64), np.zeros(LANES, np.int64)
    while n > 0 or following < total:
        k = 0
        while k < LANES and (k < n or following < total):
            if k < n and state[k] == GOING:
                k += 1
                continue
            if k < n:
                _report(lane, k, filled[k], limits, answer[own[k]])
            opened = False
            while not opened and following < total:
                i, slope = following, slopes[following]
                width = max(widths[i] / np.hypot(1.0, slope), limits.min_width)  # a section sees it wider by the secant
                filled[k] = _collect(pixels, across[i], along[i], slope, 4 * width + 1, limits.clip, ground, i,
                                     lane, k)  # fmt: skip
                opened = filled[k] >= FEWEST_PIXELS
                if opened:
                    start = Peak(0.0, amplitude[i], width, background[i])
                    begin(lane, k, start, -4 * width, 4 * width, width, 1 / (WIDTH_ERROR * width) ** 2)
                    own[k] = i
                following += 1
            if opened:
                k += 1
                n = max(n, k)
            elif k < n:
                n -= 1
                if k < n:
                    move(lane, n, k)
                    own[k], filled[k] = own[n], filled[n]
                lane.use[:, n] = 0.0
        if n:
            reach = 0
            for j in range(n):
                reach = max(reach, filled[j] // 2)
            step(lane, n, reach, limits, noise)


@kernel
def _report(lane: Lanes, k: int, pixels: int, limits: FitLimits, row: Any) -> None:
    """Write what lane k has found, where it is a peak near its point."""
    peak = peak_at(lane, k)
    if lane.state[k] != SETTLED or abs(peak.centre) > 2 * expected_at(lane, k):
        return
    if limits.min_width <= peak.width <= limits.max_width:
        row.converged, row.variance = True, centre_variance(fisher_at(lane, k))
        row.chi2_per_dof = chi2_at(lane, k) / max(pixels - 4, 1)
        row.centre, row.amplitude, row.width, row.background = peak.centre, peak.amplitude, peak.width, peak.background


@kernel
def _collect(
    pixels: Pixels, across: float, along: float, slope: float, reach: float, clip: float, ground: Ground, i: int,
    lane: Lanes, k: int,
) -> int:  # fmt: skip
    """Distances along the normal (signed) and grey levels of a band's pixels, to lane k; returns their number."""
    length, grey, left_out = np.hypot(1.0, slope), pixels.grey, pixels.left_out
    y, use, x = lane.y, lane.use, lane.x
    rows, columns = grey.shape
    n, middle = 0, len(use) // 2
    use[:, k] = 0.0
    half_c = (reach * abs(slope) + HALF_BAND_PX) / length
    half_r = (reach + HALF_BAND_PX * abs(slope)) / length
    for c in range(max(0, int(np.ceil(across - half_c))), min(columns, int(across + half_c) + 1)):
        for r in range(max(0, int(np.ceil(along - half_r))), min(rows, int(along + half_r) + 1)):
            dc, dr = c - across, r - along
            tangent, normal = (dc + slope * dr) / length, (dr - slope * dc) / length
            inside = -HALF_BAND_PX <= tangent < HALF_BAND_PX and abs(normal) <= reach
            usable = grey[r, c] < clip and (left_out.size == 0 or not left_out[r, c])
            if inside and n < len(use) - 1 and usable:
                row = middle + ((n + 1) // 2 if n % 2 else -(n // 2))  # about the middle: few rows are looked at
                x[row, k], y[row, k], use[row, k] = normal, grey[r, c], 1.0
                if len(ground.origin):  # it goes along with the stripe
                    y[row, k] -= ground_at(ground, i, along + dr - slope * dc)
                n += 1
    return n
