"""Run what of a plan is not done yet, and merge the tables."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import closing
from dataclasses import dataclass
from functools import partial
from pathlib import Path

from workbench.campaign.asked.named import check_named
from workbench.campaign.asked.plan import Plan
from workbench.campaign.store.store import Store, opened_store
from workbench.campaign.work.engines import default_workers, run_dask, run_local
from workbench.campaign.work.shard import plans_to_send, run_shard
from workbench.campaign.work.trusted import check_cache
from workbench.campaign.work.warm import warm_server

Progress = Callable[[int, int], None]


@dataclass(frozen=True)
class RunSummary:
    """A finished run. resumed: trials that an earlier start of the same run had done."""

    folder: Path
    trials: int
    resumed: int


def run_campaign(
    plan: Plan, folder: Path, workers: int | None = None, dask: str | None = None, progress: Progress | None = None
) -> RunSummary:
    """Run a plan into a folder, going on where an earlier start stopped.

    Parameters
    ----------
    plan
        What is run.
    folder
        Made where it is not there; a folder of another plan is refused.
    workers
        Processes of this machine, default all its cores.
    dask
        Address of a scheduler in their place.
    progress
        Told the trials done and the trials in all.

    Returns
    -------
    RunSummary
        The tables in the folder are the same bytes whatever the workers, timings apart.

    Raises
    ------
    InputError
        Where a preset or file that the plan names is not there, or others can write into numba's cache folder.
    KeyboardInterrupt
        With a sentence that says what is safe.

    """
    check_cache()
    check_named(plan)
    with opened_store(folder, plan) as store:
        try:
            return _run(store, workers, dask, progress)
        except KeyboardInterrupt:
            done = store.trials - _count(store, store.missing())
            raise KeyboardInterrupt(
                f"interrupted: {done} of {store.trials} trials are safe in {folder}; the same command goes on there"
            ) from None


def _run(store: Store, workers: int | None, dask: str | None, progress: Progress | None) -> RunSummary:
    missing = store.missing()
    done = store.trials - _count(store, missing)
    summary = RunSummary(store.folder, store.trials, resumed=done)
    if progress:
        progress(done, store.trials)
    if missing:
        if not dask:
            warm_server()  # it loads its modules while the views are planned here
        work = partial(run_shard, store.plan, plans=plans_to_send(store.plan))
        results = run_dask(work, missing, dask) if dask else run_local(work, missing, workers or default_workers())
        with closing(results):  # type: ignore[type-var]
            for result in results:
                store.save(result)
                done += len(store.trials_of(result.shard))
                if progress:
                    progress(done, store.trials)
    store.merge()
    return summary


def _count(store: Store, shards: list[int]) -> int:
    return sum(len(store.trials_of(s)) for s in shards)
