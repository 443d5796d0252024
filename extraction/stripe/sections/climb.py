"""Gaussians on a background fitted by Fisher scoring, many side by side: one instruction works on several of them.

A lane holds the pixels and the state of one fit. All lanes take a step together, in loops over lanes that the compiler
makes into vector instructions; each lane's sums are in an order of their own, so that the width of a processor's
vectors changes no bit. Where one fit ends, its lane is given to the next.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from extraction.linalg import Symmetric4, Vector4, factor4, solve4
from extraction.noise import PixelNoise
from extraction.stripe.sections.model import SINGULAR, FitLimits, Peak
from geometry.compiled import kernel

Array = NDArray[np.float64]

LANES = 32
STEPS = 30  # most of a fit; a stripe's section takes three or four
LAST_STEP = (
    1e-3  # square of the last step over its own σ: what is left after it is far smaller, steps halve their digits
)
SHRINK, GROW = 0.6, 1.6  # of the width in one step: beyond, the quadratic form does not hold
LEAST_AMPLITUDE = 0.3  # of the amplitude after a step
_FARTHEST = 700.0  # of an exponent

# numbers of a lane, each of LANES in a row: the peak; its bounds; the expected width and that expectation's weight; of
# the pixel that is taken: its place less the centre, the bell there, the factor to the next pixel's and that factor's;
# the bell and the factor at the pixel as far below the middle; F, the score and χ²
_CENTRE, _AMPLITUDE, _WIDTH, _BACKGROUND, _LOW, _HIGH, _EXPECTED, _WEIGHT = range(8)
_X, _BELL, _RATIO, _CURVE, _INVERSE, _BELL_BELOW, _RATIO_BELOW = range(8, 15)
_FISHER, _SCORE, _CHI2 = 15, 25, 29
_ROWS = 30

GOING, SETTLED, FAILED = 0, 1, 2


class Lanes(NamedTuple):
    """Fits side by side: numbers (30 · LANES,), pixels and their weights 0 or 1 (2 M + 1, LANES) with the middle of
    each window at row M, places of the pixels (like them, or (0, LANES) where they are -M … M), state and steps taken
    (LANES,).
    """

    numbers: Array
    y: Array
    use: Array
    x: Array
    state: NDArray[np.int64]
    steps: NDArray[np.int64]


@kernel
def lanes(reach: int, anywhere: bool) -> Lanes:
    """Room for windows of 2 reach + 1 pixels. anywhere: whether they have places of their own."""
    rows = 2 * reach + 1
    return Lanes(
        np.zeros(_ROWS * LANES),
        np.zeros((rows, LANES)),
        np.zeros((rows, LANES)),
        np.zeros((rows if anywhere else 0, LANES)),
        np.zeros(LANES, np.int64),
        np.zeros(LANES, np.int64),
    )


@kernel
def begin(lane: Lanes, k: int, start: Peak, low: float, high: float, expected: float, weight: float) -> None:
    """Start lane k there. low, high: of the centre. expected: width, weight: 1/variance of that expectation."""
    numbers = lane.numbers
    numbers[_CENTRE * LANES + k], numbers[_AMPLITUDE * LANES + k] = start.centre, start.amplitude
    numbers[_WIDTH * LANES + k], numbers[_BACKGROUND * LANES + k] = start.width, start.background
    numbers[_LOW * LANES + k], numbers[_HIGH * LANES + k] = low, high
    numbers[_EXPECTED * LANES + k], numbers[_WEIGHT * LANES + k] = expected, weight
    lane.state[k], lane.steps[k] = GOING, 0


@kernel
def peak_at(lane: Lanes, k: int) -> Peak:
    """The peak of lane k."""
    numbers = lane.numbers
    return Peak(
        numbers[_CENTRE * LANES + k],
        numbers[_AMPLITUDE * LANES + k],
        numbers[_WIDTH * LANES + k],
        numbers[_BACKGROUND * LANES + k],
    )


@kernel
def expected_at(lane: Lanes, k: int) -> float:
    """The width that is expected in lane k."""
    return float(lane.numbers[_EXPECTED * LANES + k])


@kernel
def fisher_at(lane: Lanes, k: int) -> Symmetric4:
    """Its Fisher information before the last step."""
    f, at = lane.numbers, _FISHER * LANES + k
    return Symmetric4(
        f[at], f[at + LANES], f[at + 2 * LANES], f[at + 3 * LANES], f[at + 4 * LANES], f[at + 5 * LANES],
        f[at + 6 * LANES], f[at + 7 * LANES], f[at + 8 * LANES], f[at + 9 * LANES],
    )  # fmt: skip


@kernel
def chi2_at(lane: Lanes, k: int) -> float:
    """Its χ² before the last step."""
    return float(lane.numbers[_CHI2 * LANES + k])


@kernel
def move(lane: Lanes, source: int, target: int) -> None:
    """Lane ``source`` becomes lane ``target``."""
    numbers, y, use, x, state, steps = lane
    for row in range(_ROWS):
        numbers[row * LANES + target] = numbers[row * LANES + source]
    for row in range(len(y)):
        y[row, target], use[row, target] = y[row, source], use[row, source]
    for row in range(len(x)):
        x[row, target] = x[row, source]
    state[target], steps[target] = state[source], steps[source]


@kernel
def step(lane: Lanes, n: int, reach: int, limits: FitLimits, noise: PixelNoise) -> None:
    """One step of the first n lanes over the pixels within ``reach`` of their middles.

    The weights are those of the fitted mean, not of the data (quasi-likelihood): efficient and without their bias.
    """
    numbers, y, use, x, state, steps = lane
    middle = len(y) // 2
    numbers[_FISHER * LANES :] = 0.0
    if len(x):
        for row in range(middle - reach, middle + reach + 1):
            _bell_anywhere(numbers, x[row], n)
            _add(numbers, y[row], use[row], n, noise)
    else:
        _bell_in_the_middle(numbers, n)
        _add(numbers, y[middle], use[middle], n, noise)
        _bells_beside_the_middle(numbers, n)
        for away in range(1, reach + 1):
            up, down = middle + away, middle - away
            _add_two(numbers, y[up], use[up], y[down], use[down], 2.0 * away, n, noise)
    _climb(numbers, state, n, 0.5 * limits.min_width, 2.0 * limits.max_width)  # room beyond what is accepted
    for k in range(n):
        steps[k] += 1
        if state[k] == GOING and steps[k] >= STEPS:
            state[k] = FAILED


@kernel(fastmath=True)
def exponential(x: float) -> float:
    """E to the x, to 10⁻¹³, by multiplications alone: as many lanes at once, and the same on every processor."""
    z = min(max(x, -_FARTHEST), _FARTHEST) * (1.0 / 1024.0)
    e = 1.0 + z * (1.0 + z * (1 / 2 + z * (1 / 6 + z * (1 / 24 + z * (1 / 120 + z * (1 / 720 + z * (1 / 5040)))))))
    e = e * e
    e = e * e
    e = e * e
    e = e * e
    e = e * e
    e = e * e
    e = e * e
    e = e * e
    e = e * e
    return e * e


@kernel(fastmath=True)
def _bell_in_the_middle(numbers: Array, n: int) -> None:
    """The bell at the windows' middles and the factors of its recurrence, to either side."""
    for k in range(n):
        inverse, x = 1.0 / numbers[_WIDTH * LANES + k], -numbers[_CENTRE * LANES + k]
        curvature = inverse * inverse
        numbers[_INVERSE * LANES + k], numbers[_X * LANES + k] = inverse, x
        numbers[_BELL * LANES + k] = exponential(-0.5 * curvature * x * x)
        numbers[_CURVE * LANES + k] = exponential(-curvature)
        numbers[_RATIO * LANES + k] = exponential(-curvature * (x + 0.5))
        numbers[_RATIO_BELOW * LANES + k] = exponential(curvature * (x - 0.5))


