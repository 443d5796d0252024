"""The unit of work: a few trials in one process, their rows as Parquet bytes."""

from __future__ import annotations

import io
from collections.abc import Mapping, Sequence
from typing import Any

import pyarrow as pa
import pyarrow.parquet as pq

from geometry import rounded
from workbench.campaign.asked.plan import Plan
from workbench.campaign.asked.trials import keeps_images, n_trials, trial_seed, trial_settings
from workbench.campaign.store.environment import numeric_environment
from workbench.campaign.store.rows import FRAME_SCHEMA, PARQUET, TIMING_SCHEMA, trial_schema
from workbench.campaign.store.store import ShardResult
from workbench.campaign.trial.emulated import Plans, all_plans, know_plans
from workbench.campaign.trial.trial import Trial, run_trial
from workbench.campaign.work.worker import one_thread

_PLANNED_BY = ("jig", "robot.preset", "sensor.preset", "poses", "clutter")  # settings that a plan of views hangs on


def run_one(plan: Plan, trial: int) -> Trial:
    """Run one trial of the plan."""
    _, settings = trial_settings(plan, trial)
    try:
        return run_trial(settings, plan.run, trial_seed(plan, trial), keep_images=keeps_images(plan, trial))
    except Exception as error:
        error.add_note(f"in trial {trial}")
        raise


def plans_to_send(plan: Plan) -> Plans:
    """The plans of views that all trials share, where no factor changes what they hang on; else none."""
    varied = any(name == own or name.startswith(f"{own}.") for name in plan.factors for own in _PLANNED_BY)
    return {} if varied or n_trials(plan) == 0 else all_plans(trial_settings(plan, 0)[1])


def run_shard(plan: Plan, shard: int, plans: Plans | None = None) -> ShardResult:
    """Run a shard's trials; what is returned depends on the plan and the shard alone, timings apart.

    plans: of views, as `plans_to_send` made them; the worker makes those that are missing.
    """
    one_thread()
    know_plans(plans or {})
    first = shard * plan.shard_trials
    last = min(first + plan.shard_trials, n_trials(plan))
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
