"""The ground under a stripe where it slopes: a lamp's light, learnt from neighbouring sections together.

A section's Gaussian stands on a level ground: a slope to be fitted with it would cost a tenth of what the section says.
Where the ground slopes, its centre is off by 2.8 σ² slope / amplitude, and its neighbours' alike, so that no scatter
tells. What slopes is seen beside the stripe; how, by the sections about each together, for which a few numbers more
cost nothing.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from extraction.linalg import cholesky, solve
from extraction.order import median_of, positions_of
from extraction.stripe.sections.climb import exponential
from extraction.stripe.sections.model import SINGULAR, Array, Mask, Records
from extraction.stripe.view import IntArray, Pixels
from geometry.compiled import kernel

# beside a stripe, from so many σ on, so many pixels are looked at for a slope
_BESIDE, _BESIDE_PX = 3.0, 4
_GROUP = 8  # sections of the sample whose slopes are compared with their own scatter
# their mean squared t over what chance makes of it, with 7 degrees of freedom, and its spread
_CHANCE, _SPREAD, _SIGNIFICANT = 1.4, 2.8, 4.0
_FEWEST = 2  # groups that say anything
# of the window about a section, whose ground is a polynomial of the third degree: where a lamp's light fades over some
# widths of the stripe, a straight line leaves half of the error
_REACH_WIDTHS, _REACH_PX = 4.5, 4.0
_BLOCK, _ABOUT = 8, 3  # sections of one ground; blocks on either side, that it is learnt with
_STEP_PX, _GAP = 5.0, 3  # per section, and sections without a point, beyond which there is another ground
_KNOWN = 0.05  # of a stripe's height, to which its pulse is a Gaussian: its pixels weigh accordingly
_WIDE = 1.6  # of a stripe's median σ, from which a fit has taken the lamp's light for the stripe's
_TERMS = 7  # the pulse's shift, height and width, and a polynomial of the third degree


Indices = NDArray[np.int64]


class Ground(NamedTuple):
    """What is taken off the grey levels of each section (N,), or (0,) of nothing.

    At distance x from ``origin``, at most ``reach`` [px]: slope x + bend x² + twist x³ [DN].
    """

    origin: Array
    reach: Array
    slope: Array
    bend: Array
    twist: Array

    def take(self, chosen: NDArray[np.intp]) -> Ground:
        """That of some sections."""
        return Ground(*(column[chosen] for column in self)) if len(self.origin) else self

    def about(self, origin: Array) -> Ground:
        """The same about other places (N,)."""
        return self._replace(origin=origin) if len(self.origin) else self

    def joined(self, other: Ground) -> Ground:
        """That of these sections and of others."""
        return Ground(*(np.concatenate(columns) for columns in zip(self, other, strict=True)))


def level_ground() -> Ground:
    """A ground of nothing."""
    return Ground(*(np.zeros(0) for _ in Ground._fields))


@kernel
def ground_at(ground: Ground, i: int, place: float) -> float:
    """The ground's grey level at a place of section i, over that at its origin [DN]."""
    origin, reach, slope, bend, twist = ground
    x = min(max(place - origin[i], -reach[i]), reach[i])
    return float(x * (slope[i] + x * (bend[i] + x * twist[i])))


@kernel
def ground_slopes(pixels: Pixels, section: IntArray, stripe: IntArray, fits: Records, clip: float) -> bool:
    """Whether the ground beside the stripes slopes: what lies on one side of them and not on the other.

    fits: of a sample of sections (M,), in order. Each group's mean is held against its own scatter, whatever makes it.
    """
    grey, left_out = pixels
    rows, groups, total = len(grey), 0, 0.0
    sums, last = np.zeros(3), -1
    for i in range(len(section)):
        if stripe[i] != last or sums[0] == _GROUP:
            sums[:], last = 0.0, stripe[i]
        row, both = fits[i], True
        inner = _BESIDE * row.width
        difference = 0.0
        for side in (-1, 1):
            for k in range(_BESIDE_PX):
                r = math.floor(row.centre + 0.5 + side * (inner + k + 0.5))
                both = both and 0 <= r < rows
                if both:
                    value = float(grey[r, section[i]])
                    both = value < clip and (left_out.size == 0 or not left_out[r, section[i]])
                    difference += side * value
        if not both:
            continue
        sums[0], sums[1], sums[2] = sums[0] + 1, sums[1] + difference, sums[2] + difference * difference
        if sums[0] == _GROUP:
            scatter = (sums[2] - sums[1] * sums[1] / _GROUP) / (_GROUP - 1) + 1e-9
            total += sums[1] * sums[1] / _GROUP / scatter
            groups += 1
    return groups >= _FEWEST and total > groups * _CHANCE + _SIGNIFICANT * _SPREAD * math.sqrt(groups)