@kernel(fastmath=True)
def _bells_beside_the_middle(numbers: Array, n: int) -> None:
    """The same one pixel above the middle and one below."""
    for k in range(n):
        bell, curve = numbers[_BELL * LANES + k], numbers[_CURVE * LANES + k]
        ratio, below = numbers[_RATIO * LANES + k], numbers[_RATIO_BELOW * LANES + k]
        numbers[_X * LANES + k] += 1.0
        numbers[_BELL * LANES + k], numbers[_BELL_BELOW * LANES + k] = bell * ratio, bell * below
        numbers[_RATIO * LANES + k], numbers[_RATIO_BELOW * LANES + k] = ratio * curve, below * curve


@kernel(fastmath=True)
def _bell_anywhere(numbers: Array, place: Array, n: int) -> None:
    """The bell at pixels with places of their own."""
    for k in range(n):
        inverse, x = 1.0 / numbers[_WIDTH * LANES + k], place[k] - numbers[_CENTRE * LANES + k]
        numbers[_INVERSE * LANES + k], numbers[_X * LANES + k] = inverse, x
        numbers[_BELL * LANES + k] = exponential(-0.5 * (x * inverse) * (x * inverse))


@kernel(fastmath=True)
def _add(numbers: Array, y: Array, use: Array, n: int, noise: PixelNoise) -> None:
    """A pixel of every lane to F = Σ w ∂μ ∂μᵀ, score Σ w r ∂μ and χ² = Σ w r², w = 1 / variance at the fitted mean.

    By centre, amplitude, σ and background.
    """
    floor, gain, dark, speckle2 = noise.floor + noise.model2, noise.gain, noise.dark, noise.speckle2
    for k in range(n):
        bell, inverse, x = numbers[_BELL * LANES + k], numbers[_INVERSE * LANES + k], numbers[_X * LANES + k]
        t = x * inverse
        signal = numbers[_AMPLITUDE * LANES + k] * bell
        mean = signal + numbers[_BACKGROUND * LANES + k]
        w = use[k] / (floor + gain * max(mean - dark, 0.0) + speckle2 * signal * signal)
        j0 = signal * t * inverse
        j2, r = j0 * t, y[k] - mean
        w0, w1, w2, wr = w * j0, w * bell, w * j2, w * r
        numbers[(_FISHER + 0) * LANES + k] += w0 * j0
        numbers[(_FISHER + 1) * LANES + k] += w0 * bell
        numbers[(_FISHER + 2) * LANES + k] += w0 * j2
        numbers[(_FISHER + 3) * LANES + k] += w0
        numbers[(_FISHER + 4) * LANES + k] += w1 * bell
        numbers[(_FISHER + 5) * LANES + k] += w1 * j2
        numbers[(_FISHER + 6) * LANES + k] += w1
        numbers[(_FISHER + 7) * LANES + k] += w2 * j2
        numbers[(_FISHER + 8) * LANES + k] += w2
        numbers[(_FISHER + 9) * LANES + k] += w
        numbers[(_SCORE + 0) * LANES + k] += wr * j0
        numbers[(_SCORE + 1) * LANES + k] += wr * bell
        numbers[(_SCORE + 2) * LANES + k] += wr * j2
        numbers[(_SCORE + 3) * LANES + k] += wr
        numbers[_CHI2 * LANES + k] += wr * r


