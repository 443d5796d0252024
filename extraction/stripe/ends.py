"""Where the pieces of a stripe begin and end, to a fraction of a section, with σ."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from extraction.config import StripeConfig
from extraction.image import clipping_level, grey_levels
from extraction.stripe.profile import SATURATED, StripePeaks
from extraction.stripe.view import StripeView, stripe_view
from geometry.special import erf

Array = NDArray[np.float64]

_INSIDE, _OUTSIDE, _FEWEST = 20, 14, 4  # sections on either side whose light is fitted; fewest of a side
_COURSE = 12  # of the last points, whose straight line is the course beyond them
_ABOUT = 4  # sections to either side of the last point, in which the end is looked for
_STEP, _BLURS = 0.25, (0.2, 0.35, 0.6, 1.0, 1.6, 2.5)  # places tried, and blurs [sections]
# of the light's fall, over the stripe's own σ: what the lens blurs is less than the stripe is wide; its error, likewise
_BLUR, _BLUR_ERROR = 0.5, 0.6
# of the stripe's σ, by which clipped light seems to fall later: twice that at five times the clipping level
_CLIPPED = 0.25
_LEAST_BLUR = 0.1  # sections: below, all is one pixel's share
_NEAR_END = 3  # sections about the end that have no say in how the light scatters
_STEPS, _CLOSE = 20, 1e-4
_LEAST_FALL = 4.0  # of the light over its own σ; less is no end that can be measured
_WINDOW = 4.0  # of a section's light: σ to either side of the course
_DIGITS = 4  # of what is told: no bit of a processor's own
_MOST_ALIKE = 0.95  # correlation of neighbouring sections' light


@dataclass(frozen=True)
class PieceEnds:
    """One piece of a stripe, ``first`` to ``last`` section, and where its light ends along the sections [px].

    begin_px is below first, end_px above last by half a section on average: the centre of a section is its number. None
    where the stripe goes on to the border, or its light does not fall to nothing; σ likewise.
    """

    piece: int
    first: int
    last: int
    begin_px: float | None
    sigma_begin_px: float | None
    end_px: float | None
    sigma_end_px: float | None


def piece_ends(
    image: NDArray[np.generic],
    peaks: StripePeaks,
    laser_off: NDArray[np.generic] | None = None,
    mask: NDArray[np.bool_] | None = None,
) -> list[PieceEnds]:
    """The ends of every piece of a stripe, by the step of its light along its course.

    The step is that of light through a lens, a Gaussian's integral over each pixel, its blur fitted with it; σ is what
    the light scatters on either side of it.

    Parameters
    ----------
    image
        Grey levels (H, W) in which ``peaks`` were found.
    peaks
        One point a section and piece, ordered along the stripe, as `detect_stripe` gives them.
    laser_off, mask
        As they were given to it.

    Returns
    -------
    ends
        Ordered by piece; coordinates are image columns where sections are columns, else rows.

    References
    ----------
    docs/stripes.md says how exact they are.
    """
    if len(peaks) == 0 or len(peaks.piece) == 0:
        return []
    rows = abs(float(peaks.normal[0, 0])) > abs(float(peaks.normal[0, 1]))
    config = StripeConfig(direction="rows" if rows else "columns")
    view = stripe_view(image, config, laser_off, mask, clipping_level(grey_levels(image)), 0.0)
    place = peaks.uv_px[:, 0 if rows else 1]
    out = []
    for number in range(int(peaks.piece.max()) + 1):
        own = np.flatnonzero(peaks.piece == number)
        if len(own) == 0:
            continue
        ends: list[tuple[float, float] | None] = []
        for side, order in ((-1, own[::-1]), (1, own)):
            ends.append(_end(view, peaks, place, order, side) if len(own) >= _FEWEST else None)
        begin, end = ends
        out.append(
            PieceEnds(
                number,
                int(peaks.section[own[0]]),
                int(peaks.section[own[-1]]),
                *((None, None) if begin is None else begin),
                *((None, None) if end is None else end),
            )
        )
    return out


def _end(
    view: StripeView, peaks: StripePeaks, place: Array, order: NDArray[np.intp], side: int
) -> tuple[float, float] | None:
    """Section coordinate of the last end of points in ``order``, and its σ. side: 1 where sections grow towards it."""
    sections = view.grey.shape[1]
    last, near = int(peaks.section[order[-1]]), order[-_INSIDE:]
    width = float(np.median(peaks.width_px[near]))
    x = side * (peaks.section[near].astype(float) - last)  # 0 at the last point, less inside
    inside = min(int(-x[0]), _INSIDE)
    room = (sections - 1 - last) if side > 0 else last
    outside = min(room, _OUTSIDE)
    if inside < _FEWEST or outside < _FEWEST:
        return None
    line = order[-min(_COURSE, len(order)) :]
    slope, level = _line(side * (peaks.section[line].astype(float) - last), place[line])
    at = np.arange(-inside, outside + 1)
    course = np.where(at <= 0, np.interp(at, x, place[near]), level + slope * at)
    outside = _free(peaks, place, order, last + side * at[at > 0], course[at > 0], width)
    if outside < _FEWEST:
        return None
    at, course = at[: inside + 1 + outside], course[: inside + 1 + outside]
    if course.min() < 0 or course.max() > view.grey.shape[0] - 1:
        return None
    light = _light(view.grey, last + side * at, course, width)
    found = _fit(at.astype(float), light, width)
    if found is None:
        return None
    beyond, sigma = found
    if np.any(peaks.flag[near[-_ABOUT:]] & SATURATED):  # a clipped light falls later than it would
        sigma = math.hypot(sigma, _CLIPPED * width)
    return round(last + side * beyond, _DIGITS), round(sigma, _DIGITS)


def _free(
    peaks: StripePeaks, place: Array, order: NDArray[np.intp], section: NDArray[np.int64], course: Array, width: float
) -> int:
    """How many sections beyond the end have no other piece's points on the course."""
    others = np.flatnonzero(peaks.piece != peaks.piece[order[0]])
    for k, (s, c) in enumerate(zip(section.tolist(), course.tolist(), strict=True)):
        there = others[peaks.section[others] == s]
        if np.any(np.abs(place[there] - c) < 4 * width + 2):
            return k
    return len(section)


