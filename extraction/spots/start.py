"""Compiled start of the fits: from each region's moments its spot's shape, the window and the start parameters."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from extraction.spots.fit import Array
from geometry.compiled import kernel

MIN_START_VARIANCE_PX2 = 0.3
MARGIN_PX = 2.0  # of a window beside `window_sigma` widths
LEAST_HALF_PX = 4.0


@kernel
def start_fits(
    mean: Array,
    region: Array,
    height: Array,
    ring: Array,
    share: float,
    blur_px: float,
    window_sigma: float,
    max_half_px: float,
    size: tuple[int, int],
    windows: NDArray[np.int64],
    starts: Array,
) -> None:
    """Fill windows (N, 4), left, top, columns, rows in the image of ``size`` (rows, columns), and starts (N, 9).

    mean (N, 2), region (N, 2, 2): moments of the regions on the blurred image. height, ring (N,): peak above its
    surroundings there, and these [DN]. share: of a spot's variance that its region's moments have. blur_px: σ of the
    blur. max_half_px: largest half window. The positions of the starts are from each window's first pixel.
    """
    blur = blur_px * blur_px
    for k in range(len(mean)):
        # the region's shape without the blur, its principal variances bounded from below
        uu, uv, vv = region[k, 0, 0] / share - blur, region[k, 0, 1] / share, region[k, 1, 1] / share - blur
        middle, tilt = 0.5 * (uu + vv), 0.5 * (uu - vv)
        half = math.hypot(tilt, uv)
        long, short = max(middle + half, MIN_START_VARIANCE_PX2), max(middle - half, MIN_START_VARIANCE_PX2)
        middle, turn = 0.5 * (long + short), 0.5 * (long - short) / half if half > 0.0 else 0.0
        uu, uv, vv = middle + turn * tilt, turn * uv, middle - turn * tilt
        for axis in range(2):
            reach = float(math.ceil(window_sigma * math.sqrt(uu if axis == 0 else vv) + MARGIN_PX))
            reach = min(max(reach, LEAST_HALF_PX), max_half_px)
            centre = np.rint(mean[k, axis])
            low, high = max(centre - reach, 0.0), min(centre + reach + 1.0, float(size[1 - axis]))
            windows[k, axis], windows[k, 2 + axis] = int(low), int(high - low)
            starts[k, axis] = mean[k, axis] - low
        det = uu * vv - uv * uv
        # the blur lowered the peak by √(det Σ / det (Σ + blur))
        starts[k, 2] = height[k] * math.sqrt(((uu + blur) * (vv + blur) - uv * uv) / det)
        starts[k, 3], starts[k, 4], starts[k, 5] = vv / det, -uv / det, uu / det
        starts[k, 6], starts[k, 7], starts[k, 8] = ring[k], 0.0, 0.0