@kernel(fastmath=True)
def _add_two(
    numbers: Array, y: Array, use: Array, y_below: Array, use_below: Array, apart: float, n: int, noise: PixelNoise
) -> None:
    """The same of two pixels, as far above the windows' middles as below, ``apart``; then the bells go on to the next.

    The sums lie in memory: two at a time halve what is read and written.
    """
    floor, gain, dark, speckle2 = noise.floor + noise.model2, noise.gain, noise.dark, noise.speckle2
    for k in range(n):
        inverse, x, curve = numbers[_INVERSE * LANES + k], numbers[_X * LANES + k], numbers[_CURVE * LANES + k]
        amplitude, background = numbers[_AMPLITUDE * LANES + k], numbers[_BACKGROUND * LANES + k]
        bell, below = numbers[_BELL * LANES + k], numbers[_BELL_BELOW * LANES + k]
        ratio, ratio_below = numbers[_RATIO * LANES + k], numbers[_RATIO_BELOW * LANES + k]
        t, s = x * inverse, (x - apart) * inverse
        signal, other = amplitude * bell, amplitude * below
        mean, mean_below = signal + background, other + background
        w = use[k] / (floor + gain * max(mean - dark, 0.0) + speckle2 * signal * signal)
        v = use_below[k] / (floor + gain * max(mean_below - dark, 0.0) + speckle2 * other * other)
        j0, i0 = signal * t * inverse, other * s * inverse
        j2, i2, r, q = j0 * t, i0 * s, y[k] - mean, y_below[k] - mean_below
        w0, w1, w2, wr = w * j0, w * bell, w * j2, w * r
        v0, v1, v2, vq = v * i0, v * below, v * i2, v * q
        numbers[(_FISHER + 0) * LANES + k] += w0 * j0 + v0 * i0
        numbers[(_FISHER + 1) * LANES + k] += w0 * bell + v0 * below
        numbers[(_FISHER + 2) * LANES + k] += w0 * j2 + v0 * i2
        numbers[(_FISHER + 3) * LANES + k] += w0 + v0
        numbers[(_FISHER + 4) * LANES + k] += w1 * bell + v1 * below
        numbers[(_FISHER + 5) * LANES + k] += w1 * j2 + v1 * i2
        numbers[(_FISHER + 6) * LANES + k] += w1 + v1
        numbers[(_FISHER + 7) * LANES + k] += w2 * j2 + v2 * i2
        numbers[(_FISHER + 8) * LANES + k] += w2 + v2
        numbers[(_FISHER + 9) * LANES + k] += w + v
        numbers[(_SCORE + 0) * LANES + k] += wr * j0 + vq * i0
        numbers[(_SCORE + 1) * LANES + k] += wr * bell + vq * below
        numbers[(_SCORE + 2) * LANES + k] += wr * j2 + vq * i2
        numbers[(_SCORE + 3) * LANES + k] += wr + vq
        numbers[_CHI2 * LANES + k] += wr * r + vq * q
        numbers[_X * LANES + k] = x + 1.0
        numbers[_BELL * LANES + k], numbers[_BELL_BELOW * LANES + k] = bell * ratio, below * ratio_below
        numbers[_RATIO * LANES + k], numbers[_RATIO_BELOW * LANES + k] = ratio * curve, ratio_below * curve


