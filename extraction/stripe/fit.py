"""One stripe section: maximum likelihood of a Gaussian on a background under the camera's noise (Fisher scoring)."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from extraction.stripe.columns import (
    AMPLITUDE,
    BACKGROUND,
    CENTRE,
    CHI2,
    CLIPPED,
    CONVERGED,
    DOF,
    HIGH,
    LOW,
    SNR,
    VARIANCE,
    WIDTH,
)
from extraction.stripe.plateau import PLATEAU_PIXELS, between_flanks
from extraction.stripe.solve import TERMS, centre_variance, climb
from geometry.compiled import kernel

Array = NDArray[np.float64]

FEWEST_PIXELS = 5  # four parameters and one to spare


@dataclass(frozen=True)
class NoiseModel:
    """Variance of a pixel at mean μ: read² + gain·(μ - black) + (speckle·signal)² [DN²], signal = μ - background.

    read_variance_dn2 includes quantisation. gain_dn: grey levels per electron. speckle: contrast.
    """

    read_variance_dn2: float
    gain_dn: float
    speckle: float
    black_dn: float

    def as_array(self) -> Array:
        """What the kernels take (4,)."""
        return np.array([self.read_variance_dn2, self.gain_dn, self.speckle**2, self.black_dn])

    def scaled(self, factor: float) -> NoiseModel:
        """The model with all variances multiplied by ``factor``."""
        return NoiseModel(
            factor * self.read_variance_dn2, factor * self.gain_dn, np.sqrt(factor) * self.speckle, self.black_dn
        )


@kernel
def fit_sections(
    image: NDArray[np.generic],
    clipped: NDArray[np.bool_],
    place: tuple[NDArray[np.int32], Array, NDArray[np.int32], NDArray[np.int32]],
    widths: tuple[Array, float],
    limits: tuple[float, float, float],
    noise: Array,
) -> Array:
    """Gaussian fits of the candidates, one row of 12 each: centre, amplitude, σ, background, ….

    image (H, W); clipped: pixels to leave out (H, W), or (0, 0) for none; place: section, centre, low and high as in
    `Candidates`; widths: expected σ per candidate and that expectation's relative error, infinite for none;
    limits: the smallest grey level that is clipped, smallest and largest σ.
    """
    section, start, low, high = place
    out = np.zeros((len(section), 12))
    y, use, work = np.empty(len(image)), np.empty(len(image), dtype=np.bool_), np.empty(TERMS)
    p, bell, x = np.empty(4), np.empty(len(image)), np.empty(len(image))
    widest = int(4 * limits[2]) + 2
    for k in range(len(image)):
        x[k] = k
    for i in range(len(section)):
        centre, half = int(start[i] + 0.5), max(4, int(3.5 * widths[0][i] + 2.5))
        prior = (widths[0][i], 1.0 / (widths[0][i] * widths[1]) ** 2)
        for _ in range(4):  # the window follows the width and the centre that it finds
            lo, hi = max(low[i], centre - half), min(high[i], centre + half + 1)
            n = _read(image, clipped, (section[i], lo, hi), limits[0], y, use)
            out[i, CLIPPED], out[i, DOF], out[i, CONVERGED] = hi - lo - n, n - 4, 0.0
            if n < FEWEST_PIXELS + (hi - lo) // 3 and half < widest:  # mostly clipped: its flanks lie further out
                half = min(2 * half, widest)
                continue
            if n < FEWEST_PIXELS:
                break
            if hi - lo - n >= PLATEAU_PIXELS and between_flanks(y, hi - lo, limits[0], noise, out[i]):
                out[i, CENTRE] += lo
                out[i, LOW], out[i, HIGH], out[i, DOF] = lo, hi, 0.0
                break
            _guess(y, hi - lo, start[i] - lo, widths[0][i], p)
            out[i, CONVERGED] = climb(x, y, use, hi - lo, p, bell, limits, noise, prior, work)
            wanted = max(4, int(3.5 * p[2] + 2.5))
            if abs(wanted - half) <= 1 + half // 4 and abs(int(lo + p[0] + 0.5) - centre) <= 2:
                break
            half, centre = min(wanted, widest), min(max(int(lo + p[0] + 0.5), low[i]), high[i] - 1)
        if out[i, CONVERGED] > 0 and out[i, DOF] > 0:
            out[i, LOW], out[i, HIGH] = lo, hi
            _report(p, lo, work, out[i])
    return out


@kernel
def _read(
    image: NDArray[np.generic],
    clipped: NDArray[np.bool_],
    section: tuple[int, int, int],
    saturation: float,
    y: Array,
    use: NDArray[np.bool_],
) -> int:
    """Copy the section (column, low, high) and mark its usable pixels; returns their number."""
    column, low, high = section
    n = 0
    for k in range(high - low):
        value = float(image[low + k, column])
        y[k] = value
        use[k] = value < saturation and (clipped.size == 0 or not clipped[low + k, column])
        n += use[k]
    return n


@kernel
def _guess(y: Array, n: int, start: float, width: float, p: Array) -> None:
    """Start values (centre, amplitude, σ, background) from the window's ends and its highest three pixels."""
    background = 0.25 * (y[0] + y[1] + y[n - 1] + y[n - 2])
    best, peak = -np.inf, 1
    for k in range(max(1, int(start) - 3), min(n - 1, int(start) + 5)):
        three = y[k - 1] + y[k] + y[k + 1]
        if three > best:
            best, peak = three, k
    amplitude = max(best / 3 - background, 0.5)
    shift = 0.25 * width * width * (y[peak + 1] - y[peak - 1]) / amplitude  # half of what a noiseless peak asks for
    p[0], p[1], p[2], p[3] = peak + min(max(shift, -0.5), 0.5), amplitude, width, background


@kernel
def _report(p: Array, low: int, work: Array, row: Array) -> None:
    """Write one section's answer."""
    row[CENTRE], row[AMPLITUDE], row[WIDTH], row[BACKGROUND] = low + p[0], p[1], p[2], p[3]
    row[VARIANCE], row[CHI2] = centre_variance(work), work[14]
    row[SNR] = p[1] * math.sqrt(work[4])
