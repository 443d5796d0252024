"""A ridge measured: its mean profile where it is brightest, its light along it, and its pieces from end to end."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from extraction.order import mean, median_of
from extraction.stripe.chain import Chain
from extraction.stripe.model import Records
from extraction.stripe.ridge import FLANK
from extraction.stripe.track import (
    LEAST_END,
    Bumps,
    Track,
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

DARK_MARGIN = 3  # sections between a lit piece and the dark one beside it
CLEAR, WALK_NODES = 8.0, 3  # contrast from which a ridge is followed to its ends; level sections inside, to begin
PAIR_APART = 0.2  # of two peaks' distance, that it may differ between a ridge's halves
PROFILE_STEP_PX = 0.5
PROFILE_SECTIONS = 96  # over which a ridge's mean profile is taken
_SHORTEST = 3  # sections of a piece

# a piece of a ridge: its first section and the one after its last, from the track's first; what stands in its mean
# profile; whether it lies dark between two lit ones
PIECE = np.dtype(
    [
        *((name, np.int64) for name in ("start", "stop", "peaks")),
        *((name, np.float64) for name in ("first", "second", "width", "height", "flat")),
        ("dark", np.bool_),
    ],
    align=True,
)


class Ridge(NamedTuple):
    """A chain as the kernels take it: its nodes (n,), and what `Chain` says of them."""

    section: Array
    place: Array
    response: Array
    scale: int
    step: int
    contrast: float
    rough: bool


@kernel
def measure(grey: NDArray[Any], ridge: Ridge, clip: float, empty: Records) -> tuple[Track, Records]:
    """The ridge's track, wider ends and all, and its pieces (P,) of PIECE; none where it has no peak. empty: (0,)."""
    section, along, response, scale, step, contrast, rough = ridge
    track = dense(section, along, step, contrast, grey.shape[1])
    n, reach = len(track.place), FLANK * scale
    profile = np.empty(2 * int(2.2 * reach / PROFILE_STEP_PX) + 1)
    start, stop = max(int(section[0]) - track.first, 0), min(int(section[-1]) - track.first + 1, n)
    a, b = _brightest(section, response, step, track.first, start, stop)
    found = _profile_of(grey, track.first + a, track.place[a:b], profile, reach, clip)
    if found.peaks == 2 and not _pair_throughout(grey, track, start, stop, found, profile, reach, clip):
        found = one_bump(found)
    if found.peaks == 0:
        return track, np.empty(0, empty.dtype)
    for i in range(n):
        track.place[i] += found.first if found.peaks == 1 else 0.0
    if found.peaks == 1 and contrast > CLEAR and not rough:
        sigma, skip = found.width / mean(track.width[a:b]), min(WALK_NODES * step, (stop - start) // 2)
        walk_out(grey, track.first, track.place, start + skip, -1, sigma, found.height)
        walk_out(grey, track.first, track.place, stop - skip, 1, sigma, found.height)
        track = Track(track.first, track.place, secant(track.place))
    light = np.empty(n)
    if rough:
        light_on_rough_ground(grey, track.first, track.place, found.width, light)
        lit = np.empty((1, 2), np.int64)
        lit[0, 0], lit[0, 1] = start, stop
    else:
        across = found.width / mean(track.width[a:b])
        half = across if found.peaks == 1 else 0.5 * (found.second - found.first) + found.width
        light_along(grey, track.first, track.place, track.width, half, light)
        lit = lit_pieces(light, start, stop)
    return track, _pieces(grey, track, light, lit, rough, found, (start, stop), profile, reach, clip, empty)


@kernel
def _pieces(
    grey: NDArray[Any], track: Track, light: Array, lit: NDArray[np.int64], rough: bool, found: Bumps,
    inside: tuple[int, int], profile: Array, reach: float, clip: float, empty: Records,
) -> Records:  # fmt: skip
    """The lit stretches from end to end, then the dark ones between them, each with its own mean profile."""
    ends = np.empty((2 * len(lit), 2), np.int64)
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
    out, number = np.empty(len(ends), empty.dtype), 0
    for k in range(max(2 * len(lit) - 1, 0)):
        start, stop = ends[k, 0], ends[k, 1]
        if stop - start < _SHORTEST:
            continue
        shape = found
        if k or start != inside[0] or stop != inside[1]:
            a, b = middle(start, stop)
            shape = _profile_of(grey, track.first + a, track.place[a:b], profile, reach, clip)
            if shape.peaks == 2 and found.peaks == 1:
                shape = one_bump(shape)
        if shape.peaks:
            row = out[number]
            row.start, row.stop, row.dark = start, stop, k >= len(lit)
            row.peaks, row.first, row.second = shape.peaks, shape.first, shape.second
            row.width, row.height, row.flat = shape.width, shape.height, shape.flat
            number += 1
    return out[:number]


@kernel
def middle(start: int, stop: int) -> tuple[int, int]:
    """The middle PROFILE_SECTIONS sections."""
    cut = max(0, (stop - start - PROFILE_SECTIONS) // 2)
    return start + cut, stop - cut


@kernel
def _profile_of(grey: NDArray[Any], first: int, place: Array, out: Array, reach: float, clip: float) -> Bumps:
    mean_profile(grey, first, place, PROFILE_STEP_PX, out)
    return bumps(out, PROFILE_STEP_PX, float(reach), clip)


@kernel
def _pair_throughout(
    grey: NDArray[Any], track: Track, start: int, stop: int, found: Bumps, out: Array, reach: float, clip: float
) -> bool:
    """Whether both halves of a ridge show two peaks as far apart: speckle shows two here and there."""
    halfway, apart = (start + stop) // 2, found.second - found.first
    for k in range(2):
        a, b = middle(start, halfway) if k == 0 else middle(halfway, stop)
        half = _profile_of(grey, track.first + a, track.place[a:b], out, reach, clip)
        if half.peaks != 2 or abs(half.second - half.first - apart) > PAIR_APART * apart:
            return False
    return True


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


def ridge_of(chain: Chain) -> Ridge:
    """The same as the kernels take it."""
    return Ridge(chain.section, chain.place, chain.response, chain.scale, chain.step, chain.contrast, chain.rough)
