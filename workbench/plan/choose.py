"""The most telling configurations of a pool: greedy choice with exchanges, beside random choices of the same pool."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from calib.bundle import FrameInformation, covariances_with, scaled, scp_covariance
from geometry.ties import first_least

Array = NDArray[np.float64]
Index = NDArray[np.intp]

RANDOM_PLANS = 50  # their median, with which a plan is compared, is then known to a fifth of their spread: 1.25 σ / √50
LEVER_MM = 300.0  # at which a rotation's error is weighed against a translation's: a sensor's usual stand-off
DISTINCT_MM = 20.0  # two views of one place differ at least by this, rotations at the lever: equal ones tell the same
_MAX_SWEEPS = 20
_GAIN = 1e-6  # a smaller relative gain is rounding: of such views the first is taken


def size_mm(covariance: Array, criterion: str) -> Array:
    """The sizes (...) of error ellipsoids (..., 6, 6) as a length [mm], rotations at LEVER_MM.

    criterion: D the mean of the axes (geometric), E the longest, A the root of the sum of squares: the rms error.
    """
    at_lever = scaled(covariance, LEVER_MM)
    if criterion == "D":
        return np.asarray(np.exp(np.linalg.slogdet(at_lever)[1] / 12))
    if criterion == "E":
        return np.asarray(np.sqrt(np.linalg.eigvalsh(at_lever)[..., -1]))
    return np.asarray(np.sqrt(np.trace(at_lever, axis1=-2, axis2=-1)))


def choose(
    info: FrameInformation,
    taken: Index,
    per_location: dict[int, int],
    criterion: str,
    progress: Callable[[int, int], None] | None = None,
) -> Index:
    """Choose ``per_location`` more frames at each place beside the ``taken`` ones: the most telling first, then
    exchanges until none makes the criterion's size smaller.
    """
    chosen: list[int] = []
    left, wanted = dict(per_location), sum(per_location.values())
    pool = pools(info, taken, per_location)
    while len(chosen) < wanted:
        trials = [_best(info, taken, chosen, pool[place], criterion) for place, n in left.items() if n]
        best, _ = trials[first_least([np.log(size) for _, size in trials], _GAIN)]
        chosen.append(best)
        left[int(info.location[best])] -= 1
        if progress:
            progress(len(chosen), wanted)
    now = float(size_mm(scp_covariance(info, _plan(taken, chosen)), criterion))
    for _ in range(_MAX_SWEEPS):
        before = now
        for k in range(wanted):
            others = chosen[:k] + chosen[k + 1 :]
            other, value = _best(info, taken, others, pool[int(info.location[chosen[k]])], criterion)
            if value < now * (1 - _GAIN):
                chosen[k], now = other, value
        if now >= before:
            break
    return np.array(chosen, dtype=np.intp)


def pools(info: FrameInformation, taken: Index, places: dict[int, int]) -> dict[int, Index]:
    """The frames of each place that are not ``taken`` yet."""
    free = np.setdiff1d(np.arange(len(info.location)), taken)
    return {place: free[info.location[free] == place] for place in places}


def random_plans(
    info: FrameInformation, taken: Index, per_location: dict[int, int], rng: np.random.Generator, count: int
) -> list[Index]:
    """Plans of the same numbers of frames, drawn at random from the same pools."""
    pool = pools(info, taken, per_location)
    draws = [[rng.choice(pool[p], n, replace=False) for p, n in per_location.items() if n] for _ in range(count)]
    return [np.concatenate([taken, *extra]).astype(np.intp) for extra in draws]


def _best(info: FrameInformation, taken: Index, chosen: list[int], pool: Index, criterion: str) -> tuple[int, float]:
    """The frame of the pool that tells most beside those taken and chosen, and the size it leaves."""
    free = np.setdiff1d(pool, chosen)
    sizes = size_mm(covariances_with(info, _plan(taken, chosen), free), criterion)
    best = first_least(np.log(sizes), _GAIN)
    return int(free[best]), float(sizes[best])


def _plan(taken: Index, chosen: list[int]) -> Index:
    return np.concatenate([taken, np.array(chosen, dtype=np.intp)])
