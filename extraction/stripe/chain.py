"""Chains of ridge nodes: linked from section to section, scored, held against the tail of all chains of their level."""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from extraction.stripe.ridge import IntArray, Nodes
from geometry.compiled import kernel

Array = NDArray[np.float64]

GATE = 2.6  # level pixels per section that a link may climb: an arc's end at 70° to the sections
_SKIP = 2  # sections that a link may span
_FALLS = 0.22  # of a chain's larger mean fall: both flanks must fall; a step's bright side does not
_LEAST_SIGNIFICANCE = 16.0  # Σ response / σ over √n: what no tail of few chains is trusted to tell from noise
_PART = 0.005  # of the light of a level's brightest chain, below which one is not looked at
_ROUGH = 5.0  # contrast of a ridge, below which its sections are measured together
_TAIL = 0.2  # of a chain's brighter half, below which nodes at its ends are none of it
_NOISE_CONTRAST = 4.0  # mean response over σ of a chain that may be noise; maxima of noise above 1.5 σ have 2.2
_FALSE = 1e-3  # chains of noise that may pass, per image and level


@dataclass(frozen=True, eq=False)
class Chain:
    """A ridge followed from section to section.

    section, place: of its nodes in pixels of the image, at their level's steps (n,). response: of each (n,) [DN].
    scale: rows of the image to a level's row. step: sections to a level's section. significance: Σ response / σ over
    √n, of independent sections. light: mean response [DN]. contrast: its median over σ.
    """

    section: Array
    place: Array
    response: Array
    scale: int
    step: int
    score: float
    light: float
    contrast: float

    @cached_property
    def length(self) -> float:
        """Sections of the image that it spans."""
        return float(self.section[-1] - self.section[0] + self.step)

    @property
    def rough(self) -> bool:
        """Whether its ground is so rough that a section alone says little."""
        return self.step > self.scale or self.contrast < _ROUGH

    @cached_property
    def box(self) -> tuple[float, float, float, float]:
        """First and last section, least and largest place."""
        return float(self.section[0]), float(self.section[-1]), float(self.place.min()), float(self.place.max())

    @cached_property
    def evidence(self) -> float:
        """Its light times its length along its course: a stripe has more of it than what a lamp lights."""
        some = self.place[:: max(1, min(8, len(self.place) - 1))].tolist()
        climb = sum(abs(b - a) for a, b in itertools.pairwise(some))
        return self.light * math.hypot(self.length, climb)

    @cached_property
    def significance(self) -> float:
        """Root of the sum of squared signal to noise ratios: comparable between scales."""
        return float(self.score / np.sqrt(len(self.section)))


