"""The sections of a stripe, fitted one by one: maximum likelihood of a Gaussian under the camera's noise."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from extraction.noise import PixelNoise
from extraction.stripe.model import (
    FEWEST_PIXELS,
    Array,
    Climb,
    Limits,
    Mask,
    Peak,
    Records,
    SectionPixels,
    WidthPrior,
    centre_variance,
    climb,
    room,
)
from extraction.stripe.plateau import PLATEAU_PIXELS, between_flanks
from geometry.compiled import kernel

IntArray = NDArray[np.int32]

HALF_SIGMA, HALF_PX, LEAST_HALF_PX = 3.5, 2.5, 4  # half a section's window: so many σ and pixels more, at least
WINDOWS = 4  # tried of a section, as its width and centre become known

# one fitted section: the peak [px, DN]; variance of the centre, and the part of it that neighbours share [px²];
# amplitude over its σ; χ² with its degrees of freedom; clipped pixels; whether it settled; the rows low … high - 1 of
# its window
SECTION = np.dtype(
    [
        *((name, np.float64) for name in (*Peak._fields, "variance", "floor", "snr", "chi2", "dof")),
        *((name, np.int64) for name in ("clipped", "low", "high")),
        ("converged", np.bool_),
    ],
    align=True,
)


class Pixels(NamedTuple):
    """Grey levels with sections as columns (H, W), and which to leave out (H, W), or (0, 0) for none."""

    grey: NDArray[Any]
    left_out: Mask


class SectionPlaces(NamedTuple):
    """What is to be fitted (N,): section, middle of the search, rows low … high - 1 that are its own; expected σ."""

    section: IntArray
    centre: Array
    low: IntArray
    high: IntArray
    width: Array


@kernel
def peak_of(record: Any) -> Peak:
    """The peak of one record of a SECTION array."""
    return Peak(record.centre, record.amplitude, record.width, record.background)


@kernel
def fit_sections(
    pixels: Pixels, places: SectionPlaces, width_error: float, limits: Limits, noise: PixelNoise, table: Records
) -> None:
    """Fit every section; fill the table (N,) of SECTION, all zero before.

    width_error: relative, of the expected widths; infinite where nothing is expected.
    """
    samples = room(len(pixels.grey))
    y, (section, start, low, high, expected) = samples.y, places  # taken out once: each costs a count of references
    for k in range(len(samples.x)):
        samples.x[k] = k
    widest = int(4 * limits.max_width) + 2
    for i in range(len(section)):
        row, width = table[i], expected[i]
        centre, half = int(start[i] + 0.5), _half(width)
        prior = WidthPrior(width, 1.0 / (width * width_error) ** 2)
        for _ in range(WINDOWS):  # the window follows the width and the centre that it finds
            lo, hi = max(low[i], centre - half), min(high[i], centre + half + 1)
            n = _read(pixels, section[i], lo, hi, limits.clip, samples)
            row.clipped, row.dof, row.converged = hi - lo - n, n - 4, False
            if n < FEWEST_PIXELS + (hi - lo) // 3 and half < widest:  # mostly clipped: its flanks lie further out
                half = min(2 * half, widest)
                continue
            if n < FEWEST_PIXELS:
                break
            if hi - lo - n >= PLATEAU_PIXELS and between_flanks(y[: hi - lo], limits.clip, noise, row):
                row.centre += lo
                row.low, row.high, row.dof = lo, hi, 0.0
                break
            found = climb(samples, hi - lo, _guess(y, hi - lo, start[i] - lo, width), limits, noise, prior)
            row.converged = found.settled
            if found.settled:
                _report(found, lo, hi, row)
            wanted, place = _half(found.peak.width), int(lo + found.peak.centre + 0.5)
            if abs(wanted - half) <= 1 + half // 4 and abs(place - centre) <= 2:
                break
            half, centre = min(wanted, widest), min(max(place, low[i]), high[i] - 1)


@kernel
def _report(found: Climb, low: int, high: int, row: Any) -> None:
    """Write a fit of the rows low … high - 1 to its record."""
    peak, fisher = found.peak, found.fisher
    row.low, row.high, row.centre, row.amplitude = low, high, low + peak.centre, peak.amplitude
    row.width, row.background = peak.width, peak.background
    row.floor = 0.0
    row.variance, row.chi2, row.snr = centre_variance(fisher), found.chi2, peak.amplitude * math.sqrt(fisher.a11)


@kernel
def _half(width: float) -> int:
    """Half a window for a peak of that σ."""
    return max(LEAST_HALF_PX, int(HALF_SIGMA * width + HALF_PX))


@kernel
def _read(pixels: Pixels, column: int, low: int, high: int, clip: float, samples: SectionPixels) -> int:
    """Copy a section's rows and mark its usable pixels; returns their number."""
    grey, left_out = pixels.grey, pixels.left_out
    n = 0
    for k in range(high - low):
        value = float(grey[low + k, column])
        samples.y[k] = value
        samples.use[k] = value < clip and (left_out.size == 0 or not left_out[low + k, column])
        n += samples.use[k]
    return n


@kernel
def _guess(y: Array, n: int, start: float, width: float) -> Peak:
    """A start from the window's ends and its highest three pixels."""
    background = 0.25 * (y[0] + y[1] + y[n - 1] + y[n - 2])
    best, peak = -np.inf, 1
    for k in range(max(1, int(start) - 3), min(n - 1, int(start) + 5)):
        three = y[k - 1] + y[k] + y[k + 1]
        if three > best:
            best, peak = three, k
    amplitude = max(best / 3 - background, 0.5)
    shift = 0.25 * width * width * (y[peak + 1] - y[peak - 1]) / amplitude  # half of what a noiseless peak asks for
    return Peak(peak + min(max(shift, -0.5), 0.5), amplitude, width, background)