def _light(grey: NDArray[Any], section: NDArray[np.int64], course: Array, width: float) -> Array:
    """The height of a bell of that σ at each section (n,) [DN], on a level ground of its own."""
    reach = math.ceil(_WINDOW * width + 1)
    rows = np.round(course).astype(np.int64)[:, None] + np.arange(-reach, reach + 1)
    inside = (rows >= 0) & (rows < grey.shape[0])
    values = grey[np.clip(rows, 0, grey.shape[0] - 1), section[:, None]].astype(float) * inside
    bell = np.exp(-0.5 * ((rows - course[:, None]) / width) ** 2) * inside
    n, sb, sbb = inside.sum(axis=1), bell.sum(axis=1), (bell * bell).sum(axis=1)
    sy, sby = values.sum(axis=1), (bell * values).sum(axis=1)
    return np.asarray((n * sby - sb * sy) / np.maximum(n * sbb - sb * sb, 1e-12))


def _line(x: Array, y: Array) -> tuple[float, float]:
    """Slope and level at 0 of the straight line through points."""
    n = len(x)
    mx, my = math.fsum(x.tolist()) / n, math.fsum(y.tolist()) / n
    square = math.fsum(((x - mx) ** 2).tolist())
    slope = math.fsum(((x - mx) * (y - my)).tolist()) / square if square > 0 else 0.0
    return slope, my - slope * mx


def _lit(x: Array, end: float | Array, blur: float | Array) -> Array:
    """The share of light in the pixels about x (n,): a step down at ``end`` through a lens, over each pixel."""

    def integral(t: Array) -> Array:
        z = t / blur
        return np.asarray(0.5 * t * (1 + erf(z / math.sqrt(2))) + blur * np.exp(-0.5 * z * z) / math.sqrt(2 * math.pi))

    return integral(end - x + 0.5) - integral(end - x - 0.5)


