"""Compiled loop over an image's candidates: cut the window, fit, leave out what is no part of the spot, fit again."""

from __future__ import annotations

import math
from typing import Any

from numpy.typing import NDArray

from extraction.spots.fit import RESULT_COLUMNS, Array, Mask, fit_window
from geometry.compiled import kernel

# columns of the table after those that `fit_window` writes
CONVERGED, CLIPPED, FOREIGN, LEFT_OUT = range(RESULT_COLUMNS, RESULT_COLUMNS + 4)
COLUMNS = RESULT_COLUMNS + 4

OUTLIER_SIGMA = 5.0  # a pixel this far above the model, outside the spot, belongs to something else
OUTSIDE = 6.0  # squared distance from the centre, in the spot's own widths
FRAGMENT = 0.4  # of the height, below which a neighbouring region is a grain of the spot's own wing
NEAR = 16.0  # the same; what lies farther away does not crowd a spot


@kernel
def fit_frame(
    image: NDArray[Any],
    owner: NDArray[Any],
    height: Array,
    index: NDArray[Any],
    windows: NDArray[Any],
    starts: Array,
    noises: Array,
    terms: NDArray[Any],
    clip: float,
    max_iterations: int,
    data: Array,
    use: Mask,
    table: Array,
) -> None:
    """Fit every candidate; fills data and use (N, R, C) with the windows and table (N, COLUMNS) with the fits.

    height (M,): of every candidate. index (N,): the candidate's number, in ``owner`` one more. windows (N, 4): left,
    top, columns, rows. starts (N, 9), noises (N, 5), terms (N,): as `fit_window` takes them; positions from the
    window's first pixel.
    clip: grey level from which a pixel is saturated. data, use, table come as zeros.
    """
    for k in range(len(index)):
        columns, rows = windows[k, 2], windows[k, 3]
        values, valid, row = data[k, :rows, :columns], use[k, :rows, :columns], table[k]
        _cut(image, owner, height, index[k], windows[k, 0], windows[k, 1], clip, starts[k], values, valid, row)
        row[CONVERGED] = fit_window(values, valid, starts[k], terms[k], noises[k], max_iterations, row)
        row[LEFT_OUT] = _leave_out(values, valid, row, noises[k])
        if row[LEFT_OUT] > 0:
            row[CONVERGED] = fit_window(values, valid, row, terms[k], noises[k], max_iterations, row)


@kernel
def _cut(
    image: NDArray[Any],
    owner: NDArray[Any],
    height: Array,
    k: int,
    left: int,
    top: int,
    clip: float,
    p: Array,
    data: Array,
    use: Mask,
    row: Array,
) -> None:
    """Copy the window; leave out clipped pixels and those of other candidates, and count those within the spot p."""
    for j in range(data.shape[0]):
        for i in range(data.shape[1]):
            value = float(image[top + j, left + i])
            other = owner[top + j, left + i]
            clipped = value >= clip
            foreign = other > 0 and other != k + 1 and height[other - 1] > FRAGMENT * height[k]
            data[j, i] = value
            use[j, i] = not clipped and not foreign
            x, y = i - p[0], j - p[1]
            if p[3] * x * x + 2.0 * p[4] * x * y + p[5] * y * y < NEAR:
                row[CLIPPED] += 1.0 if clipped and not foreign else 0.0
                row[FOREIGN] += 1.0 if foreign else 0.0


@kernel
def _leave_out(data: Array, use: Mask, p: Array, noise: Array) -> int:
    """Clear the pixels outside the spot that stand far above the model; returns how many."""
    count = 0
    for j in range(data.shape[0]):
        for i in range(data.shape[1]):
            x, y = i - p[0], j - p[1]
            distance = p[3] * x * x + 2.0 * p[4] * x * y + p[5] * y * y
            if use[j, i] and distance > OUTSIDE:
                signal = p[2] * math.exp(-0.5 * distance)
                mu = signal + p[6] + p[7] * i + p[8] * j
                variance = noise[0] + noise[1] * max(mu - noise[2], 0.0) + noise[3] * signal * signal + noise[4]
                excess = data[j, i] - mu
                if excess > 0.0 and excess * excess > OUTLIER_SIGMA * OUTLIER_SIGMA * variance:
                    use[j, i] = False
                    count += 1
    return count
