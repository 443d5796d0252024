"""Memory of a long campaign: resident megabytes of the parent and of its workers while extraction trials are run.

Every trial is one frame of 1280 × 1024 with the full camera, rendered, extracted and labelled; string diameter and
ambient light vary from point to point. Printed at each twentieth of the run; flat means that what a tenth of the trials
added is not added again by the rest.
Run: python benchmarks/campaign_memory.py [trials, default 10000] [workers, default 2]
"""

from __future__ import annotations

import os
import shutil
import sys
import tempfile
from pathlib import Path

import numpy as np
import psutil

from workbench.campaign import Plan, run_campaign

MEGA = 2**20


def plan(trials: int) -> Plan:
    """Random diameters and light, so that nothing can be remembered from one trial to the next."""
    factors = {
        "jig.string_diameter_mm": {"low": 0.2, "high": 0.5},
        "emulator.ambient.irradiance_mw_m2_nm": {"low": 2.0, "high": 20.0},
    }
    return Plan.model_validate(
        {"run": "extract", "design": "random", "samples": trials, "shard_trials": 10, "factors": factors}
    )


def main() -> None:
    """Print the table and the growth from the first tenth to the end."""
    trials = int(sys.argv[1]) if len(sys.argv) > 1 else 10_000
    workers = int(sys.argv[2]) if len(sys.argv) > 2 else 2
    folder = Path(tempfile.mkdtemp()) / "run"
    me = psutil.Process(os.getpid())
    rows: list[tuple[int, float, float]] = []

    def progress(done: int, total: int) -> None:
        if done and done * 20 // total > len(rows) - 1 + (not rows):
            living = [p.memory_info().rss / MEGA for p in me.children(recursive=True) if p.is_running()]
            rows.append((done, me.memory_info().rss / MEGA, max(living, default=0.0)))
            print("{:6d} trials: parent {:6.1f} MB, largest worker {:6.1f} MB".format(*rows[-1]), flush=True)

    run_campaign(plan(trials), folder, workers, progress=progress)
    table = np.array([r for r in rows if r[0] >= trials / 10])
    parent, worker = table[-1, 1:] - table[0, 1:]
    print(f"from a tenth on: parent {parent:+.1f} MB, largest worker {worker:+.1f} MB")
    merged = sum(path.stat().st_size for path in folder.glob("*.parquet")) / MEGA
    print(f"after merging {merged:.1f} MB of tables: parent {me.memory_info().rss / MEGA:.1f} MB")
    shutil.rmtree(folder.parent)


if __name__ == "__main__":
    main()
