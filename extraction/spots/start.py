"""Compiled start of the fits: from each region's moments its spot's shape, the window and the start parameters."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from extraction.spots.model import Array, Records, precision
from geometry.compiled import kernel

MIN_START_VARIANCE_PX2 = 0.3  # of a start: a spot as narrow as the optics draw, from which the fit finds narrower ones
MARGIN_PX = 2.0  # of a window beside `window_sigma` widths: pixels that tell of the background
LEAST_HALF_PX = 4.0  # of a window: 81 pixels for nine parameters


class Regions(NamedTuple):
    """Moments of the regions on the blurred image: mean (N, 2), covariance (N, 2, 2); the peaks' height over their
    surroundings there, and these (N,) [DN].
    """

    mean: Array
    covariance: Array
    height: Array
    ring: Array


class StartRule(NamedTuple):
    """How windows and starts are made.

    share: of a spot's variance that its region's moments have. blur_px: σ of the blur. window_sigma: half a window in
    spot widths. max_half_px: largest half window. rows, columns: of the image.
    """

    share: float
    blur_px: float
    window_sigma: float
    max_half_px: float
    rows: int
    columns: int


@kernel
def start_fits(regions: Regions, rule: StartRule, places: Records, starts: Records) -> None:
    """Fill the windows' places and sizes (N,) of PLACE, and the starts (N,) of SPOT, with a flat background."""
    blur = rule.blur_px * rule.blur_px
    for k in range(len(places)):
        start, place, covariance = starts[k], places[k], regions.covariance[k]
        # the region's shape without the blur, its principal variances bounded from below
        uu, vv = covariance[0, 0] / rule.share - blur, covariance[1, 1] / rule.share - blur
        uv = covariance[0, 1] / rule.share
        middle, tilt = 0.5 * (uu + vv), 0.5 * (uu - vv)
        half = math.hypot(tilt, uv)
        long, short = max(middle + half, MIN_START_VARIANCE_PX2), max(middle - half, MIN_START_VARIANCE_PX2)
        middle, turn = 0.5 * (long + short), 0.5 * (long - short) / half if half > 0.0 else 0.0
        uu, uv, vv = middle + turn * tilt, turn * uv, middle - turn * tilt
        place.left, place.columns = _extent(regions.mean[k, 0], uu, rule, rule.columns)
        place.top, place.rows = _extent(regions.mean[k, 1], vv, rule, rule.rows)
        start.u, start.v = regions.mean[k, 0] - place.left, regions.mean[k, 1] - place.top
        det = uu * vv - uv * uv
        # the blur lowered the peak by √(det Σ / det (Σ + blur))
        start.height = regions.height[k] * math.sqrt(((uu + blur) * (vv + blur) - uv * uv) / det)
        start.a, start.h, start.c = precision(uu, uv, vv)
        start.level, start.slope_u, start.slope_v = regions.ring[k], 0.0, 0.0


@kernel
def _extent(centre: float, variance: float, rule: StartRule, size: int) -> tuple[int, int]:
    """First pixel and number of pixels of a window along one axis, within the image."""
    reach = float(math.ceil(rule.window_sigma * math.sqrt(variance) + MARGIN_PX))
    reach = min(max(reach, LEAST_HALF_PX), rule.max_half_px)
    middle = np.rint(centre)
    low, high = max(middle - reach, 0.0), min(middle + reach + 1.0, float(size))
    return int(low), int(high - low)
