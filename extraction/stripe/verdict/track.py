"""Tracks: a chain carried to every section, its light along it, its mean profile, and where it ends."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from extraction.linalg import cholesky, solve
from extraction.order import kth_smallest, mean, median, median_of
from geometry.compiled import kernel

Array = NDArray[np.float64]

# beyond the ends of a ridge that stands very clear: it is followed, whatever ended the chain at its level; of one that
# stands clear: as far as speckle may hide it and what comes after
_FOLLOWED, _VERY_CLEAR = 160, 20.0
_AFTER_A_GAP = 60
_EXTENSION = 28  # sections beyond a chain's ends that are looked at: a level's section and links lost in noise
_END_SECTIONS = 40  # inside, whose light is compared with that beyond
LEAST_END = 0.5  # of a ridge's median light, that its light at an end is taken for at least
_NEAR_END, _END_SHIFT = 8, 4  # sections on either side of an end that give its levels; how far it may still move
_CLEAR = 8.0  # contrast of such a ridge
_SHADOW, _SHADOW_SECTIONS = 0.3, 15  # share of a stripe's light, and sections in a row, that make a shadow in it
_SLOPE_SECTIONS, _SLOPE_CLEAR = 24, 10  # that give the direction beyond an end; of a ridge that stands clear
_GROUND_WIDTHS, _GROUND_PX = 4.0, 4.0  # of the window in which a rough ground is a polynomial
_WIDTHS = 25  # of bells that are tried in a mean profile
_VALLEY = 0.12  # of a peak's height, below it; a quarter at 1.2 full widths, before the track's own jitter
_WALK_SECTIONS, _WALK_PULL, _STEEPEST = 4, 0.6, 4.0  # that point the way; a centre's pull; px a section at most
_SECANT_SECTIONS = 6  # on either side, that give the slope at a section


class Track(NamedTuple):
    """A ridge at every section ``first`` … : place (n,) [px], and the Gaussian σ expected there (n,) [px]."""

    first: int
    place: Array
    width: Array

    @property
    def stop(self) -> int:
        """The section after its last."""
        return self.first + len(self.place)


@kernel
def dense(section: Array, along: Array, step: int, contrast: float, sections: int) -> Track:
    """A chain at every section it spans, smoothed as its contrast allows, extended straight on at both ends.

    section, along: of its nodes (n,) [px]. step: sections to a level's section. contrast: of the chain.
    """
    n = len(section)
    place = _smooth(along, 1 if contrast > _CLEAR else (3 if contrast > 5 else 6))
    more = _FOLLOWED if contrast > _VERY_CLEAR else (_AFTER_A_GAP if contrast > _CLEAR else _EXTENSION)
    first = max(math.ceil(section[0] - step / 2) - more, 0)
    last = min(math.floor(section[n - 1] + step / 2) + more, sections - 1)
    reach = min(max(3, (_SLOPE_CLEAR if contrast > _CLEAR else _SLOPE_SECTIONS) // step), n)
    before = _slope(section[:reach], place[:reach]) if n > 2 else 0.0
    after = _slope(section[n - reach :], place[n - reach :]) if n > 2 else 0.0
    out, k = np.empty(last - first + 1), 0
    for i in range(len(out)):
        s = float(first + i)
        if s <= section[0]:
            out[i] = place[0] + before * (s - section[0])
        elif s >= section[n - 1]:
            out[i] = place[n - 1] + after * (s - section[n - 1])
        else:
            while section[k + 1] < s:
                k += 1
            t = (s - section[k]) / (section[k + 1] - section[k])
            out[i] = place[k] + t * (place[k + 1] - place[k])
    return Track(first, out, secant(out))


@kernel
def secant(place: Array) -> Array:
    """How much wider a section sees a stripe of that course than its normal does (n,)."""
    n, out = len(place), np.ones(len(place))
    reach = min(_SECANT_SECTIONS, n - 1)
    if reach < 1:
        return out
    for k in range(n):
        a, b = max(k - reach, 0), min(k + reach, n - 1)
        slope = (place[b] - place[a]) / (b - a)
        out[k] = math.sqrt(1.0 + slope * slope)
    return out


@kernel
def _slope(x: Array, y: Array) -> float:
    middle, level = mean(x), mean(y)
    total = product = 0.0
    for i in range(len(x)):
        total += (x[i] - middle) ** 2
        product += (x[i] - middle) * (y[i] - level)
    return product / total if total > 0 else 0.0


@kernel
def _smooth(y: Array, half: int) -> Array:
    """Local straight lines over 2 half + 1 nodes; beyond the ends the course is mirrored in its last point."""
    n, out = len(y), y.copy()
    if n <= 2 * half + 1 or half < 1:
        return out
    for i in range(n):
        total = 0.0
        for k in range(i - half, i + half + 1):
            if k < 0:
                total += 2 * y[0] - y[-k]
            elif k >= n:
                total += 2 * y[n - 1] - y[2 * (n - 1) - k]
            else:
                total += y[k]
        out[i] = total / (2 * half + 1)
    return out


@kernel
def walk_out(grey: NDArray[Any], first: int, place: Array, start: int, step: int, sigma: float, height: float) -> None:
    """Follow a clear ridge from index ``start`` of its track to the track's end, section by section.

    Each section's centre of light about where the last ones point pulls the track; where there is less than a third of
    ``height``, it goes straight on. sigma: across the ridge, along its normal [px].
    """
    rows, back = grey.shape[0], _WALK_SECTIONS
    i = start
    while 0 <= i < len(place):
        near, far = i - step, i - step * (back + 1)
        slope = (place[near] - place[far]) / back if 0 <= far < len(place) else 0.0
        slope = min(max(slope, -_STEEPEST), _STEEPEST)
        c, wide = place[near] + slope, sigma * math.sqrt(1 + slope * slope)
        half = 2.0 * wide + 0.5
        low, high = max(math.ceil(c - half), 0), min(int(c + half), rows - 1)
        if high - low < 2:
            place[i] = c
            i += step
            continue
        base = min(float(grey[low, first + i]), float(grey[high, first + i]))
        total, moment = 0.0, 0.0
        for r in range(low, high + 1):
            g = max(float(grey[r, first + i]) - base, 0.0)
            total, moment = total + g, moment + g * (r - c)
        lit = total > 0.33 * height * 2.0 * wide
        place[i] = c + (_WALK_PULL * moment / total if lit else 0.0)
        i += step


@kernel
def light_along(grey: NDArray[Any], first: int, place: Array, widths: Array, share: float, out: Array) -> None:
    """Centre less flanks of each section [DN]: mean within half its width of the track less the mean of the flanks.

    Half of the centre is ``share`` of widths (n,), half a pixel at least. Each flank is about as wide and begins at
    twice that from the track; of what the border cuts off, nothing is taken.
    """
    rows = grey.shape[0]
    for i in range(len(place)):
        c, s, half = place[i], first + i, max(0.5, share * widths[i])
        inner, outer = 2.0 * half + 0.5, 3.0 * half + 1.5
        total, n, flank, m = 0.0, 0, 0.0, 0
        for r in range(max(math.ceil(c - outer), 0), min(int(c + outer), rows - 1) + 1):
            off = abs(r - c)
            if off <= half + 0.5:
                total += float(grey[r, s])
                n += 1
            elif off >= inner:
                flank += float(grey[r, s])
                m += 1
        out[i] = total / n - flank / m if n > 0 and m > 0 else 0.0


@kernel
def light_on_rough_ground(grey: NDArray[Any], first: int, place: Array, width: float, out: Array) -> None:
    """Height of a bell of that σ at each section (n,) [DN], on a ground that is a polynomial of the fourth degree.

    Blotches some widths large are such polynomials; what is left of them in the answer is noise between neighbours.
    """
    reach = int(_GROUND_WIDTHS * width + _GROUND_PX)
    weights = np.zeros(2 * reach + 1)
    _height_of_a_bell(width, weights)
    _correlate(grey, first, place, weights, out)


@kernel
def bell_on_rough_ground(grey: NDArray[Any], first: int, place: Array, expected: float) -> tuple[float, float]:
    """Gaussian σ [px] and height [DN] of the mean profile of all sections (n,), on a ground as above.

    expected: σ; half of it to twice it is tried.
    """
    reach = int(_GROUND_WIDTHS * expected + _GROUND_PX)
    profile, weights, tried = np.empty(2 * reach + 1), np.zeros(2 * reach + 1), np.zeros(_WIDTHS)
    mean_profile(grey, first, place, 1, profile)
    best, height = 0, 0.0
    for k in range(_WIDTHS):
        share = _height_of_a_bell(expected * 2.0 ** (2.0 * k / (_WIDTHS - 1) - 1.0), weights)
        h = 0.0
        for i in range(len(weights)):
            h += weights[i] * profile[i]
        tried[k] = h * h / share if h > 0 else 0.0  # what the bell takes from the squared residuals
        if tried[k] > tried[best]:
            best, height = k, h
    shift = 0.0
    if 0 < best < _WIDTHS - 1:
        a, b, c = tried[best - 1], tried[best], tried[best + 1]
        shift = 0.5 * (c - a) / (2 * b - a - c) if 2 * b > a + c else 0.0
    return expected * 2.0 ** (2.0 * (best + shift) / (_WIDTHS - 1) - 1.0), height


@kernel
def _height_of_a_bell(width: float, weights: Array) -> float:
    """Weights (2 reach + 1,) whose sum with grey levels is a bell's height; its variance for noise of variance one."""
    n, reach = len(weights), len(weights) // 2
    columns, square, factor = np.empty((n, 6)), np.zeros((6, 6)), np.zeros((6, 6))
    for i in range(n):
        x = float(i - reach)
        columns[i, 0], columns[i, 1] = math.exp(-0.5 * (x / width) ** 2), 1.0
        for j in range(2, 6):
            columns[i, j] = columns[i, j - 1] * x / reach
        for j in range(6):
            for k in range(6):
                square[j, k] += columns[i, j] * columns[i, k]
    unit, share = np.zeros(6), np.zeros(6)
    unit[0] = 1.0
    cholesky(square, 0.0, 1e-12, 6, factor)
    solve(factor, unit, 6, share)
    for i in range(n):
        weights[i] = 0.0
        for j in range(6):
            weights[i] += columns[i, j] * share[j]
    return float(share[0])


