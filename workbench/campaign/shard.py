"""The unit of work: a few trials in one process, their rows as Parquet bytes."""

from __future__ import annotations

import io
import os
from collections.abc import Mapping, Sequence
from functools import lru_cache
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from workbench.campaign.design import Point, design_points
from workbench.campaign.plan import Plan, plan_of
from workbench.campaign.rows import FRAME_SCHEMA, TIMING_SCHEMA, trial_schema
from workbench.campaign.settings import TrialSettings, with_values
from workbench.campaign.store import ShardResult
from workbench.campaign.trial import Trial, run_trial

_KEEP, _TRIAL = 1, 2  # which stream of the plan's seed


def trial_settings(plan: Plan, trial: int) -> tuple[Point, TrialSettings]:
    """The design point of a trial and all its settings."""
    point = _points(plan.fingerprint, plan.model_dump_json())[trial // plan.repeats]
    return point, with_values(plan.base, point)


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
    return run_trial(settings, plan.run, trial_seed(plan, trial), keep_images=keeps_images(plan, trial))


def run_shard(plan: Plan, shard: int) -> ShardResult:
    """Run a shard's trials; what is returned depends on the plan and the shard alone, timings apart."""
    _one_thread()
    first = shard * plan.shard_trials
    last = min(first + plan.shard_trials, len(_points(plan.fingerprint, plan.model_dump_json())) * plan.repeats)
    trials, frames, timings = [], [], []
    images: dict[str, bytes] = {}
    for number in range(first, last):
        point, _ = trial_settings(plan, number)
        trial = run_one(plan, number)
        key = {"trial": number, "point": number // plan.repeats, "repeat": number % plan.repeats}
        trials.append(key | {"seed": plan.seed} | point | dict(trial.row))
        frames += [{"trial": number} | {k: v for k, v in row.items() if k != "_score"} for row in trial.frames]
        timings.append({"trial": number} | dict(trial.timings))
        images |= {f"images/{number:08d}/{name}": data for name, data in trial.images.items()}
    tables = {
        "trials": _parquet(trials, trial_schema(plan)),
        "frames": _parquet(frames, FRAME_SCHEMA),
        "timings": _parquet(timings, TIMING_SCHEMA),
    }
    return ShardResult(shard, tables, images)


def _parquet(rows: Sequence[Mapping[str, Any]], schema: pa.Schema) -> bytes:
    sink = io.BytesIO()
    pq.write_table(pa.Table.from_pylist(list(rows), schema), sink, compression="zstd")
    return sink.getvalue()


@lru_cache(maxsize=4)
def _points(fingerprint: str, plan_json: str) -> list[Point]:
    import json

    return design_points(plan_of(json.loads(plan_json)))


def _one_thread() -> None:
    """One core a worker: OpenCV is told here, BLAS by its pool's limits."""
    import cv2

    cv2.setNumThreads(1)
    for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
        os.environ.setdefault(name, "1")