def follow(nodes: Nodes, scale: int, step: int) -> list[Chain]:
    """The significant chains of a level, whose pixel is ``scale`` rows × ``step`` sections."""
    n = len(nodes.section)
    if n == 0:
        return []
    ahead, back = np.empty(n, np.int32), np.empty(n, np.int32)
    _links(nodes, ahead, back)
    order, start = np.empty(n, np.int32), np.empty(n, np.int32)
    chains = _walk(ahead, back, order, start)
    start = start[:chains]
    count = np.diff(np.append(start, n)).astype(np.int32)
    ratio = (nodes.response / nodes.noise)[order].astype(np.float64)
    score = np.add.reduceat(ratio, start)
    near, far = (np.add.reduceat(v[order].astype(np.float64), start) for v in (nodes.near, nodes.far))
    faint = score < _NOISE_CONTRAST * 1.5 * count  # maxima of noise fall by themselves, to either side
    light = np.add.reduceat(nodes.response[order].astype(np.float64), start)
    faint = score < _NOISE_CONTRAST * 1.5 * count  # maxima of noise fall by themselves, to either side
    falls = np.minimum(near, far) >= np.where(faint, 2 * _FALLS, _FALLS) * np.maximum(near, far)
    threshold = tail_threshold(score, count)
    significant = (score > threshold) & (score > _LEAST_SIGNIFICANCE * np.sqrt(count)) & falls
    if not significant.any():
        return []
    worth = significant & (light >= _PART * light[significant].max())
    out = []
    for k in np.flatnonzero(worth):
        own = order[start[k] : start[k] + count[k]]
        own = own[_lit(nodes.response[own])]
        ratios = nodes.response[own].astype(np.float64) / nodes.noise[own]
        out.append(
            Chain(
                section=(nodes.section[own].astype(np.float64) + 0.5) * step - 0.5,
                place=(nodes.place[own].astype(np.float64) + 0.5) * scale - 0.5,
                response=nodes.response[own].astype(np.float64),
                scale=scale,
                step=step,
                score=float(ratios.sum()),
                light=float(nodes.response[own].mean()),
                contrast=float(np.partition(ratios, len(ratios) // 2)[len(ratios) // 2]),
            )
        )
    return out


def _lit(response: NDArray[np.float32]) -> slice:
    """The nodes without those at either end that are noise which the ridge was linked to."""
    bright = np.partition(response, len(response) * 3 // 4)[len(response) * 3 // 4]
    lit = np.flatnonzero(response >= _TAIL * bright)
    return slice(int(lit[0]), int(lit[-1]) + 1)


def tail_threshold(score: Array, count: IntArray) -> float:
    """The score that _FALSE chains of noise would pass, their tail being exponential as links end at random.

    Its scale is the median excess over the upper fifth's lower end: the few chains that are stripe do not move it.
    Chains of high contrast are structure, not noise, and have no part in it.
    """
    score = score[score < _NOISE_CONTRAST * count]
    least = 30.0  # chains of clean noise above 1.5 σ: five sections of 6 σ
    if len(score) < 30:
        return least
    k, m = int(0.8 * len(score)), int(0.9 * len(score))
    part = np.partition(score, (k, m))
    low, middle = float(part[k]), float(part[m])
    scale = (middle - low) / np.log(2)
    return max(least, float(low + scale * np.log(0.2 * len(score) / _FALSE)))


@kernel
def _links(nodes: Nodes, ahead: IntArray, back: IntArray) -> None:
    """Each node's best successor and predecessor: near and bright; -1 for none."""
    section, place, response, first = nodes.section, nodes.place, nodes.response, nodes.first
    for i in range(len(section)):
        ahead[i] = _best(section, place, response, first, i, 1)
        back[i] = _best(section, place, response, first, i, -1)


@kernel
def _best(
    section: IntArray, place: NDArray[np.float32], response: NDArray[np.float32], first: IntArray, i: int, step: int
) -> int:
    sections = len(first) - 1
    here = place[i]
    for gap in range(1, _SKIP + 1):
        c = section[i] + step * gap
        if c < 0 or c >= sections:
            return -1
        best, worth = -1, 0.0
        reach = GATE * gap
        low, high = first[c], first[c + 1]
        while low < high:  # the first place within reach: places of a section are in order
            half = (low + high) // 2
            if place[half] < here - reach:
                low = half + 1
            else:
                high = half
        for k in range(low, first[c + 1]):
            off = abs(place[k] - here) / reach
            if place[k] > here + reach:
                break
            if off < 1:
                w = min(response[k], 2 * response[i]) * (1 - off * off)
                if w > worth:
                    best, worth = k, w
        if best >= 0:
            return best
    return -1


@kernel
def _walk(ahead: IntArray, back: IntArray, order: IntArray, start: IntArray) -> int:
    """Nodes chain by chain in ``order``; chains are runs of mutual links; returns their number."""
    n, chains = 0, 0
    for i in range(len(ahead)):
        if back[i] >= 0 and ahead[back[i]] == i:
            continue
        start[chains] = n
        chains += 1
        k = i
        while True:
            order[n] = k
            n += 1
            nxt = ahead[k]
            if nxt < 0 or back[nxt] != k:
                break
            k = nxt
    return chains