@kernel
def _correlate(grey: NDArray[Any], first: int, place: Array, weights: Array, out: Array) -> None:
    rows, half = grey.shape[0], len(weights) // 2
    for i in range(len(place)):
        total = 0.0
        for k in range(len(weights)):
            x = min(max(place[i] + k - half, 0.0), rows - 1.001)
            r = int(x)
            t = x - r
            total += weights[k] * ((1 - t) * float(grey[r, first + i]) + t * float(grey[r + 1, first + i]))
        out[i] = total


@kernel
def mean_profile(grey: NDArray[Any], first: int, place: Array, parts: int, out: Array) -> int:
    """Mean grey levels at distances (k - len // 2) / parts from the track, interpolated; returns the sections taken.

    Beyond the border the last row is taken again. Every ``parts``-th distance lies alike between its rows: together
    they are one row of vector instructions.
    """
    rows, half = grey.shape[0], len(out) // 2
    longest = (len(out) - 1) // parts + 1
    column, sums = np.empty(longest + 2), np.zeros((parts, longest))
    n = 0
    for i in range(len(place)):
        c, s = place[i], first + i
        if c < 0 or c > rows - 1:
            continue
        n += 1
        low = math.floor(c - half / parts)
        for r in range(len(column)):
            column[r] = float(grey[min(max(low + r, 0), rows - 1), s])
        for part in range(parts):
            x = c + (part - half) / parts
            start = math.floor(x) - low
            _add_between(column[start:], x - math.floor(x), sums[part])
    for k in range(len(out)):
        out[k] = sums[k % parts, k // parts] / max(n, 1)
    return n


@kernel(fastmath=True)
def _add_between(column: Array, share: float, out: Array) -> None:
    """Add to ``out`` (n,) what lies that share of a row beyond each of ``column``."""
    for k in range(min(len(out), len(column) - 1)):
        out[k] += (1 - share) * column[k] + share * column[k + 1]


class Bumps(NamedTuple):
    """Peaks of a mean profile: how many (0, 1, 2), offsets [px], Gaussian σ by the flanks [px], flatness."""

    peaks: int
    first: float
    second: float
    width: float
    height: float
    flat: float


@kernel
def one_bump(two: Bumps) -> Bumps:
    """Two peaks taken for one: as wide as both, midway."""
    middle = 0.5 * (two.first + two.second)
    return Bumps(1, middle, 0.0, two.width + (two.second - two.first) / 2.3548, two.height, 0.0)


@kernel
def bumps(profile: Array, step: float, reach: float, clip: float) -> Bumps:
    """What stands in a mean profile within ``reach`` of its middle.

    Two peaks count where the valley between is _VALLEY below the lower. flat: the width at four fifths of the height
    over that at three tenths; 0.43 for a Gaussian, 1 for a box.
    """
    n, middle = len(profile), len(profile) // 2
    low, high = max(1, middle - int(reach / step)), min(n - 2, middle + int(reach / step))
    top = low
    for k in range(low, high + 1):
        if profile[k] > profile[top]:
            top = k
    left, right = profile[top], profile[top]
    for k in range(top, -1, -1):
        left = min(left, profile[k])
    for k in range(top, n):
        right = min(right, profile[k])
    base = max(left, right)
    height = profile[top] - base
    if not height > 0:
        return Bumps(0, 0.0, 0.0, 0.0, 0.0, 0.0)
    best = -1
    for side in (-1, 1):
        valley, k = profile[top], top + side
        while low <= k <= high:
            valley = min(valley, profile[k])
            peak = profile[k] >= profile[k - 1] and profile[k] >= profile[k + 1]
            apart = profile[k] - base > 0.35 * height and profile[k] - valley > _VALLEY * (profile[k] - base)
            if peak and apart and (best < 0 or profile[k] > profile[best]):
                best = k
            k += side
    a = _crossing(profile, top, -1, base + 0.5 * height)
    b = _crossing(profile, top, 1, base + 0.5 * height)
    if best >= 0:
        near = min(top - a, b - top)  # the flank that no neighbour touches
        near_best = (
            best - _crossing(profile, best, -1, base + 0.5 * (profile[best] - base))
            if best < top
            else (_crossing(profile, best, 1, base + 0.5 * (profile[best] - base)) - best)
        )
        width = min(near, near_best) * step * 2 / 2.3548
        x, y = min(top, best), max(top, best)
        return Bumps(2, (x - middle) * step, (y - middle) * step, max(width, 0.5), height, 0.0)
    upper = _crossing(profile, top, 1, base + 0.8 * height) - _crossing(profile, top, -1, base + 0.8 * height)
    lower = _crossing(profile, top, 1, base + 0.3 * height) - _crossing(profile, top, -1, base + 0.3 * height)
    flat = upper / lower if lower > 0 and profile[top] < 0.9 * clip else 0.0
    return Bumps(1, (0.5 * (a + b) - middle) * step, 0.0, (b - a) * step / 2.3548, height, flat)


@kernel
def _crossing(profile: Array, start: int, side: int, level: float) -> float:
    """Index at which the profile falls below the level, going outwards from ``start``."""
    k = start
    while 0 < k < len(profile) - 1 and profile[k] >= level:
        k += side
    inner = k - side
    drop = profile[inner] - profile[k]
    return inner + side * ((profile[inner] - level) / drop if drop > 0 and profile[k] < level else 0.0)


@kernel
def likeliest_end(light: Array, start: int, length: int, least: float, on_nothing: bool) -> int:
    """The first index of a track of that light (n,): where a step up is likeliest.

    start, length: of what belongs to the chain. least: that its light is taken for at least. First the step is from
    nothing to the median light of the nearest sections inside, then from what the sections just outside have to what
    those just inside have: a rough ground is not nothing, unless ``on_nothing`` says so.
    """
    depth = min(_END_SECTIONS, max(length, 1))
    height = max(median_of(light, start, min(start + depth, len(light))), least)
    k = _likeliest_step(light, 0, min(start + depth, len(light)), 0.5 * height)
    for _ in range(0 if on_nothing else 2):
        low, high = max(k - _NEAR_END, 0), min(k + _NEAR_END, len(light))
        if k - low < _NEAR_END // 2 or high - k < _NEAR_END:
            break
        level = 0.5 * (mean(light[low:k]) + mean(light[k:high]))
        k = _likeliest_step(light, max(k - _END_SHIFT, 0), min(k + _END_SHIFT, len(light)), level)
    return k


@kernel
def _likeliest_step(light: Array, start: int, stop: int, level: float) -> int:
    """From which index on the sum of light above the level, up to ``stop``, is largest: the first of like ones."""
    total, best, largest = 0.0, start, -np.inf
    for k in range(stop - 1, start - 1, -1):
        total += light[k] - level
        rounded = math.floor(total * 1e6 + 0.5)
        if rounded >= largest:
            best, largest = k, rounded
    return best


@kernel
def lit_reach(light: Array, start: int, stop: int) -> tuple[int, int]:
    """The track as far as it stays lit beyond start … stop, and the first dark stretch: the next piece is another's."""
    height = median_of(light, start, stop)
    while stop < len(light) and mean(light[stop : stop + _SHADOW_SECTIONS]) >= _SHADOW * height:
        stop += 1
    while start > 0 and mean(light[max(start - _SHADOW_SECTIONS, 0) : start]) >= _SHADOW * height:
        start -= 1
    return max(start - _SHADOW_SECTIONS, 0), min(stop + _SHADOW_SECTIONS, len(light))


@kernel
def lit_pieces(light: Array, start: int, stop: int) -> NDArray[np.int64]:
    """Stretches (P, 2) of a track that are lit: where the light, a median over some sections, is not far below its own.

    A ridge goes on through a shadow on what little is there; a stripe does not.
    """
    n = stop - start
    own = np.empty(n)
    for i in range(n):
        own[i] = light[start + i]
    kth_smallest(own, n // 2)
    level = _SHADOW * median(own[n // 2 :])
    half = min(_SHADOW_SECTIONS // 2, (n - 1) // 2)
    out, pieces, lit_all, since = np.empty((n + 1, 2), np.int64), 0, True, -1
    bright = 0  # of the sections about one; nothing beyond the ends is
    for i in range(start, min(start + half, stop)):
        bright += light[i] > level
    for i in range(start, stop):
        bright += i + half < stop and light[min(i + half, stop - 1)] > level
        bright -= i - half - 1 >= start and light[max(i - half - 1, start)] > level
        lit = bright > half
        if lit and since < 0:
            since = i
        if since >= 0 and (not lit or i == stop - 1):
            end = i + 1 if lit else i
            if end - since >= _SHADOW_SECTIONS:
                out[pieces, 0], out[pieces, 1] = since, end
                pieces += 1
            since = -1
        lit_all = lit_all and lit
    if lit_all:
        out[0, 0], out[0, 1], pieces = start, stop, 1
    return out[:pieces]
