"""The most telling configurations of a pool: greedy choice with exchanges, beside random choices of the same pool."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from calib.information import FrameInformation, scaled, scp_covariance

Array = NDArray[np.float64]
Index = NDArray[np.intp]

RANDOM_PLANS = 50
EXCHANGE_ROUNDS = 2


@dataclass(frozen=True, eq=False)
class Choice:
    """The chosen frames and their predicted covariance (6, 6).

    ratio: the criterion's size of the error, as a length, over its median for RANDOM_PLANS random choices from the same
    pool. ratio_of_noise: the same of the noise of points and joints alone.
    """

    chosen: Index
    covariance: Array
    ratio: float
    ratio_of_noise: float


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
        covariance = scp_covariance(info, np.concatenate([taken, np.array(extra, dtype=np.intp)]))
        return size_mm(covariance, criterion, lever_mm)

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
    plan = np.concatenate([taken, np.array(chosen, dtype=np.intp)])
    random = _random(taken, per_location, pool, rng)
    ratios = []
    for noise_alone in (False, True):
        sizes = [
            size_mm(scp_covariance(info, p, noise_alone=noise_alone), criterion, lever_mm) for p in (plan, *random)
        ]
        ratios.append(sizes[0] / float(np.median(sizes[1:])))
    return Choice(np.array(chosen, dtype=np.intp), scp_covariance(info, plan), *ratios)


def size_mm(covariance: Array, criterion: str, lever_mm: float) -> float:
    """The size of an error ellipsoid as a length [mm]: D the mean of its axes (geometric), E the longest."""
    at_lever = scaled(covariance, lever_mm)
    if criterion == "D":
        return float(np.exp(np.linalg.slogdet(at_lever)[1] / 12))
    return float(np.sqrt(np.linalg.eigvalsh(at_lever)[-1]))


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
    taken: Index, per_location: dict[int, int], pool: dict[int, list[int]], rng: np.random.Generator
) -> list[Index]:
    plans = []
    for _ in range(RANDOM_PLANS):
        extra = [rng.choice(pool[place], n, replace=False) for place, n in per_location.items() if n]
        plans.append(np.concatenate([taken, *extra]).astype(np.intp))
    return plans


def _pool(info: FrameInformation, taken: Index, place: int) -> list[int]:
    return [int(i) for i in np.flatnonzero(info.location == place) if i not in taken]
