"""The most telling configurations of a pool: greedy choice with exchanges, beside random choices of the same pool."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from workbench.information import FrameInformation, scaled, scp_covariance

Array = NDArray[np.float64]
Index = NDArray[np.intp]

RANDOM_PLANS = 50
EXCHANGE_ROUNDS = 2


@dataclass(frozen=True, eq=False)
class Choice:
    """The chosen frames, their predicted covariance (6, 6), and those of random choices (RANDOM_PLANS, 6, 6)."""

    chosen: Index
    covariance: Array
    random: Array


def choose(
    info: FrameInformation,
    taken: Index,
    per_location: dict[int, int],
    criterion: str,
    lever_mm: float,
    rng: np.random.Generator,
    progress: Callable[[int, int], None] | None = None,
) -> Choice:
    """Choose ``per_location`` more frames at each place beside the ``taken`` ones.

    criterion: "D" makes the volume of the SCP's ellipsoid small, "E" its longest axis (rotations at ``lever_mm``).
    """
    pool = {place: _pool(info, taken, place) for place in per_location}
    chosen: list[int] = []
    wanted = sum(per_location.values())
    left = dict(per_location)

    def loss(extra: list[int]) -> float:
        covariance = scaled(scp_covariance(info, np.concatenate([taken, np.array(extra, dtype=np.intp)])), lever_mm)
        return float(np.linalg.slogdet(covariance)[1] if criterion == "D" else np.linalg.eigvalsh(covariance)[-1])

    while len(chosen) < wanted:
        open_ = [i for place, n in left.items() if n for i in pool[place] if i not in chosen]
        best = min(open_, key=lambda i: loss([*chosen, i]))
        chosen.append(best)
        left[int(info.location[best])] -= 1
        if progress:
            progress(len(chosen), wanted)
    for _ in range(EXCHANGE_ROUNDS):
        if not _exchange(chosen, pool, info, loss):
            break
    return Choice(
        np.array(chosen, dtype=np.intp),
        scp_covariance(info, np.concatenate([taken, np.array(chosen, dtype=np.intp)])),
        _random(info, taken, per_location, pool, rng),
    )


def _exchange(
    chosen: list[int], pool: dict[int, list[int]], info: FrameInformation, loss: Callable[[list[int]], float]
) -> bool:
    """Replace each chosen frame by a better one of its place; whether anything changed."""
    changed, now = False, loss(chosen)
    for k in range(len(chosen)):
        for other in pool[int(info.location[chosen[k]])]:
            if other in chosen:
                continue
            trial = [*chosen[:k], other, *chosen[k + 1 :]]
            value = loss(trial)
            if value < now - 1e-9 * abs(now):
                chosen[k], now, changed = other, value, True
    return changed


def _random(
    info: FrameInformation,
    taken: Index,
    per_location: dict[int, int],
    pool: dict[int, list[int]],
    rng: np.random.Generator,
) -> Array:
    plans = []
    for _ in range(RANDOM_PLANS):
        extra = [rng.choice(pool[place], n, replace=False) for place, n in per_location.items() if n]
        plans.append(scp_covariance(info, np.concatenate([taken, *extra]).astype(np.intp)))
    return np.array(plans)


def _pool(info: FrameInformation, taken: Index, place: int) -> list[int]:
    return [int(i) for i in np.flatnonzero(info.location == place) if i not in taken]