def _fit(x: Array, light: Array, width: float) -> tuple[float, float] | None:
    """Where the light (n,) steps down, from the last point's section on, and its σ; None where it does not.

    x: sections from the last point outwards (n,).
    """
    lit, dark = light[x <= -_NEAR_END], light[x >= _NEAR_END]
    if len(lit) < _FEWEST or len(dark) < _FEWEST:
        return None
    noise = [max(1.4826 * float(np.median(np.abs(part - np.median(part)))), 1e-3) for part in (lit, dark)]
    expected = _BLUR * width
    # every place with every blur at once: shares of light (places, blurs, n)
    tried, blurs = np.arange(-_ABOUT, _ABOUT + 1 + _STEP / 2, _STEP), np.array(_BLURS)
    share = _lit(x, tried[:, None, None], blurs[:, None])
    highs, lows, left_over = _levels(share, light, _weights(share, noise))
    left_over = np.where(highs > lows, left_over + ((blurs - expected) / (_BLUR_ERROR * width)) ** 2, np.inf)
    best = int(np.argmin(np.round(left_over, 6)))
    if not np.isfinite(left_over.flat[best]):
        return None
    end, blur = float(tried[best // len(blurs)]), float(blurs[best % len(blurs)])
    high, low = float(highs.flat[best]), float(lows.flat[best])
    alike, variance = _correlation(lit), np.inf
    for _ in range(_STEPS):
        share = _lit(x, end, blur)
        weight = _weights(share, noise)
        slopes = (high - low) * np.array([_slope(x, end, blur, 0), _slope(x, end, blur, 1)])
        slopes = np.vstack([slopes, share, 1 - share])
        left = light - (high * share + low * (1 - share))
        fisher = (slopes[:, None, :] * slopes[None, :, :] * weight).sum(axis=2)
        score = (slopes * (weight * left)).sum(axis=1)
        prior = 1 / (_BLUR_ERROR * width) ** 2
        fisher[1, 1] += prior
        score[1] += prior * (expected - blur)
        try:
            cov = np.linalg.inv(fisher)
        except np.linalg.LinAlgError:
            return None
        move = cov @ score
        moved = min(max(float(move[0]), -0.5), 0.5)
        end, blur = end + moved, max(blur + min(max(float(move[1]), -0.3), 0.3), _LEAST_BLUR)
        high, low = high + float(move[2]), low + float(move[3])
        # what neighbours share makes the same weights less sure of the end
        shared = slopes * np.sqrt(weight)
        inside = (shared @ alike ** np.abs(x[:, None] - x[None, :])) @ shared.T
        inside[1, 1] += prior
        variance = float((cov @ inside @ cov)[0, 0])
        if abs(moved) < _CLOSE:
            break
    fall = math.hypot(noise[0] / math.sqrt(len(lit)), noise[1] / math.sqrt(len(dark)))
    if not (abs(end) <= _ABOUT + 1.5 and high - low > _LEAST_FALL * fall and variance > 0 and math.isfinite(variance)):
        return None
    chi2 = float((weight * left * left).sum()) / max(len(x) - 4, 1)
    return end, math.sqrt(variance * max(chi2, 1.0))


def _slope(x: Array, end: float, blur: float, of: int) -> Array:
    """Derivative of the share of light by the end (0) or by the blur (1)."""
    step = 1e-3
    by_end, by_blur = (step, 0.0) if of == 0 else (0.0, step)
    more, less = _lit(x, end + by_end, blur + by_blur), _lit(x, end - by_end, blur - by_blur)
    return np.asarray((more - less) / (2 * step))


def _correlation(light: Array) -> float:
    """Of neighbouring sections' light (n,), at least 0."""
    off = light - float(np.median(light))
    square = float((off * off).sum())
    return min(max(float((off[1:] * off[:-1]).sum()) / square, 0.0), _MOST_ALIKE) if square > 0 else 0.0


def _weights(share: Array, noise: list[float]) -> Array:
    """One over the light's variance: as it scatters where it is lit, as it does beyond, in proportion between."""
    return np.asarray(1 / (noise[1] ** 2 + max(noise[0] ** 2 - noise[1] ** 2, 0.0) * share**2))


def _levels(share: Array, light: Array, weight: Array) -> tuple[Array, Array, Array]:
    """The levels inside and outside that fit best, and what they leave (…): of shares and weights (…, n)."""
    a, b = share, 1 - share
    faa, fab, fbb = ((weight * p * q).sum(axis=-1) for p, q in ((a, a), (a, b), (b, b)))
    ga, gb = ((weight * p * light).sum(axis=-1) for p in (a, b))
    det = faa * fbb - fab * fab
    some = det > 1e-12 * faa * fbb
    det = np.where(some, det, 1.0)
    high, low = (fbb * ga - fab * gb) / det, (faa * gb - fab * ga) / det
    left = light - high[..., None] * a - low[..., None] * b
    return high, low, np.where(some, (weight * left * left).sum(axis=-1), np.inf)
