"""Compiled loop over an image's candidates: cut the window, fit, leave out what is no part of the spot, fit again."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from extraction import spot_noise as sn
from extraction.compiled import compiled
from extraction.gaussian_fit import Array, Mask, fit_window

# columns of the result: 0-13 as `fit_window` writes them, then
CONVERGED, CLIPPED, FOREIGN, LEFT_OUT, USED, NOISE = range(14, 20)
COLUMNS = NOISE + sn.COLUMNS

OUTLIER_SIGMA = 5.0  # a pixel this far above the model, outside the spot, belongs to something else
OUTSIDE = 6.0  # squared distance from the centre, in the spot's own widths
NEAR = 16.0  # the same; what lies farther away does not crowd a spot


@compiled
def fit_frame(
    image: NDArray[Any],
    owner: NDArray[np.int32],
    index: NDArray[np.int64],
    windows: NDArray[np.int64],
    starts: Array,
    noises: Array,
    terms: NDArray[np.int64],
    clip: float,
    grain: float,
    max_iterations: int,
) -> Array:
    """Fit every candidate; returns the table (N, COLUMNS), positions in image pixels.

    index (N,): the candidate's number in ``owner``. windows (N, 4): left, top, right, bottom, the last two excluded.
    starts (N, 9), noises (N, 4), terms (N,): as `fit_window` takes them, starts in image pixels.
    clip: grey level from which a pixel is saturated.
    """
    table = np.zeros((len(index), COLUMNS))
    for k in range(len(index)):
        left, top, right, bottom = windows[k]
        data = np.empty((bottom - top, right - left))
        use = np.empty((bottom - top, right - left), np.bool_)
        row = table[k]
        start = starts[k].copy()
        start[0] -= left
        start[1] -= top
        _cut(image, owner, index[k], left, top, clip, start, data, use, row)
        row[CONVERGED] = fit_window(data, use, start, terms[k], noises[k], max_iterations, row)
        row[LEFT_OUT] = _leave_out(data, use, row, noises[k])
        if row[LEFT_OUT] > 0:
            start[:] = row[:9]
            row[CONVERGED] = fit_window(data, use, start, terms[k], noises[k], max_iterations, row)
        row[USED] = np.sum(use) - terms[k]
        sn.spot_noise(data, use, row[:9], terms[k], noises[k], grain, row[NOISE:])
        row[0] += left
        row[1] += top
    return table


@compiled
def _cut(
    image: NDArray[Any],
    owner: NDArray[np.int32],
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
            foreign = other >= 0 and other != k
            data[j, i] = value
            use[j, i] = not clipped and not foreign
            x, y = i - p[0], j - p[1]
            if p[3] * x * x + 2.0 * p[4] * x * y + p[5] * y * y < NEAR:
                row[CLIPPED] += 1.0 if clipped and not foreign else 0.0
                row[FOREIGN] += 1.0 if foreign else 0.0


@compiled
def _leave_out(data: Array, use: Mask, p: Array, noise: Array) -> int:
    """Clear the pixels outside the spot that stand far above the model; returns how many."""
    rows, columns = data.shape
    count = 0
    for j in range(rows):
        for i in range(columns):
            x, y = i - p[0], j - p[1]
            distance = p[3] * x * x + 2.0 * p[4] * x * y + p[5] * y * y
            if use[j, i] and distance > OUTSIDE:
                signal = p[2] * np.exp(-0.5 * distance)
                mu = signal + p[6] + p[7] * (i - 0.5 * (columns - 1)) + p[8] * (j - 0.5 * (rows - 1))
                variance = noise[0] + noise[1] * max(mu - noise[2], 0.0) + noise[3] * signal * signal
                if data[j, i] - mu > OUTLIER_SIGMA * np.sqrt(variance):
                    use[j, i] = False
                    count += 1
    return count
