"""Stripe points localised once more along the stripe's own normal, from the pixels that lie there."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from extraction.config import StripeConfig
from extraction.stripe.fit import FEWEST_PIXELS, NoiseModel
from extraction.stripe.profile import StripePeaks
from extraction.stripe.solve import TERMS, centre_variance, climb
from extraction.stripe.view import StripeView
from geometry.compiled import kernel

Array = NDArray[np.float64]

_REACH = 4  # neighbours on each side that give the direction
_BREAK_PX = 4.0  # a neighbour further off the line than this, per section, belongs to another surface
HALF_BAND_PX = 0.5  # a pixel belongs to the normal that passes its centre this near: each pixel to one, as in a section


def localise_along_normal(view: StripeView, peaks: StripePeaks, noise: NoiseModel, config: StripeConfig) -> StripePeaks:
    """The same points, each fitted over the pixels within half a pixel of its normal, at their own distances.

    No grey level is interpolated, so the noise stays independent. A point whose fit fails keeps its section's answer.
    """
    along, across = (0, 1) if view.turned else (1, 0)
    own = peaks.uv_px - view.origin_px
    slope = _slopes(own[:, across], own[:, along])
    limits = (view.clip_dn, config.min_width_px, config.max_width_px)
    start = np.column_stack(
        [own[:, across], own[:, along], slope, peaks.amplitude_dn, peaks.width_px, peaks.background_dn]
    )
    answer = _fit_normals(view.grey, view.left_out, start, limits, noise.as_array())
    good = answer[:, 0] > 0
    length = np.hypot(1.0, slope)
    normal = view.directions(-slope / length, 1 / length)
    uv = peaks.uv_px + answer[:, 1, None] * normal
    keep = ~good[:, None]
    return replace(
        peaks,
        uv_px=np.where(keep, peaks.uv_px, uv),
        normal=np.where(keep, peaks.normal, normal),
        sigma_px=np.where(good, np.sqrt(answer[:, 2]), peaks.sigma_px),
        amplitude_dn=np.where(good, answer[:, 3], peaks.amplitude_dn),
        width_px=np.where(good, answer[:, 4], peaks.width_px),
        background_dn=np.where(good, answer[:, 5], peaks.background_dn),
        chi2_per_dof=np.where(good, answer[:, 6], peaks.chi2_per_dof),
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
def _fit_normals(
    grey: NDArray[np.generic],
    left_out: NDArray[np.bool_],
    start: Array,
    limits: tuple[float, float, float],
    noise: Array,
) -> Array:
    """Per point: success, shift along the normal, its variance, amplitude, σ, background, χ² per degree (N, 7)."""
    out = np.zeros((len(start), 7))
    most = 4096
    x, y, bell = np.empty(most), np.empty(most), np.empty(most)
    use, p, work = np.ones(most, dtype=np.bool_), np.empty(4), np.empty(TERMS)
    for i in range(len(start)):
        length = np.hypot(1.0, start[i, 2])
        width = max(start[i, 4] / length, limits[1])  # a section sees the stripe wider by the secant
        reach = 4 * width + 1
        n = _collect(grey, left_out, start[i], reach, limits[0], x, y)
        if n < FEWEST_PIXELS:
            continue
        p[0], p[1], p[2], p[3] = 0.0, start[i, 3], width, start[i, 5]
        if climb(x, y, use, n, p, bell, limits, noise, (width, 1 / (0.25 * width) ** 2), work) == 0:
            continue
        if abs(p[0]) > 2 * width or not limits[1] <= p[2] <= limits[2]:
            continue
        out[i, 0], out[i, 1], out[i, 2] = 1.0, p[0], centre_variance(work)
        out[i, 3], out[i, 4], out[i, 5], out[i, 6] = p[1], p[2], p[3], work[14] / max(n - 4, 1)
    return out


@kernel
def _collect(
    grey: NDArray[np.generic], left_out: NDArray[np.bool_], start: Array, reach: float, clip: float, x: Array, y: Array
) -> int:
    """Distances along the normal (signed) and grey levels of the pixels of the band."""
    slope, length = start[2], np.hypot(1.0, start[2])
    rows, columns = grey.shape
    n = 0
    half_c = (reach * abs(slope) + HALF_BAND_PX) / length
    half_r = (reach + HALF_BAND_PX * abs(slope)) / length
    for c in range(max(0, int(np.ceil(start[0] - half_c))), min(columns, int(start[0] + half_c) + 1)):
        for r in range(max(0, int(np.ceil(start[1] - half_r))), min(rows, int(start[1] + half_r) + 1)):
            dc, dr = c - start[0], r - start[1]
            tangent, normal = (dc + slope * dr) / length, (dr - slope * dc) / length
            inside = -HALF_BAND_PX <= tangent < HALF_BAND_PX and abs(normal) <= reach
            if inside and n < len(x) and grey[r, c] < clip and (left_out.size == 0 or not left_out[r, c]):
                x[n], y[n] = normal, grey[r, c]
                n += 1
    return n
