"""Campaign speed: trials per second, two workers against one, and what storage and resuming cost.

Complete trials of 3 × 7 frames of 1280 × 1024 with the full camera, and extraction-only trials of one frame. Rates are
of steady work: from the first finished shard on, as start-up and planning are paid once in a long run. Beside the wall
clock stand the workers' CPU seconds a trial: where other programs share the cores, 2 / CPU is what two free ones would
give. Efficiency is the rate of two workers over that of one, and the same by CPU: 2 × (CPU with one) / (CPU with two).
"Parent" is all that the parent process computes (hand out, store, log, merge) over what the workers compute, and
"resume" is opening and merging the finished run again.
Run: python benchmarks/campaign_speed.py [complete trials, default 24] [rounds, default 3]
or: python benchmarks/campaign_speed.py stages: processor time of the stages of complete trials in this process, the
least of eight, which other programs on the machine lengthen least.
"""

from __future__ import annotations

import resource
import shutil
import sys
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path
from types import SimpleNamespace

import numpy as np

import workbench.campaign.trial.trial as trial_stages
from workbench.campaign import Plan, end_warm_server, run_campaign
from workbench.campaign.trial.emulated import know_plans
from workbench.campaign.work.shard import plans_to_send, run_one
from workbench.campaign.work.worker import one_thread

SHARD = {"calibrate": 2, "extract": 16}
STAGED = 8  # trials whose stages are measured
PER_COMPLETE = 16  # extraction trials for each complete one


@dataclass(frozen=True)
class Speed:
    """Steady trials a second, the workers' CPU seconds a trial, the parent's share of CPU, seconds to resume."""

    rate: float
    cpu_s: float
    parent: float
    resume_s: float


def plan(run: str, trials: int) -> Plan:
    """Trials of the default cell with one plan of configurations."""
    return Plan.model_validate(
        {"run": run, "repeats": trials, "shard_trials": SHARD[run], "base": {"poses": {"plans": 1}}}
    )


def children_s() -> float:
    """CPU seconds of the processes that ended."""
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


def measured(chosen: Plan, workers: int, start_cpu_s: float = 0.0) -> Speed:
    """One whole run. start_cpu_s: what the server that workers are forked from spends with the first of them."""
    folder = Path(tempfile.mkdtemp()) / "run"
    marks: list[tuple[float, int]] = []
    before, own = children_s(), time.process_time()
    run_campaign(chosen, folder, workers=workers, progress=lambda done, _: marks.append((time.perf_counter(), done)))
    end_warm_server()
    cpu, own = children_s() - before, time.process_time() - own
    start = time.perf_counter()
    run_campaign(chosen, folder, workers=workers)
    resume_s = time.perf_counter() - start
    shutil.rmtree(folder.parent)
    (first, some), (last, all_done) = marks[workers], marks[-1]
    work = cpu - start_cpu_s
    rate = (all_done - some) / (last - first) if last > first else float("nan")
    return Speed(rate, work / all_done, own / cpu, resume_s)


def start_cpu(run: str) -> float:
    """CPU seconds of the server and one worker before the first trial, from runs of one shard and of three."""
    few, more = (measured(plan(run, n * SHARD[run]), 1).cpu_s * n * SHARD[run] for n in (1, 3))
    return max(0.0, few - (more - few) / 2)


def another_worker(run: str) -> float:
    """CPU seconds that a second worker adds before its first trial, from runs of two shards; the least of four."""
    few = 2 * SHARD[run]
    return min((measured(plan(run, few), 2).cpu_s - measured(plan(run, few), 1).cpu_s) * few for _ in range(4))


def stages() -> None:
    """Print the least processor time of each stage of a complete trial, in this process."""
    trial_stages.time = SimpleNamespace(perf_counter=time.process_time)
    chosen = plan("calibrate", STAGED + 1)
    one_thread()
    know_plans(plans_to_send(chosen))
    rows = [dict(run_one(chosen, trial).timings) for trial in range(STAGED + 1)][1:]  # the first loads kernels
    for name in rows[0]:
        print(f"{name.removesuffix('_s'):10s} {1000 * min(row[name] for row in rows):6.0f} CPU-ms")
    print(f"{'all':10s} {1000 * min(sum(row.values()) for row in rows):6.0f} CPU-ms")


def main() -> None:
    """Print a few lines for each kind of run."""
    if sys.argv[1:] == ["stages"]:
        stages()
        return
    trials = int(sys.argv[1]) if len(sys.argv) > 1 else 24
    rounds = int(sys.argv[2]) if len(sys.argv) > 2 else 3
    for run, count in (("calibrate", trials), ("extract", PER_COMPLETE * trials)):
        begin = start_cpu(run)
        ones, twos = [], []
        for _ in range(rounds):
            ones.append(measured(plan(run, count), 1, begin))
            twos.append(measured(plan(run, count), 2, begin))
        show(run, count, begin, ones, twos)


def show(run: str, count: int, begin: float, ones: list[Speed], twos: list[Speed]) -> None:
    """Print the medians of one kind of run."""
    ratios = [b.rate / a.rate for a, b in zip(ones, twos, strict=True)]
    by_cpu = np.median([2 * a.cpu_s / b.cpu_s for a, b in zip(ones, twos, strict=True)])
    one = np.median([s.rate for s in ones])
    two, cpu, parent, again = np.median([(s.rate, s.cpu_s, s.parent, s.resume_s) for s in twos], axis=0)
    print(f"{run}, {count} trials, medians of {len(twos)} rounds:")
    print(f"  2 workers {two:.2f} trials/s, 1 worker {one:.2f}")
    print(f"  CPU {1000 * cpu:.0f} ms a trial: two free cores would give {2 / cpu:.2f} trials/s")
    print(f"  efficiency {np.median(ratios):.2f} x by the clock ({', '.join(f'{r:.2f}' for r in ratios)})")
    print(f"  efficiency {by_cpu:.2f} x by CPU")
    print(f"  parent {100 * parent:.1f} % of the workers' CPU, resume {again:.2f} s")
    print(f"  start of the server {begin:.1f} CPU-s, of another worker {another_worker(run):.2f}")


if __name__ == "__main__":
    main()
