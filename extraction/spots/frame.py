"""Compiled loop over an image's candidates: cut the window, fit, leave out what is no part of the spot, fit again."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from extraction.noise import PixelNoise, noise_of, pixel_variance
from extraction.spots.fit import FittedSpots, Window, Windows, fit_window, window_of, write_fit
from extraction.spots.model import Array, Records, Spot, background, distance2, spot_of
from geometry.compiled import kernel

OUTLIER_SIGMA = 5.0  # a pixel this far above the model, outside the spot, belongs to something else: noise has none
OUTSIDE = 6.0  # squared distance from the centre, in the spot's own widths: 95 % of the light lies within
FRAGMENT = 0.4  # of the height, below which a neighbouring region is a grain of the spot's own wing
NEAR = 16.0  # squared distance within which other candidates crowd a spot: four widths


class SpotImage(NamedTuple):
    """An image as its fits see it.

    grey (H, W). owner: 1 + number of the candidate that a pixel belongs to, 0 for none (H, W). height: of every
    candidate (M,) [DN]. clip: grey level from which a pixel is saturated.
    """

    grey: NDArray[Any]
    owner: NDArray[np.int16]
    height: Array
    clip: float


class Tasks(NamedTuple):
    """What is to be fitted, N records each of type PLACE, SPOT (from the window's first pixel) and NOISE."""

    place: Records
    start: Records
    noise: Records


@dataclass(frozen=True, eq=False)
class Fits:
    """What the fits of N spots saw and found: their windows (N, R, C), and a record each of PLACE, SPOT and NOISE."""

    windows: Windows
    place: Records
    spot: Records
    noise: Records

    def __getitem__(self, chosen: NDArray[np.intp]) -> Fits:
        """Those of the chosen spots."""
        windows = Windows(self.windows.grey[chosen], self.windows.use[chosen])
        return Fits(windows, self.place[chosen], self.spot[chosen], self.noise[chosen])


@kernel
def fit_frame(view: SpotImage, tasks: Tasks, max_iterations: int, windows: Windows, found: FittedSpots) -> None:
    """Fit every spot; fill the windows and what was found (N,), all zero before."""
    for k in range(len(found.fit)):
        place, start, noise, row = tasks.place[k], spot_of(tasks.start[k]), noise_of(tasks.noise[k]), found.fit[k]
        window = window_of(windows, k, place)
        row.clipped, row.foreign = _cut(view, place, start, window)
        fit = fit_window(window, start, place.terms, noise, max_iterations)
        row.left_out = _leave_out(window, fit.spot, noise)
        if row.left_out > 0:
            fit = fit_window(window, fit.spot, place.terms, noise, max_iterations)
        write_fit(fit, found, k)


@kernel
def _cut(view: SpotImage, place: Any, spot: Spot, window: Window) -> tuple[int, int]:
    """Copy the window; leave out clipped pixels and those of other candidates; → how many there are within the spot."""
    k, clipped_near, foreign_near = place.candidate, 0, 0
    for j in range(place.rows):
        for i in range(place.columns):
            value = float(view.grey[place.top + j, place.left + i])
            other = view.owner[place.top + j, place.left + i]
            clipped = value >= view.clip
            foreign = other > 0 and other != k + 1 and view.height[other - 1] > FRAGMENT * view.height[k]
            window.grey[j, i] = value
            window.use[j, i] = not clipped and not foreign
            if distance2(spot, i - spot.u, j - spot.v) < NEAR:
                clipped_near += 1 if clipped and not foreign else 0
                foreign_near += 1 if foreign else 0
    return clipped_near, foreign_near


@kernel
def _leave_out(window: Window, spot: Spot, noise: PixelNoise) -> int:
    """Clear the pixels outside the spot that stand far above the model; → how many."""
    count = 0
    for j in range(window.grey.shape[0]):
        for i in range(window.grey.shape[1]):
            distance = distance2(spot, i - spot.u, j - spot.v)
            if window.use[j, i] and distance > OUTSIDE:
                signal = spot.height * math.exp(-0.5 * distance)
                mu = signal + background(spot, i, j)
                excess = window.grey[j, i] - mu
                limit2 = OUTLIER_SIGMA * OUTLIER_SIGMA * pixel_variance(noise, mu, signal)
                if excess > 0.0 and excess * excess > limit2:
                    window.use[j, i] = False
                    count += 1
    return count
