"""What a plan asks of the trial with a number: its settings, its seed, whether its images are kept."""

from __future__ import annotations

import numpy as np

from workbench.campaign.asked.design import Point, design_points
from workbench.campaign.asked.plan import Plan
from workbench.campaign.asked.settings import TrialSettings, with_values

_KEEP, _TRIAL = 1, 2  # which stream of the plan's seed


def n_trials(plan: Plan) -> int:
    """The number of trials: design points × repeats."""
    return len(_prepared(plan).points) * plan.repeats


def trial_settings(plan: Plan, trial: int) -> tuple[Point, TrialSettings]:
    """The design point of a trial and all its settings."""
    return _prepared(plan).of_trial(trial)


def trial_seed(plan: Plan, trial: int) -> np.random.SeedSequence:
    """The seed of a trial: a function of the plan's seed and the trial's number alone."""
    return np.random.SeedSequence(plan.seed, spawn_key=(_TRIAL, trial))


def keeps_images(plan: Plan, trial: int) -> bool:
    """Whether the trial belongs to the sampled subset whose images are kept."""
    rng = np.random.default_rng(np.random.SeedSequence(plan.seed, spawn_key=(_KEEP, trial)))
    return bool(rng.random() < plan.keep_images)


class _Prepared:
    """A plan's design points, and the settings of the point asked for last."""

    def __init__(self, plan: Plan) -> None:
        self.plan, self.points = plan, design_points(plan)
        self._last: tuple[int, TrialSettings] | None = None

    def of_trial(self, trial: int) -> tuple[Point, TrialSettings]:
        number = trial // self.plan.repeats
        if self._last is None or self._last[0] != number:
            self._last = (number, with_values(self.plan.base, self.points[number]))
        return self.points[number], self._last[1]


_PREPARED: dict[str, _Prepared] = {}  # of the last plan only: design points may be many


def _prepared(plan: Plan) -> _Prepared:
    for known in _PREPARED.values():
        if known.plan is plan:
            return known
    name = plan.fingerprint
    if name not in _PREPARED:
        fresh = _Prepared(plan)
        _PREPARED.clear()
        _PREPARED[name] = fresh
    return _PREPARED[name]
