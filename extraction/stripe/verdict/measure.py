"""A ridge measured: its mean profile where it is brightest, its light along it, and its pieces from end to end."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from extraction.order import mean, median_of
from extraction.stripe.ridges import FLANK, Chain
from extraction.stripe.verdict.course import steady_course
from extraction.stripe.verdict.track import (
    LEAST_END,
    Bumps,
    Track,
    bell_on_rough_ground,
    bumps,
    dense,
    light_along,
    light_on_rough_ground,
    likeliest_end,
    lit_pieces,
    lit_reach,
    mean_profile,
    one_bump,
    secant,
    walk_out,
)
from geometry.compiled import kernel

Array = NDArray[np.float64]

DARK_MARGIN = 1  # sections between a lit piece and the dark one beside it
DARK_END = 15  # sections of a ridge beyond its lit pieces, from which they are one of its dark ones
DARK_HEIGHT = 2.0  # of the lit pieces' height, at most: what is clipped there and narrow here may be as high
CLEAR, WALK_NODES = 8.0, 3  # contrast from which a ridge is followed to its ends; level sections inside, to begin
PAIR_APART = 0.2  # of two peaks' distance, that it may differ between a ridge's halves
PROFILE_PARTS = 2  # places to a row of a mean profile
PROFILE_SECTIONS = 96  # over which a ridge's mean profile is taken
FAINT_WIDTH, FAINT_ROUNDS = 1.5, 2  # width of a faint ridge over its scale, to begin; course and width by turns
_SHORTEST = 3  # sections of a piece


class Piece(NamedTuple):
    """A stretch of a ridge's track, start … stop - 1 from its first section; what stands in its mean profile; whether
    it lies dark between two lit ones, or beyond them.
    """

    start: int
    stop: int
    bumps: Bumps
    dark: bool


def measure(grey: NDArray[Any], chain: Chain, clip: float) -> tuple[Track, list[Piece]]:
    """The chain's track, wider ends and all, and its pieces; none where it has no peak. grey: sections are columns."""
    section, rough, reach = chain.section, chain.rough, float(FLANK * chain.scale)
    track = dense(section, chain.place, chain.step, chain.contrast, grey.shape[1])
    n, profile = len(track.place), np.empty(2 * int(2.2 * reach * PROFILE_PARTS) + 1)
    start, stop = max(int(section[0]) - track.first, 0), min(int(section[-1]) - track.first + 1, n)
    a, b = _brightest(section, chain.response, chain.step, track.first, start, stop)

    def profile_of(low: int, high: int) -> Bumps:
        mean_profile(grey, track.first + low, track.place[low:high], PROFILE_PARTS, profile)
        return bumps(profile, 1 / PROFILE_PARTS, reach, clip)

    found = profile_of(a, b)
    if found.peaks == 2:
        halfway = (start + stop) // 2
        halves = [profile_of(*middle(*half)) for half in ((start, halfway), (halfway, stop))]
        if not all(_alike(half, found) for half in halves):  # speckle shows two peaks here and there
            found = one_bump(found)
    if chain.narrow and found.peaks < 2:
        return _measure_faint(grey, chain, track, start, stop, found.width)
    if found.peaks == 0:
        return track, []
    if found.peaks == 1:
        track.place[:] += found.first
    if found.peaks == 1 and chain.contrast > CLEAR and not rough:
        sigma, skip = found.width / mean(track.width[a:b]), min(WALK_NODES * chain.step, (stop - start) // 2)
        walk_out(grey, track.first, track.place, start + skip, -1, sigma, found.height)
        walk_out(grey, track.first, track.place, stop - skip, 1, sigma, found.height)
        track = Track(track.first, track.place, secant(track.place))
    light = np.empty(n)
    if rough:
        light_on_rough_ground(grey, track.first, track.place, found.width, light)
        lit = np.array([[start, stop]], np.int64)
    else:
        across = found.width / mean(track.width[a:b])
        half = across if found.peaks == 1 else 0.5 * (found.second - found.first) + found.width
        light_along(grey, track.first, track.place, track.width, half, light)
        lit = lit_pieces(light, start, stop)
    pieces = []
    for k, (low, high) in enumerate(_ends(light, lit, start, stop, rough).tolist()):
        if high - low < _SHORTEST:
            continue
        shape = found
        if k or (low, high) != (start, stop):
            shape = profile_of(*middle(low, high))
            if shape.peaks == 2 and found.peaks == 1:
                shape = one_bump(shape)
        if shape.peaks and (k < len(lit) or shape.height < DARK_HEIGHT * found.height):
            pieces.append(Piece(low, high, shape, k >= len(lit)))
    return track, pieces


def _measure_faint(
    grey: NDArray[Any], chain: Chain, track: Track, start: int, stop: int, width: float
) -> tuple[Track, list[Piece]]:
    """The same of a faint ridge on a rough ground: what many sections say together. width: expected [px], 0 if none."""
    width = width or FAINT_WIDTH * chain.scale
    for _ in range(FAINT_ROUNDS):
        track, start, stop, height = steady_course(grey, track, start, stop, width)
        if not height > 0:
            return track, []
        width, height = bell_on_rough_ground(grey, track.first + start, track.place[start:stop], width)
    light = np.empty(len(track.place))
    light_on_rough_ground(grey, track.first, track.place, width, light)
    low, high = _ends(light, np.array([[start, stop]], np.int64), start, stop, True)[0].tolist()
    if high - low < _SHORTEST:
        return track, []
    return track, [Piece(low, high, Bumps(1, 0.0, 0.0, width, height, 0.0), False)]


def _alike(half: Bumps, whole: Bumps) -> bool:
    """Whether a half of a ridge shows two peaks as far apart as the whole of it."""
    apart = whole.second - whole.first
    return half.peaks == 2 and abs(half.second - half.first - apart) <= PAIR_APART * apart


def middle(start: int, stop: int) -> tuple[int, int]:
    """The middle PROFILE_SECTIONS sections."""
    cut = max(0, (stop - start - PROFILE_SECTIONS) // 2)
    return start + cut, stop - cut


@kernel
def _ends(light: Array, lit: NDArray[np.int64], start: int, stop: int, rough: bool) -> NDArray[np.int64]:
    """The lit stretches (P, 2) from end to end, then the dark ones between them and, to start … stop - 1, beyond."""
    ends = np.empty((2 * len(lit) + 1, 2), np.int64)
    for k in range(len(lit)):
        low, high = lit_reach(light, lit[k, 0], lit[k, 1])
        low = max(lit[k - 1, 1] if k else 0, low)
        high = min(lit[k + 1, 0] if k + 1 < len(lit) else len(light), high)
        least = LEAST_END * median_of(light, lit[k, 0], lit[k, 1])
        length = lit[k, 1] - lit[k, 0]
        ends[k, 0] = low + likeliest_end(light[low:high], lit[k, 0] - low, length, least, rough)
        backwards = np.empty(high - low)
        for i in range(high - low):
            backwards[i] = light[high - 1 - i]
        ends[k, 1] = high - likeliest_end(backwards, high - lit[k, 1], length, least, rough)
    for k in range(len(lit) - 1):
        ends[len(lit) + k, 0] = ends[k, 1] + DARK_MARGIN
        ends[len(lit) + k, 1] = ends[k + 1, 0] - DARK_MARGIN
    number = max(2 * len(lit) - 1, 0)
    if number == 0:
        return ends[:0]
    first, last = ends[0, 0] - DARK_MARGIN, ends[len(lit) - 1, 1] + DARK_MARGIN
    if first - start >= DARK_END:
        low, _ = lit_reach(light, start, first)
        least = LEAST_END * median_of(light, start, first)
        ends[number, 0] = low + likeliest_end(light[low:first], start - low, first - start, least, rough)
        ends[number, 1] = first
        number += 1
    if stop - last >= DARK_END:
        _, high = lit_reach(light, last, stop)
        least = LEAST_END * median_of(light, last, stop)
        backwards = np.empty(high - last)
        for i in range(high - last):
            backwards[i] = light[high - 1 - i]
        ends[number, 0] = last
        ends[number, 1] = high - likeliest_end(backwards, high - stop, stop - last, least, rough)
        number += 1
    return ends[:number]


@kernel
def _brightest(section: Array, response: Array, step: int, first: int, start: int, stop: int) -> tuple[int, int]:
    """The PROFILE_SECTIONS sections of a chain with the most light."""
    nodes = max(1, PROFILE_SECTIONS // step)
    if len(section) <= nodes:
        return start, stop
    total = 0.0
    for k in range(nodes):
        total += response[k]
    best, largest = 0, math.floor(total * 1e6 + 0.5)
    for k in range(1, len(section) - nodes + 1):
        total += response[k + nodes - 1] - response[k - 1]
        rounded = math.floor(total * 1e6 + 0.5)
        if rounded > largest:
            best, largest = k, rounded
    a = max(int(section[best]) - first, start)
    return a, min(a + PROFILE_SECTIONS, stop)
