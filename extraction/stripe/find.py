"""From an image to the places that are fitted: which sections hold a stripe, and about where."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from extraction.config import StripeConfig
from extraction.stripe.above_print import level_of_print, means_along
from extraction.stripe.places import Places, StripeFacts
from extraction.stripe.ridges import Chain, Pyramid, RidgeSearch, each_once, search, search_faint, together
from extraction.stripe.verdict import Stripe, StripeVerdict, bridged, courses, judge
from extraction.stripe.view import IntArray, StripeView, turn
from geometry.compiled import kernel

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

SCALES = (2, 4, 8)  # pixels of the levels: Gaussian σ from half a pixel to sixteen
FAINT = 80.0  # significance of the best ridge, below which narrow rows are searched too
CLEAR = 12.0  # contrast of a coarse ridge, and times the other direction's claim, from which nothing is in doubt
WHOLE = 0.85  # of the columns that a ridge spans, over which columns must follow it too
CLIMBS = 8  # stretches of a chain whose climb makes how far it goes across its sections
COLUMNS_FIRST = 3.0  # times the light in ridges, that rows must show more than columns
ALIKE, CROWDED = ("weak_beside_the_stripe", "flat"), 12  # refused ridges, not far below a stripe, that are a crowd
# of the sections, that a stripe crosses which is believed where the first look found none; of white's level, that it
# stands above
ACROSS, STANDS_OUT = 0.6, 0.1
SMEARED = 24  # sections whose mean makes dashes over small squares one stripe
MORE_ABOVE = 1.1  # times as many sections as with it, that are sure without a print
MOSTLY = 0.6  # of all places, from which a doubt is one of the whole image
ALONE = 0.3  # of all stripes' light: a refused ridge with that much makes every point doubtful
_NO_PLACES = tuple(np.zeros(0, t) for t in (np.int32, float, float, np.int32, np.int32, bool, bool, bool))


@dataclass(frozen=True, eq=False)
class Found:
    """The view that was searched, the places, facts of each stripe by number, and how many ridges were refused why.

    across_dn: height of the brightest one where it stands clear and goes on over most of the picture, else 0. lit: of
    each place (N,), where refused ridges are so many that their borders may pull at points: whether it gives a course
    to which others are held.
    """

    view: StripeView
    places: Places
    stripes: list[StripeFacts]
    refused: dict[str, int]
    across_dn: float = 0.0
    lit: Mask | None = None


def find(view: StripeView, config: StripeConfig) -> Found:
    """The stripes of a view; with direction "auto" along columns or rows, whichever shows more light in ridges.

    In a picture full of other ridges, where little of a stripe is sure, what stands above a lamp's white is looked at.
    """
    grey = _without(view)
    found = _found(view, grey, config)
    if not _in_a_crowd(found):
        return found
    level = level_of_print(grey)
    above = np.maximum(grey, np.ceil(level).astype(grey.dtype))
    for smeared in (1, SMEARED):
        other = _above(view, above, config, smeared)
        if other.across_dn <= STANDS_OUT * max(float(np.median(level)), 0.0):
            continue
        lit = _lit(other.view.grey, _turned(level) if other.view.turned != view.turned else level, other.places)
        if _sure(other.places, lit) > MORE_ABOVE * _sure(found.places):
            return replace(other, refused=found.refused, lit=lit)
    return replace(found, lit=np.ones(len(found.places), np.bool_))


def _above(view: StripeView, grey: NDArray[Any], config: StripeConfig, sections: int) -> Found:
    """The stripes of what stands above a print, gaps between their pieces with them: of means of so many sections.

    Small black squares make dashes of a stripe, too short for any; the means join them.
    """
    best = None
    for turned in (False,) if config.direction != "auto" else (False, True):
        means = means_along(grey, sections, 0 if turned else 1) if sections > 1 else grey
        found = _judged(view, means, _search(Pyramid(means), _scales(config), (turned,)), config, bridge=True)
        best = found if best is None or found.across_dn > best.across_dn else best
    return best if best is not None else Found(view, Places(*_NO_PLACES), [], {})


def _found(view: StripeView, grey: NDArray[Any], config: StripeConfig) -> Found:
    """The stripes in these grey levels of a view: of the direction that shows none, those of the other one."""
    pyramid, scales = Pyramid(grey), _scales(config)
    directions = (False,) if config.direction != "auto" else (False, True)
    first = found = _judged(view, grey, _search(pyramid, scales, directions), config)
    if len(directions) > 1 and found.refused and not found.stripes:
        other = (first.view.turned == view.turned,)
        found = _judged(view, grey, _search(pyramid, scales, other), config)
    return found if found.across_dn > 0 else first


def _scales(config: StripeConfig) -> tuple[int, ...]:
    return tuple(s for s in SCALES if s <= 2 or 0.5 * s <= config.max_width_px)


def _judged(
    view: StripeView, grey: NDArray[Any], searched: RidgeSearch, config: StripeConfig, bridge: bool = False
) -> Found:
    """What of the ridges along a direction is stripe."""
    if searched.turned:
        view, grey = turn(view), _turned(grey)
    verdict = judge(grey, searched.chains, view.clip_dn, config.max_width_px, config.min_run)
    if bridge:
        verdict = replace(verdict, stripes=bridged(verdict.stripes))
    places, facts = _places(verdict, grey.shape[0], grey.shape[1])
    return Found(view, places, facts, verdict.refused, _height_across(verdict.stripes, grey.shape[1]))


def _height_across(stripes: list[Stripe], sections: int) -> float:
    """Height of the first stripe where it stands clear and goes on, in pieces, over most of the picture; else 0."""
    if not stripes or stripes[0].chain.contrast <= CLEAR:
        return 0.0
    own = [s.track for s, course in zip(stripes, courses(stripes), strict=True) if course == 0]
    spanned = max(t.stop for t in own) - min(t.first for t in own)
    return stripes[0].height if spanned >= ACROSS * sections else 0.0


def _in_a_crowd(found: Found) -> bool:
    """Whether many ridges were refused that are about as high as the stripe, or of which none stands out."""
    return "one_of_many" in found.refused or sum(found.refused.get(k, 0) for k in ALIKE) >= CROWDED


def _sure(places: Places, lit: Mask | None = None) -> int:
    """How many sections have a place that nothing rivals, of those that are lit."""
    sure = ~(places.doubt | places.ghost)
    return len(np.unique(places.section[sure if lit is None else sure & lit]))


def _lit(grey: NDArray[Any], level: NDArray[np.float32], places: Places) -> Mask:
    """Of each place (N,), whether most pixels about it stand above a level."""
    row = np.clip(np.round(places.centre_px).astype(int), 1, max(grey.shape[0] - 2, 1)) + np.array([[-1], [0], [1]])
    row = np.minimum(row, grey.shape[0] - 1)
    above = grey[row, places.section] > level[row, places.section]
    return np.asarray(np.count_nonzero(above, axis=0) >= 2)


def _search(pyramid: Pyramid, scales: tuple[int, ...], directions: tuple[bool, ...]) -> RidgeSearch:
    """The ridges along the direction that shows more: coarse ones of both, then fine ones of what is left in doubt."""
    coarse = {turned: search(pyramid, scales[1:], turned) for turned in directions}
    order = sorted((RidgeSearch(each_once(together(c)), t) for t, c in coarse.items()), key=_claim, reverse=True)
    first = order[0]
    clear = first.chains and first.chains[0].contrast > CLEAR and _claim(first) > CLEAR * _claim(order[-1])
    turns = [s.turned for s in ([first] if clear else order)]
    best = _direction([RidgeSearch(each_once(together(coarse[t] + search(pyramid, scales[:1], t))), t) for t in turns])
    if not best.chains or max(c.significance for c in best.chains) < FAINT:
        best = _direction([RidgeSearch(each_once(together(search_faint(pyramid, scales, t))), t) for t in directions])
    return best


def _claim(s: RidgeSearch) -> float:
    """What speaks for a direction."""
    return round(s.evidence, 3)


def _direction(searches: list[RidgeSearch]) -> RidgeSearch:
    """The search that is believed: columns where rows do not show far more, and they follow the ridge as far.

    A section sees a stripe wider by the secant of its slope: a steep one that is wide is followed along rows only.
    """
    best = max(searches, key=_claim)
    others = [s for s in searches if not s.turned and s is not best and s.chains]
    if not best.turned or not others:
        return best
    rows, columns = best.chains[0], others[0].chains[0]
    seen = columns.length >= WHOLE * _climb(rows) and _lies_on(columns, rows)
    return others[0] if seen and COLUMNS_FIRST * _claim(others[0]) > _claim(best) else best


def _climb(chain: Chain) -> float:
    """How far a chain climbs along its sections, up and down [px]."""
    every = chain.place[:: max(1, len(chain.place) // CLIMBS)]
    return math.fsum(abs(float(x)) for x in np.diff(np.append(every, chain.place[-1])))


def _lies_on(columns: Chain, rows: Chain) -> bool:
    """Whether most nodes of a chain along columns lie on one along rows: another ridge says nothing of this one."""
    line = np.interp(columns.place, rows.section, rows.place)
    reach = float(columns.scale + rows.scale)
    inside = (columns.place >= rows.section[0] - reach) & (columns.place <= rows.section[-1] + reach)
    near = inside & (np.abs(line - columns.section) <= reach)
    return 2 * int(np.count_nonzero(near)) >= len(near)


def _turned(grey: NDArray[Any]) -> NDArray[Any]:
    return cv2.transpose(np.ascontiguousarray(grey))


def _without(view: StripeView) -> NDArray[Any]:
    """The grey levels with left-out pixels at the level of the rest."""
    if view.left_out.size == 0 or not view.left_out.any():
        return view.grey
    grey: NDArray[Any] = view.grey.copy()
    rest = grey[~view.left_out]
    grey[view.left_out] = np.median(rest) if rest.size else 0
    return grey


def _places(verdict: StripeVerdict, rows: int, sections: int) -> tuple[Places, list[StripeFacts]]:
    facts: list[StripeFacts] = []
    parts: list[tuple[NDArray[Any], ...]] = []
    for s, course in zip(verdict.stripes, courses(verdict.stripes), strict=True):
        n = len(s.track.place)
        section = np.arange(s.track.first, s.track.stop, dtype=np.int32)
        pair = s.bumps.peaks == 2
        doubt, number = _doubt(s, verdict) | pair, len(facts)
        for k, offset in enumerate((s.bumps.first, s.bumps.second) if pair else (0.0,)):
            facts.append(StripeFacts(s.ghost, number, course))
            stripe, other = (np.full(n, x, np.int32) for x in (number + k, number + 1 - k if pair else -1))
            faint, ghost = (np.full(n, x, np.bool_) for x in (s.chain.rough, s.ghost))
            parts.append((section, s.track.place + offset, s.track.width, stripe, other, faint, ghost, doubt))
    if not parts:
        parts.append(_NO_PLACES)
    columns = parts[0] if len(parts) == 1 else tuple(np.concatenate(column) for column in zip(*parts, strict=True))
    order = _in_order(columns[0], columns[1], rows, sections)
    section, centre, width, stripe, other, faint, ghost, doubt = (column[order] for column in columns)
    low, high, partner = _own_rows(section, centre, stripe, other, rows)
    real = doubt[~ghost]
    if len(real) and np.count_nonzero(real) > MOSTLY * len(real):
        doubt[:] = True
    return Places(section, centre, low, high, width, stripe, partner, faint, ghost, doubt), facts


@kernel
def _in_order(section: IntArray, centre: Array, rows: int, sections: int) -> NDArray[np.int64]:
    """Indices of the places whose centre lies in the image, by section, then centre."""
    first = np.zeros(sections + 1, np.int64)
    for i in range(len(section)):
        if 0 <= centre[i] <= rows - 1:
            first[section[i] + 1] += 1
    for c in range(sections):
        first[c + 1] += first[c]
    out, end = np.empty(first[sections], np.int64), first.copy()
    for i in range(len(section)):
        if 0 <= centre[i] <= rows - 1:
            c = section[i]
            k = end[c]
            while k > first[c] and centre[out[k - 1]] > centre[i]:
                out[k] = out[k - 1]
                k -= 1
            out[k] = i
            end[c] += 1
    return out


@kernel
def _own_rows(
    section: IntArray, centre: Array, stripe: IntArray, other: IntArray, rows: int
) -> tuple[IntArray, IntArray, IntArray]:
    """Of places in order: the rows that are each one's own, and the index of its partner in the same section."""
    n = len(section)
    low, high, partner = np.zeros(n, np.int32), np.full(n, rows, np.int32), np.full(n, -1, np.int32)
    start = 0
    for i in range(n):
        if section[i] != section[start]:
            start = i
        if i > start:
            middle = math.ceil((centre[i] + centre[i - 1]) / 2)
            low[i], high[i - 1] = middle, middle
        for k in range(start, i):
            if other[k] >= 0 and stripe[i] == other[k]:
                partner[i], partner[k] = k, i
    return low, high, partner


def _doubt(s: Stripe, verdict: StripeVerdict) -> Mask:
    """Where another ridge has as good a claim: one of like light that was kept, or a stronger one that was refused."""
    out = np.full(len(s.track.place), s.ghost)
    total = sum(k.light for k in verdict.stripes if not k.ghost)
    for k in verdict.stripes:
        if k is not s and (_like(s, k) if not k.ghost else k.height > s.height):
            out[_shared(s, k)] = True
    for k in verdict.others:
        if k.height > s.height:
            out[_shared(s, k)] = True
        if k.light > ALONE * total and k.height > ALONE * s.height:
            out[:] = True
    return out


def _like(s: Stripe, k: Stripe) -> bool:
    return k.height >= 0.45 * s.height


def _shared(s: Stripe, k: Stripe) -> slice:
    start = max(k.track.first - s.track.first, 0)
    return slice(start, max(start, k.track.stop - s.track.first))
