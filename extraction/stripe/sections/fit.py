"""The sections of a stripe, fitted one by one: maximum likelihood of a Gaussian under the camera's noise."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from extraction.noise import PixelNoise
from extraction.stripe.sections.climb import (
    GOING,
    LANES,
    SETTLED,
    Lanes,
    begin,
    chi2_at,
    fisher_at,
    lanes,
    move,
    peak_at,
    step,
)
from extraction.stripe.sections.ground import Ground, ground_at
from extraction.stripe.sections.model import FEWEST_PIXELS, Array, FitLimits, Mask, Peak, Records, centre_variance
from extraction.stripe.sections.plateau import PLATEAU_PIXELS, between_flanks
from extraction.stripe.view import IntArray, Pixels
from geometry.compiled import kernel

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


class SectionPlaces(NamedTuple):
    """What is to be fitted (N,): section, middle of the search, rows low … high - 1 that are its own; expected σ; what
    ground is taken off.
    """

    section: IntArray
    centre: Array
    low: IntArray
    high: IntArray
    width: Array
    ground: Ground


@kernel
def peak_of(record: Any) -> Peak:
    """The peak of one record of a SECTION array."""
    return Peak(record.centre, record.amplitude, record.width, record.background)


# of a lane: the place that it fits, the middle of its window and half of it, windows tried, first row, the row after
# its last, half of the rows of the lane that hold pixels
WINDOW = np.dtype([(name, np.int64) for name in ("place", "centre", "half", "tried", "low", "high", "filled")])


class FitTask(NamedTuple):
    """What is the same for all sections of an image: expected widths' relative error, largest half of a window."""

    width_error: float
    widest: int
    limits: FitLimits
    noise: PixelNoise


def fit_sections(
    pixels: Pixels, places: SectionPlaces, width_error: float, limits: FitLimits, noise: PixelNoise, table: Records
) -> None:
    """Fit every section; fill the table (N,) of SECTION, all zero before.

    width_error: relative, of the expected widths; infinite where nothing is expected.
    """
    task = FitTask(width_error, int(4 * limits.max_width) + 2, limits, noise)
    _fit_sections(pixels, places, task, table, np.zeros(LANES, WINDOW))


@kernel
def _fit_sections(pixels: Pixels, places: SectionPlaces, task: FitTask, table: Records, window: Records) -> None:
    (grey, left_out), (section, start, low, high, expected, ground) = pixels, places  # taken out once: each costs a
    lane, total = lanes(task.widest, False), len(section)  # count of references
    state, use, scratch = lane.state, lane.use, np.empty(2 * task.widest + 1)
    n, following, reach = 0, 0, 0
    while n > 0 or following < total:
        k = 0
        while k < LANES and (k < n or following < total):
            if k < n and state[k] == GOING:
                k += 1
                continue
            going = k < n and _close(lane, k, low, high, window[k], table[window[k].place])
            while True:
                if going:
                    i = window[k].place
                    going = _look(grey, left_out, section[i], low[i], high[i], start[i], expected[i], ground, i, task,
                                  lane, k, scratch, window[k], table[i])  # fmt: skip
                if going or following == total:
                    break
                window[k].place, window[k].tried, going = following, 0, True
                window[k].centre = int(start[following] + 0.5)
                window[k].half = min(_half(expected[following]), task.widest)
                following += 1
            if going:
                k += 1
                n = max(n, k)
            elif k < n:
                n -= 1
                if k < n:
                    move(lane, n, k)
                    _copy(window[n], window[k])
                use[:, n] = 0.0
                window[n].filled = 0
        reach = 0
        for k in range(n):
            reach = max(reach, window[k].half)
        if n:
            step(lane, n, reach, task.limits, task.noise)


@kernel
def _copy(source: Any, target: Any) -> None:
    target.place, target.centre, target.half, target.tried = source.place, source.centre, source.half, source.tried
    target.low, target.high, target.filled = source.low, source.high, source.filled


@kernel(inline=True)
def _look(
    grey: NDArray[Any], left_out: Mask, section: int, low: int, high: int, start: float, expected: float,
    ground: Ground, i: int, task: FitTask, lane: Lanes, k: int, scratch: Array, window: Any, row: Any,
) -> bool:  # fmt: skip
    """Give lane k the pixels of its window and a start; False where there is nothing to climb."""
    y, use, clip = lane.y, lane.use, task.limits.clip
    whole, middle, centre, half = left_out.size == 0, len(use) // 2, window.centre, window.half
    while window.tried < WINDOWS:
        window.tried += 1
        lo, hi = max(low, centre - half), min(high, centre + half + 1)
        n, at = 0, lo - centre + middle
        for j in range(middle - window.filled, middle + window.filled + 1):
            use[j, k] = 0.0
        window.filled = half
        for j in range(hi - lo):
            value = float(grey[lo + j, section])
            usable = value < clip and (whole or not left_out[lo + j, section])
            scratch[j], y[at + j, k], use[at + j, k] = value, value, 1.0 if usable else 0.0
            n += usable
        window.half, window.low, window.high = half, lo, hi
        row.clipped, row.dof, row.converged = hi - lo - n, n - 4, False
        if n < FEWEST_PIXELS + (hi - lo) // 3 and half < task.widest:  # mostly clipped: its flanks lie further out
            half = min(2 * half, task.widest)
            continue
        if n < FEWEST_PIXELS:
            return False
        if hi - lo - n >= PLATEAU_PIXELS and between_flanks(scratch[: hi - lo], clip, task.noise, row):
            row.centre += lo
            row.low, row.high, row.dof = lo, hi, 0.0
            return False
        if len(ground.origin):
            for j in range(hi - lo):
                scratch[j] -= ground_at(ground, i, float(lo + j))
                y[at + j, k] = scratch[j]
        guess = _guess(scratch, hi - lo, start - lo, expected)
        begin(lane, k, Peak(guess.centre + lo - centre, guess.amplitude, guess.width, guess.background),
              lo - centre, hi - 1 - centre, expected, 1.0 / (expected * task.width_error) ** 2)  # fmt: skip
        return True
    return False


@kernel(inline=True)
def _close(lane: Lanes, k: int, low: IntArray, high: IntArray, window: Any, row: Any) -> bool:
    """Write what lane k has found; whether it goes on in another window, as its width and centre are known now."""
    peak, centre, half = peak_at(lane, k), window.centre, window.half
    row.converged = lane.state[k] == SETTLED
    if row.converged:
        fisher = fisher_at(lane, k)
        row.low, row.high, row.centre, row.amplitude = window.low, window.high, centre + peak.centre, peak.amplitude
        row.width, row.background, row.floor = peak.width, peak.background, 0.0
        row.variance, row.chi2 = centre_variance(fisher), chi2_at(lane, k)
        row.snr = peak.amplitude * math.sqrt(fisher.a11)
    wanted, place = _half(peak.width), int(centre + peak.centre + 0.5)
    if abs(wanted - half) <= 1 + half // 4 and abs(place - centre) <= 2:
        return False
    window.half = min(wanted, len(lane.use) // 2)
    window.centre = min(max(place, low[window.place]), high[window.place] - 1)
    return True


@kernel
def _half(width: float) -> int:
    """Half a window for a peak of that σ."""
    return max(LEAST_HALF_PX, int(HALF_SIGMA * width + HALF_PX))


@kernel(inline=True)
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
