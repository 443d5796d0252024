"""Campaign speed: trials per second, two workers against one, and what storage costs.

    python benchmarks/campaign_speed.py [TRIALS]

Plans of configurations are made before the clock starts, as they are shared by all trials of a long run. The machine's
other load moves the rates; the ratios are what to read.
"""

from __future__ import annotations

import shutil
import sys
import tempfile
import time
from pathlib import Path

from workbench.campaign.engines import run_local
from workbench.campaign.plan import Plan
from workbench.campaign.runner import run_campaign
from workbench.campaign.shard import run_shard
from workbench.campaign.store import open_store


def plan(run: str, trials: int) -> Plan:
    """Trials of the default cell: 3 × 7 frames of 1280 × 1024 with the full camera."""
    return Plan.model_validate({"run": run, "repeats": trials, "shard_trials": 4, "base": {"poses": {"plans": 1}}})


def seconds(chosen: Plan, workers: int) -> float:
    """Wall time of a whole run, the workers' start included."""
    folder = Path(tempfile.mkdtemp()) / "run"
    start = time.perf_counter()
    run_campaign(chosen, folder, workers=workers)
    elapsed = time.perf_counter() - start
    shutil.rmtree(folder.parent)
    return elapsed


def storage_share(chosen: Plan) -> float:
    """Time to save and merge over time to compute, one worker."""
    folder = Path(tempfile.mkdtemp()) / "run"
    start = time.perf_counter()
    store = open_store(folder, chosen)
    spent = time.perf_counter() - start
    begin = time.perf_counter()
    for result in run_local(lambda shard: run_shard(chosen, shard), store.missing(), 1):
        start = time.perf_counter()
        store.save(result)
        spent += time.perf_counter() - start
    start = time.perf_counter()
    store.merge()
    spent += time.perf_counter() - start
    whole = time.perf_counter() - begin
    shutil.rmtree(folder.parent)
    return spent / (whole - spent)


def main() -> None:
    """Print one line a figure."""
    trials = int(sys.argv[1]) if len(sys.argv) > 1 else 24
    for run, count in (("calibrate", trials), ("extract", 16 * trials)):
        chosen = plan(run, count)
        seconds(plan(run, 8), 2)  # warms compiled code and starts the worker pool
        two, one = seconds(chosen, 2), seconds(chosen, 1)
        print(
            f"{run}: {count / two:.2f} trials/s with 2 workers, {count / one:.2f} with 1, efficiency {one / two:.2f} x"
        )
    print(f"storage and resume: {100 * storage_share(plan('calibrate', trials)):.1f} % of the computing")


if __name__ == "__main__":
    main()
