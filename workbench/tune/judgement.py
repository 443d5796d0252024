"""Found parameters against the defaults on the images that the search has not seen."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from extraction import ExtractionConfig
from workbench.tune.cost import FrameCost, Score, total
from workbench.tune.task import Task

BOOTSTRAPS = 2000  # 100 of them lie beyond each end of the 90 % interval
AS_GOOD = 0.05  # a loss within this of the other is as good


@dataclass(frozen=True, eq=False)
class Judgement:
    """Held-out figures. ``gain``: 1 − loss / loss of the defaults; ``gain_90``: its 90 % interval, by frames.

    better: the gain is above AS_GOOD and its interval above zero; otherwise the defaults are recommended.
    """

    defaults: Score
    start: Score
    found: Score
    gain: float
    gain_90: tuple[float, float]
    better: bool


def judge(task: Task, start: ExtractionConfig, found: ExtractionConfig, seed: int) -> Judgement:
    """Score defaults, start and what was found on the held-out part, frame by frame on the same images.

    Parameters
    ----------
    task
        The images.
    start, found
        Parameters to be held against the defaults.
    seed
        Of the bootstrap over frames.

    Returns
    -------
    Judgement
        With the gain over the defaults and its 90 % interval.

    """
    defaults = type(start)()
    base = task.scores(task.held_out, defaults)
    begun = base if start == defaults else task.scores(task.held_out, start)
    new = base if found == defaults else task.scores(task.held_out, found)
    interval = _bootstrap(base, new, np.random.default_rng(seed))
    gain = 1 - total(new).loss_mm / total(base).loss_mm
    better = gain > AS_GOOD and interval[0] > 0
    return Judgement(total(base), total(begun), total(new), gain, interval, better)


def _bootstrap(base: Sequence[FrameCost], new: Sequence[FrameCost], rng: np.random.Generator) -> tuple[float, float]:
    """90 % interval of the gain, frames drawn with replacement, the same for both."""
    drawn = rng.integers(0, len(base), (BOOTSTRAPS, len(base)))
    old_cost = np.array([f.cost_mm2 for f in base])[drawn].sum(axis=1)
    new_cost = np.array([f.cost_mm2 for f in new])[drawn].sum(axis=1)
    gain = 1 - np.sqrt(new_cost / np.maximum(old_cost, 1e-12))
    low, high = np.quantile(gain, (0.05, 0.95))
    return float(low), float(high)
