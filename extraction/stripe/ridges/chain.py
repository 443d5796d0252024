"""Chains of ridge nodes: linked from section to section, scored, held against the tail of all chains of their level."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from extraction.order import kth_smallest
from extraction.stripe.ridges.ridge import FLANK, IntArray, Level, RidgeNodes, find_nodes
from geometry.compiled import kernel

Array = NDArray[np.float64]
Indices = NDArray[np.int64]
Records = NDArray[np.void]

GATE = 2.6  # level pixels per section that a link may climb: an arc's end at 70° to the sections
_SKIP = 2  # sections that a link may span
_FALLS = 0.22  # of a chain's larger mean fall: both flanks must fall; a step's bright side does not
_LEAST_SIGNIFICANCE = 16.0  # Σ response / σ over √n: what no tail of few chains is trusted to tell from noise
_PART = 0.005  # of the light of a level's brightest chain, below which one is not looked at
_ROUGH = 5.0  # contrast of a ridge, below which its sections are measured together
_TAIL = 0.2  # of a chain's brighter half, below which nodes at its ends are none of it
_NOISE_CONTRAST = 4.0  # mean response over σ of a chain that may be noise
_OF_NOISE = 2.2  # response over σ of maxima of noise above 1.5 σ: a chain has as much where there is nothing
_FALSE = 1e-3  # chains of noise that may pass, per image and level
_FEWEST = 30  # chains that have a tail
_CLEAN = 30.0  # score that chains of clean noise above 1.5 σ do not pass: five sections of 6 σ
_DIGITS = 1e6  # steps of a number that chains are ordered by: none hangs on the last bits of a sum
_COURSE = 8  # stretches of a chain whose climb makes its length along its course

_SAME = 1.5  # level pixels between two chains on one ridge
_SHARE = 0.5  # of a chain's sections on another's ridge, from which it is the same
_LEAST_PART = 0.004  # of the most light of a ridge, below which one is not looked at
MOST_CHAINS = 48  # looked at, most light first; a lamp-lit board has a hundred

# a chain: sum of its responses over their noise; mean response [DN]; its median over the noise; light times its length
# along its course: a stripe has more of it than what a lamp lights; root of the sum of squared signal to noise ratios,
# comparable between scales; first and last section, least and largest place [px]; sections to a level's section; of
# its nodes, start … stop - 1; rows of the image to a level's row
CHAIN = np.dtype(
    [
        *((name, np.float64) for name in ("score", "light", "contrast", "evidence", "significance")),
        *((name, np.float64) for name in ("first", "last", "lowest", "highest")),
        *((name, np.int64) for name in ("start", "stop", "scale", "step")),
    ],
    align=True,
)
_WHOLE = np.dtype((np.void, CHAIN.itemsize))


class Ridges(NamedTuple):
    """Chains (C,) of CHAIN, and their nodes (N,): section and place in pixels of the image, response [DN]."""

    chains: Records
    section: Array
    place: Array
    response: Array


@dataclass(frozen=True, eq=False)
class Chain:
    """A ridge followed from section to section.

    section, place: of its nodes in pixels of the image, at their level's steps (n,). response: of each (n,) [DN].
    scale: rows of the image to a level's row. step: sections to a level's section. significance: Σ response / σ over
    √n, of independent sections. light: mean response [DN]. contrast: its median over σ. evidence: light times its
    length along its course. length: sections of the image that it spans.
    """

    section: Array
    place: Array
    response: Array
    scale: int
    step: int
    significance: float
    light: float
    contrast: float
    evidence: float

    @property
    def length(self) -> float:
        """Sections of the image that it spans."""
        return float(self.section[-1] - self.section[0] + self.step)

    @property
    def narrow(self) -> bool:
        """Whether it was found at narrow rows, where only pictures are searched that show no clear ridge."""
        return self.step > self.scale

    @property
    def rough(self) -> bool:
        """Whether its ground is so rough that a section alone says little."""
        return self.narrow or self.contrast < _ROUGH


def together(parts: list[Ridges]) -> Ridges:
    """The chains of several searches."""
    some = [p for p in parts if len(p.chains)] or parts[:1]
    if len(some) == 1:
        return some[0]
    nodes = [np.concatenate(column) for column in zip(*(p[1:] for p in some), strict=True)]
    # as bytes: numpy joins records field by field, which takes as long as a level's search of a small image
    chains = np.concatenate([p.chains.view(_WHOLE) for p in some]).view(CHAIN)
    counts, lengths = [len(p.chains) for p in some], [len(p.section) for p in some]
    shift = np.repeat(np.cumsum([0, *lengths[:-1]]), counts)
    chains["start"] += shift
    chains["stop"] += shift
    return Ridges(chains, *nodes)


def each_once(ridges: Ridges) -> list[Chain]:
    """Chains without those that lie on the ridge of a better one, most light first.

    The better of two on one ridge has more light times significance, without the light that noise would have there: a
    plateau's middle beats its edges, and of two scales the one of better signal to noise gives place and ends.
    """
    if len(ridges.chains) == 0:
        return []
    out = []
    for _, light, contrast, evidence, significance, *_, start, stop, scale, step in ridges.chains[
        _kept(ridges)
    ].tolist():
        section, place, response = ridges.section[start:stop], ridges.place[start:stop], ridges.response[start:stop]
        out.append(Chain(section, place, response, scale, step, significance, light, contrast, evidence))
    return out


@kernel
def ridges_of(level: Level, scale: int, step: int, threshold: float, empty: Records) -> Ridges:
    """The significant chains of nodes above ``threshold`` σ of a level, whose pixel is ``scale`` rows × ``step``
    sections. empty: (0,) of CHAIN.
    """
    return follow(find_nodes(level, math.sqrt(scale * step), threshold), scale, step, empty)


@kernel
def follow(nodes: RidgeNodes, scale: int, step: int, empty: Records) -> Ridges:
    """The significant chains of a level, whose pixel is ``scale`` rows × ``step`` sections. empty: (0,) of CHAIN."""
    response, near_by, far_by, noise = nodes.response, nodes.near, nodes.far, nodes.noise  # each costs a count of
    n = len(response)  # references where it is taken out
    ahead, back = np.empty(n, np.int32), np.empty(n, np.int32)
    _links(nodes, ahead, back)
    order, start = np.empty(n, np.int32), np.empty(n + 1, np.int32)
    number = _walk(ahead, back, order, start)
    start[number] = n
    score, light, falls = np.empty(number), np.empty(number), np.empty(number, np.bool_)
    for k in range(number):
        total, lit, near, far = 0.0, 0.0, 0.0, 0.0
        for i in range(start[k], start[k + 1]):
            j = order[i]
            total, lit = total + response[j] / noise[j], lit + response[j]
            near, far = near + near_by[j], far + far_by[j]
        score[k], light[k] = total, lit
        faint = total < _NOISE_CONTRAST * 1.5 * (start[k + 1] - start[k])  # noise falls by itself, to either side
        falls[k] = min(near, far) >= (2 * _FALLS if faint else _FALLS) * max(near, far)
    threshold = tail_threshold(score, start)
    brightest, kept, long = 0.0, 0, 0
    for k in range(number):
        count = start[k + 1] - start[k]
        falls[k] = falls[k] and score[k] > threshold and score[k] > _LEAST_SIGNIFICANCE * math.sqrt(count)
        if falls[k]:
            brightest = max(brightest, light[k])
            kept, long = kept + 3, long + count
    out = Ridges(np.empty(kept, empty.dtype), np.empty(long), np.empty(long), np.empty(long))
    ratio, some = np.empty(long), np.empty(long)
    kept, at = 0, 0
    for k in range(number):
        if falls[k] and light[k] >= _PART * brightest:
            own = order[start[k] : start[k + 1]]
            a, b = _bright(nodes, own, some)
            ends = (0, a, b, len(own))
            for part in range(3):  # a dark tail, what is bright, and another
                some_nodes = own[ends[part] : ends[part + 1]]
                if part == 1 or _stands_out(nodes, some_nodes, threshold):
                    n = _write(nodes, some_nodes, scale, step, out, at, ratio, out.chains[kept])
                    kept, at = kept + 1, at + n
    return Ridges(out.chains[:kept], out.section[:at], out.place[:at], out.response[:at])


@kernel
def _bright(nodes: RidgeNodes, own: IntArray, some: Array) -> tuple[int, int]:
    """The first of a chain's nodes, and the one after the last, that are no dark tail of it."""
    response, n = nodes.response, len(own)
    for i in range(n):
        some[i] = response[own[i]]
    bright = kth_smallest(some[:n], n * 3 // 4)
    a, b = 0, n
    while response[own[a]] < _TAIL * bright:
        a += 1
    while response[own[b - 1]] < _TAIL * bright:
        b -= 1
    return a, b


@kernel
def _stands_out(nodes: RidgeNodes, own: IntArray, threshold: float) -> bool:
    """Whether a chain's dark tail is a ridge by itself: a stripe goes on over a dark surface."""
    total, near, far = 0.0, 0.0, 0.0
    for j in own:
        total += nodes.response[j] / nodes.noise[j]
        near, far = near + nodes.near[j], far + nodes.far[j]
    clear = total > threshold and total > max(_LEAST_SIGNIFICANCE * math.sqrt(len(own)), _NOISE_CONTRAST * len(own))
    return clear and min(near, far) >= _FALLS * max(near, far)


@kernel
def _write(
    nodes: RidgeNodes, own: IntArray, scale: int, step: int, out: Ridges, at: int, ratio: Array, row: Any
) -> int:
    """A chain of those nodes to its record and to the nodes from ``at`` on; returns how many those are."""
    section, place, response, _, _, noise, _ = nodes
    _, sections, places, responses = out
    n, score, light, lowest, highest = len(own), 0.0, 0.0, np.inf, -np.inf
    for i in range(n):
        j = own[i]
        ratio[i] = response[j] / noise[j]
        score, light = score + ratio[i], light + response[j]
        along = (place[j] + 0.5) * scale - 0.5
        sections[at + i], places[at + i], responses[at + i] = (section[j] + 0.5) * step - 0.5, along, response[j]
        lowest, highest = min(lowest, along), max(highest, along)
    row.start, row.stop, row.scale, row.step = at, at + n, scale, step
    row.score, row.light, row.significance = score, light / n, score / math.sqrt(n)
    row.contrast = kth_smallest(ratio[:n], n // 2)
    row.first, row.last, row.lowest, row.highest = sections[at], sections[at + n - 1], lowest, highest
    climb, length, every = 0.0, row.last - row.first + step, max(1, min(_COURSE, n - 1))
    for i in range(every, n, every):
        climb += abs(places[at + i] - places[at + i - every])
    row.evidence = row.light * math.sqrt(length * length + climb * climb)
    return n


@kernel
def tail_threshold(score: Array, start: IntArray) -> float:
    """The score that _FALSE chains of noise would pass, their tail being exponential as links end at random.

    score (C,) of the chains of nodes start[k] … start[k + 1] - 1. The tail's scale is the median excess over the upper
    fifth's lower end: the few chains that are stripe do not move it. Chains of high contrast are structure, not noise,
    and have no part in it.
    """
    own, n = np.empty(len(score)), 0
    for k in range(len(score)):
        if score[k] < _NOISE_CONTRAST * (start[k + 1] - start[k]):
            own[n] = score[k]
            n += 1
    if n < _FEWEST:
        return _CLEAN
    low = kth_smallest(own[:n], int(0.8 * n))
    middle = kth_smallest(own[:n], int(0.9 * n))
    scale = (middle - low) / math.log(2)
    return max(_CLEAN, low + scale * math.log(0.2 * n / _FALSE))


@kernel
def _kept(ridges: Ridges) -> Indices:
    """Indices of the chains that are none of a better one's ridge, most light first."""
    chains = ridges.chains
    n = len(chains)
    bright = np.empty(n)
    for i in range(n):
        bright[i] = math.floor(chains[i].evidence * _DIGITS + 0.5)
    looked = _sorted(chains, bright, np.arange(n))[:MOST_CHAINS]
    m = 0
    while m < len(looked) and chains[looked[m]].evidence >= _LEAST_PART * chains[looked[0]].evidence:
        m += 1
    worth = np.empty(n)
    for i in range(n):
        own_light = chains[i].light * max(1.0 - _OF_NOISE / chains[i].contrast, 0.0)
        worth[i] = math.floor(own_light * chains[i].significance * _DIGITS + 0.5)
    kept, number = np.empty(m, np.int64), 0
    for i in _sorted(chains, worth, looked[:m]):
        own = chains[i]
        free = np.ones(own.stop - own.start, np.bool_)
        for k in kept[:number]:
            other = chains[k]
            reach = _SAME * (1 + 0.25 * FLANK) * max(own.scale, other.scale)
            if own.first > other.last + other.step or own.last < other.first - other.step:
                continue
            if own.lowest > other.highest + reach or own.highest < other.lowest - reach:
                continue
            _mark(ridges, own, other, reach, free)
        unlike = 0
        for j in range(len(free)):
            unlike += free[j]
        if unlike > _SHARE * len(free):
            kept[number] = i
            number += 1
    return _sorted(chains, bright, kept[:number])


@kernel
def _mark(ridges: Ridges, own: Any, other: Any, reach: float, free: NDArray[np.bool_]) -> None:
    """Take those nodes of a chain for not free that lie within ``reach`` of another's line."""
    _, sections, places, _ = ridges
    start, last = other.start, other.stop - 1
    k = start
    for i in range(own.start, own.stop):
        section = sections[i]
        if not other.first - other.step <= section <= other.last + other.step:
            continue
        while k + 1 < last and sections[k + 1] < section:
            k += 1
        if section <= other.first:
            line = places[start]
        elif section >= other.last:
            line = places[last]
        else:
            t = (section - sections[k]) / (sections[k + 1] - sections[k])
            line = places[k] + t * (places[k + 1] - places[k])
        if abs(places[i] - line) <= reach:
            free[i - own.start] = False


@kernel
def _sorted(chains: Records, key: Array, some: Indices) -> Indices:
    """Some chains' indices by falling key; of like ones the finer, then the earlier, then the upper."""
    out = some.copy()
    for i in range(1, len(out)):
        own, j = out[i], i
        while j > 0 and _before(chains[own], chains[out[j - 1]], key[own], key[out[j - 1]]):
            out[j] = out[j - 1]
            j -= 1
        out[j] = own
    return out


@kernel
def _before(a: Any, b: Any, key_a: float, key_b: float) -> bool:
    if key_a != key_b:
        return key_a > key_b
    if a.scale != b.scale:
        return bool(a.scale < b.scale)
    if a.first != b.first:
        return bool(a.first < b.first)
    return bool(a.lowest < b.lowest)


@kernel
def _links(nodes: RidgeNodes, ahead: IntArray, back: IntArray) -> None:
    """Each node's best successor and predecessor: near and bright; -1 for none."""
    ahead[:], back[:] = -1, -1
    for gap in range(1, _SKIP + 1):
        _link(nodes, gap, ahead)
        _link(nodes, -gap, back)


@kernel
def _link(nodes: RidgeNodes, gap: int, best: IntArray) -> None:
    """The best node ``gap`` sections on, of those that have none yet; places of a section are in order."""
    _, place, response, _, _, _, first = nodes
    sections, reach = len(first) - 1, np.float32(GATE * abs(gap))
    over = np.float32(1.0) / reach
    for c in range(max(0, -gap), min(sections, sections - gap)):
        low, stop = first[c + gap], first[c + gap + 1]
        for i in range(first[c], first[c + 1]):
            here = place[i]
            while low < stop and place[low] <= here - reach:
                low += 1
            if best[i] >= 0:
                continue
            worth, most = np.float32(0.0), np.float32(2.0) * response[i]
            for k in range(low, stop):
                off = (place[k] - here) * over
                if off >= np.float32(1.0):
                    break
                w = min(response[k], most) * (np.float32(1.0) - off * off)
                if w > worth:
                    best[i], worth = k, w


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
