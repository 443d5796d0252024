"""Which of several peaks of a section is the stripe: strongest, first, last, or the best continuous chain."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from extraction.config import StripeConfig
from geometry.compiled import kernel

Array = NDArray[np.float64]
Indices = NDArray[np.intp]

MOST_WORTH = 1.5  # of a peak, in median heights: one reflection, however bright, is no longer chain
MOST_COST = 1.5  # of a step, in median peaks: beyond, the stripe has gone to another surface
_SLOPE = 4.0  # px per section: a steeper stripe is seen better along the other axis


def select(config: StripeConfig, section: NDArray[np.int32], place: Array, height: Array) -> Indices:
    """Indices of the chosen peaks, at most one a section unless the rule is "all".

    section: non-decreasing (N,). place: position along the section [px] (N,). height: amplitude [DN] (N,).
    """
    rule = config.select
    everything = np.arange(len(section))
    if rule == "all" or len(section) == 0 or (rule != "continuous" and np.all(section[1:] > section[:-1])):
        return everything
    if rule == "continuous":
        worth = np.minimum(height / np.median(height), MOST_WORTH)
        return np.asarray(_chain(section.astype(np.int64), place, worth, config.jump_px, config.max_gap), dtype=np.intp)
    key = {"strongest": -height, "first": place, "last": -place}[rule]
    order = np.lexsort((key, section))
    first = np.r_[True, section[order][1:] != section[order][:-1]]
    return np.asarray(order[first])


def connected(section: NDArray[np.int32], place: Array, shortest: int) -> NDArray[np.bool_]:
    """Which peaks belong to a run of at least ``shortest`` sections that follow each other: noise stands alone (N,)."""
    if shortest <= 1 or len(section) == 0:
        return np.ones(len(section), dtype=bool)
    before = _run_lengths(section.astype(np.int64), place)
    after = _run_lengths(-section[::-1].astype(np.int64), np.ascontiguousarray(place[::-1]))[::-1]
    return np.asarray(before + after - 1 >= shortest)


@kernel
def _run_lengths(section: NDArray[np.int64], place: Array) -> NDArray[np.int64]:
    """Length of the longest run that ends at each peak; a link spans at most two sections and _SLOPE px for each."""
    out = np.ones(len(section), dtype=np.int64)
    for i in range(len(section)):
        for k in range(i - 1, -1, -1):
            gap = section[i] - section[k]
            if gap > 2:
                break
            if gap > 0 and out[k] >= out[i] and abs(place[i] - place[k]) <= _SLOPE * gap:
                out[i] = out[k] + 1
    return out


@kernel
def _chain(section: NDArray[np.int64], place: Array, worth: Array, jump: float, max_gap: int) -> NDArray[np.int64]:
    """The chains of peaks with the largest sum of worths less their steps, by dynamic programming.

    A step costs its length over ``jump``, at most MOST_COST, at which price a chain may also begin anew elsewhere.
    """
    n = len(section)
    total, before = np.empty(n), np.full(n, -1)
    best_closed, best_open = -1, -1  # best end in all earlier sections; in this section so far
    for i in range(n):
        if i > 0 and section[i] != section[i - 1] and best_open >= 0:
            if best_closed < 0 or total[best_open] > total[best_closed]:
                best_closed = best_open
            best_open = -1
        total[i] = worth[i]
        if best_closed >= 0 and total[best_closed] - MOST_COST > 0:
            total[i], before[i] = worth[i] + total[best_closed] - MOST_COST, best_closed
        for k in range(i - 1, -1, -1):
            gap = section[i] - section[k]
            if gap > max_gap:
                break
            if gap > 0:
                cost = min(abs(place[i] - place[k]) / jump, MOST_COST)
                if worth[i] + total[k] - cost > total[i]:
                    total[i], before[i] = worth[i] + total[k] - cost, k
        if best_open < 0 or total[i] > total[best_open]:
            best_open = i
    end = best_open if best_closed < 0 or total[best_open] > total[best_closed] else best_closed
    chosen = np.empty(n, dtype=np.int64)
    count = 0
    while end >= 0:
        chosen[count] = end
        count += 1
        end = before[end]
    return chosen[:count][::-1].copy()
