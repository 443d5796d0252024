"""The unit of work: a few trials in one process, their rows as Parquet bytes."""

from __future__ import annotations

import io
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from workbench.campaign.design import Point, design_points
from workbench.campaign.environment import numeric_environment
from workbench.campaign.plan import Plan
from workbench.campaign.rows import FRAME_SCHEMA, PARQUET, TIMING_SCHEMA, trial_schema
from workbench.campaign.settings import TrialSettings, with_values
from workbench.campaign.store import ShardResult
from workbench.campaign.trial import Trial, run_trial
from workbench.campaign.worker import one_thread
from workbench.files import rounded

_KEEP, _TRIAL = 1, 2  # which stream of the plan's seed


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


def run_one(plan: Plan, trial: int) -> Trial:
    """Run one trial of the plan."""
    _, settings = trial_settings(plan, trial)
    try:
        return run_trial(settings, plan.run, trial_seed(plan, trial), keep_images=keeps_images(plan, trial))
    except Exception as error:
        error.add_note(f"in trial {trial}")
        raise


def run_shard(plan: Plan, shard: int) -> ShardResult:
    """Run a shard's trials; what is returned depends on the plan and the shard alone, timings apart."""
    one_thread()
    first = shard * plan.shard_trials
    last = min(first + plan.shard_trials, len(_prepared(plan).points) * plan.repeats)
    trials, frames, timings = [], [], []
    images: dict[str, bytes] = {}
    for number in range(first, last):
        point, _ = trial_settings(plan, number)
        trial = run_one(plan, number)
        key = {"trial": number, "point": number // plan.repeats, "repeat": number % plan.repeats}
        trials.append(key | {"seed": plan.seed} | point | dict(trial.row))
        frames += [{"trial": number} | row for row in trial.frames]
        timings.append({"trial": number} | dict(trial.timings))
        images |= {f"images/{number:08d}/{name}": data for name, data in trial.images.items()}
    tables = {
        "trials": _parquet(trials, trial_schema(plan)),
        "frames": _parquet(frames, FRAME_SCHEMA),
        "timings": _parquet(timings, TIMING_SCHEMA),
    }
    return ShardResult(shard, tables, images, numeric_environment())


def _parquet(rows: Sequence[Mapping[str, Any]], schema: pa.Schema) -> bytes:
    sink = io.BytesIO()
    pq.write_table(pa.Table.from_pylist([rounded(dict(row)) for row in rows], schema), sink, **PARQUET)
    return sink.getvalue()


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