@kernel
def learn_ground(
    pixels: Pixels, section: IntArray, stripe: IntArray, rows: tuple[IntArray, IntArray], fits: Records, good: Mask,
    clip: float, ground: Ground,
) -> None:  # fmt: skip
    """Fill the ground (N,) of all sections from the good ones' fits, stripe by stripe and piece by piece.

    rows: low and high of each. ground: of nothing before, each origin about where the stripe is. A section without a
    good fit takes what the last one before it has, or the first one after.
    """
    stripes = 0
    for k in stripe:
        stripes = max(stripes, k + 1)
    every, own, widths = np.empty(len(section), np.int64), np.empty(len(section), np.int64), np.empty(len(section))
    for k in range(stripes):
        total, n = positions_of(stripe, k, every), 0
        for i in every[:total]:
            if good[i]:
                widths[n] = fits[i].width
                n += 1
        usual, n = median_of(widths, 0, n), 0
        for i in every[:total]:
            if good[i] and fits[i].width <= _WIDE * usual:
                own[n] = i
                n += 1
        start = 0
        while start < n:
            stop = start + 1
            while stop < n and _together(section, fits, own[stop - 1], own[stop]):
                stop += 1
            _learn_piece(pixels, section, rows, fits, own[start:stop], clip, ground)
            start = stop
        at = 0
        for i in every[: total if n else 0]:
            while at + 1 < n and own[at + 1] <= i:
                at += 1
            if own[at] != i:
                _, reach, slope, bend, twist = ground
                reach[i], slope[i] = reach[own[at]], slope[own[at]]
                bend[i], twist[i] = bend[own[at]], twist[own[at]]


@kernel
def _together(section: IntArray, fits: Records, a: int, b: int) -> bool:
    gap = section[b] - section[a]
    return bool(gap <= _GAP and abs(fits[b].centre - fits[a].centre) <= _STEP_PX * gap)


@kernel
def _learn_piece(
    pixels: Pixels, section: IntArray, rows: tuple[IntArray, IntArray], fits: Records, own: Indices, clip: float,
    ground: Ground,
) -> None:  # fmt: skip
    """The ground of one piece, sections ``own`` (n,): from blocks of them with those about each, then straight lines
    from block to block.
    """
    n, width = len(own), 0.0
    blocks = (n + _BLOCK - 1) // _BLOCK
    for i in own:
        width += fits[i].width / n
    reach = _REACH_WIDTHS * width + _REACH_PX
    squares, rights = np.zeros((blocks, _TERMS, _TERMS)), np.zeros((blocks, _TERMS))
    for j in range(n):
        i, k = own[j], j // _BLOCK
        low, high = math.ceil(fits[i].centre - reach), int(fits[i].centre + reach) + 1
        low, high = max(rows[0][i], low), min(rows[1][i], high)
        _add_section(pixels, section[i], low, high, fits[i], reach, clip, squares[k], rights[k])
    found = np.zeros((blocks, 3))
    square, factor = np.zeros((_TERMS, _TERMS)), np.zeros((_TERMS, _TERMS))
    right, answer = np.zeros(_TERMS), np.zeros(_TERMS)
    for k in range(blocks):
        square[:], right[:] = 0.0, 0.0
        for m in range(max(k - _ABOUT, 0), min(k + _ABOUT + 1, blocks)):
            for p in range(_TERMS):
                right[p] += rights[m, p]
                for q in range(p + 1):
                    square[p, q] += squares[m, p, q]
        if cholesky(square, 0.0, SINGULAR, _TERMS, factor):
            solve(factor, right, _TERMS, answer)
            for p in range(3):
                found[k, p] = answer[_TERMS - 3 + p] / reach ** (p + 1)
    origin, reaches, slope, bend, twist = ground
    for j in range(n):
        i, at = own[j], min(max((j + 0.5) / _BLOCK - 0.5, 0.0), blocks - 1.0)
        k = min(int(at), max(blocks - 2, 0))
        t, nxt = at - k, min(k + 1, blocks - 1)
        origin[i], reaches[i] = fits[i].centre, reach
        slope[i] = (1 - t) * found[k, 0] + t * found[nxt, 0]
        bend[i] = (1 - t) * found[k, 1] + t * found[nxt, 1]
        twist[i] = (1 - t) * found[k, 2] + t * found[nxt, 2]


@kernel
def _add_section(
    pixels: Pixels, section: int, low: int, high: int, row: Any, reach: float, clip: float, square: Array, right: Array
) -> None:
    """What the fit of a section leaves in its rows low … high - 1, to the sums of its block."""
    grey, left_out = pixels
    term = np.zeros(_TERMS)
    floor = _KNOWN * row.amplitude
    for r in range(low, high):
        value = float(grey[r, section])
        if not value < clip or (left_out.size > 0 and left_out[r, section]):
            continue
        x, t = (r - row.centre) / reach, (r - row.centre) / row.width
        bell = exponential(-0.5 * t * t)
        term[0], term[1], term[2] = t * bell, bell, t * t * bell
        term[3], term[4], term[5], term[6] = 1.0, x, x * x, x * x * x
        weight, left = 1.0 / (1.0 + (floor * bell) ** 2), value - row.amplitude * bell - row.background
        for p in range(_TERMS):
            right[p] += weight * term[p] * left
            for q in range(p + 1):
                square[p, q] += weight * term[p] * term[q]