@kernel
def _climb(numbers: Array, state: NDArray[np.int64], n: int, least_width: float, most_width: float) -> None:
    """The step of every lane, with its expected width, and whether it was the last."""
    for k in range(n):
        width, weight = numbers[_WIDTH * LANES + k], numbers[_WEIGHT * LANES + k]
        numbers[(_FISHER + 7) * LANES + k] += weight
        f = Symmetric4(
            numbers[(_FISHER + 0) * LANES + k],
            numbers[(_FISHER + 1) * LANES + k],
            numbers[(_FISHER + 2) * LANES + k],
            numbers[(_FISHER + 3) * LANES + k],
            numbers[(_FISHER + 4) * LANES + k],
            numbers[(_FISHER + 5) * LANES + k],
            numbers[(_FISHER + 6) * LANES + k],
            numbers[(_FISHER + 7) * LANES + k],
            numbers[(_FISHER + 8) * LANES + k],
            numbers[(_FISHER + 9) * LANES + k],
        )
        g0, g1, g3 = (
            numbers[(_SCORE + 0) * LANES + k],
            numbers[(_SCORE + 1) * LANES + k],
            numbers[(_SCORE + 3) * LANES + k],
        )
        g2 = numbers[(_SCORE + 2) * LANES + k] + weight * (numbers[_EXPECTED * LANES + k] - width)
        definite, factor = factor4(f, SINGULAR)
        s = solve4(factor, Vector4(g0, g1, g2, g3))
        centre, amplitude = numbers[_CENTRE * LANES + k], numbers[_AMPLITUDE * LANES + k]
        moved = centre + min(max(s.a0, -width), width)
        wider = min(max(width + s.a2, SHRINK * width), GROW * width)
        inside = numbers[_LOW * LANES + k] <= moved <= numbers[_HIGH * LANES + k]
        if not definite:
            state[k] = FAILED
            continue
        numbers[_CENTRE * LANES + k] = moved
        numbers[_AMPLITUDE * LANES + k] = max(amplitude + s.a1, LEAST_AMPLITUDE * amplitude)
        numbers[_WIDTH * LANES + k] = min(max(wider, least_width), most_width)
        numbers[_BACKGROUND * LANES + k] += s.a3
        small = g0 * s.a0 + g1 * s.a1 + g2 * s.a2 + g3 * s.a3 < LAST_STEP
        state[k] = FAILED if not inside else (SETTLED if small else GOING)
