"""The course of a faint ridge on a rough ground: sections centred together, straight lines through them.

A chain of such a ridge wanders with the ground, and beyond its ends from one bright spot to the next; what many
sections say together does neither. Where the stripe goes on straight ahead, the chain's own ends are none of its.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from extraction.stripe.verdict.track import Track, light_on_rough_ground, secant

Array = NDArray[np.float64]

BLOCK = 8  # sections that are centred together: of signals three times their σ, to a sixth of the stripe's width
_TRIED_PX = (-1.5, -1.0, -0.5, 0.0, 0.5, 1.0, 1.5)  # beside the course so far
_ROUNDS = 2
_ABOUT = 2  # blocks on either side, whose centres make a block's own with it: a straight line
_END_BLOCKS = 6  # whose line says where a stripe goes on
_LIT = 0.5  # of the stripe's height, from which a block is lit
_BEYOND = 28  # sections beyond the last lit block that are looked at for the end


def steady_course(
    grey: NDArray[Any], track: Track, start: int, stop: int, width: float
) -> tuple[Track, int, int, float]:
    """A faint ridge's track anew, its lit stretch start … stop - 1 as indices of it, and its height there [DN].

    start, stop: the stretch of ``track`` that the chain has. width: Gaussian σ expected [px]. Where nothing is lit, the
    track as it was, and 0.
    """
    sections = grey.shape[1]
    a, b = track.first + start, track.first + stop
    course = np.empty(sections)
    course[track.first : track.stop] = track.place
    course[: track.first], course[track.stop :] = track.place[0], track.place[-1]
    blocks: list[tuple[int, float]] = []
    height = 0.0
    for _ in range(_ROUNDS):
        lights = _lights(grey, a, b, course, width)
        found = [_centre(lights, k, a, course) for k in range(a, b - BLOCK + 1, BLOCK)]
        if not found:
            return track, start, stop, 0.0
        height = sorted(light for _, _, light in found)[len(found) // 2]
        lit = [i for i, (_, _, light) in enumerate(found) if light >= _LIT * height]
        if not height > 0.0 or not lit:
            return track, start, stop, 0.0
        blocks = [(middle, centre) for middle, centre, _ in found[lit[0] : lit[-1] + 1]]
        blocks = _followed(grey, blocks, width, height)
        a, b = blocks[0][0] - BLOCK // 2, blocks[-1][0] + BLOCK // 2
        course = _through(blocks, sections)
    first, last = max(a - _BEYOND, 0), min(b + _BEYOND, sections)
    place = course[first:last].copy()
    return Track(first, place, secant(place)), a - first, b - first, height


def _lights(grey: NDArray[Any], a: int, b: int, course: Array, width: float) -> Array:
    """Sums along the sections a … b - 1 of the light at each place tried (tried, b - a + 1)."""
    out = np.zeros((len(_TRIED_PX), b - a + 1))
    light = np.empty(b - a)
    for k, off in enumerate(_TRIED_PX):
        light_on_rough_ground(grey, a, course[a:b] + off, width, light)
        np.cumsum(light, out=out[k, 1:])
    return out


def _centre(lights: Array, section: int, a: int, course: Array) -> tuple[int, float, float]:
    """A section in the middle of the block from ``section`` on, its centre [px] and its light [DN]."""
    own = [float(x) for x in (lights[:, section - a + BLOCK] - lights[:, section - a]) / BLOCK]
    best = max(range(len(own)), key=lambda k: (round(own[k], 6), -abs(_TRIED_PX[k]), -k))
    off = _TRIED_PX[best]
    if 0 < best < len(own) - 1:
        bend = 2 * own[best] - own[best - 1] - own[best + 1]
        step = _TRIED_PX[1] - _TRIED_PX[0]
        off += step * 0.5 * (own[best + 1] - own[best - 1]) / bend if bend > 0 else 0.0
    middle = section + BLOCK // 2
    return middle, float(course[middle]) + off, own[best]


def _followed(
    grey: NDArray[Any], blocks: list[tuple[int, float]], width: float, height: float
) -> list[tuple[int, float]]:
    """The blocks with those that follow at either end, as long as they are lit."""
    rows, sections = grey.shape
    for side in (-1, 1):
        while True:
            end = blocks[0] if side < 0 else blocks[-1]
            section = end[0] + side * BLOCK - BLOCK // 2
            slope, level, about = _line(blocks[:_END_BLOCKS] if side < 0 else blocks[-_END_BLOCKS:])
            ahead = level + slope * (np.arange(section, section + BLOCK) - about)
            if section < 0 or section + BLOCK > sections or ahead.min() < 0 or ahead.max() > rows - 1:
                break
            course = np.zeros(section + BLOCK)
            course[section:] = ahead
            lights = _lights(grey, section, section + BLOCK, course, width)
            middle, centre, light = _centre(lights, section, section, course)
            if light < _LIT * height:
                break
            blocks = [(middle, centre), *blocks] if side < 0 else [*blocks, (middle, centre)]
    return blocks


def _line(blocks: list[tuple[int, float]]) -> tuple[float, float, float]:
    """Slope, level and middle of the straight line through some blocks' centres."""
    n = len(blocks)
    about, level = math.fsum(s for s, _ in blocks) / n, math.fsum(c for _, c in blocks) / n
    total = math.fsum((s - about) ** 2 for s, _ in blocks)
    return (math.fsum((s - about) * (c - level) for s, c in blocks) / total if total > 0 else 0.0), level, about


def _through(blocks: list[tuple[int, float]], sections: int) -> Array:
    """The course (sections,) through blocks, each about the line with its neighbours; beyond them straight on."""
    centres = []
    for i, (section, _) in enumerate(blocks):
        low = max(min(i - _ABOUT, len(blocks) - 2 * _ABOUT - 1), 0)
        slope, level, about = _line(blocks[low : low + 2 * _ABOUT + 1])
        centres.append(level + slope * (section - about))
    middles = np.array([float(s) for s, _ in blocks])
    every = np.arange(sections, dtype=float)
    out = np.interp(every, middles, centres)
    for part, beyond in ((blocks[:_END_BLOCKS], every < middles[0]), (blocks[-_END_BLOCKS:], every > middles[-1])):
        slope, level, about = _line(part)
        out[beyond] = level + slope * (every[beyond] - about)
    return np.asarray(out)
