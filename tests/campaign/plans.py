"""A small plan and what the tests of campaigns ask of a run's folder."""

from __future__ import annotations

import contextlib
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

PLAN = """
run = "extract"
repeats = {repeats}
shard_trials = 2
keep_images = {keep}
[base.poses]
plans = 1
locations = 1
per_location = 3
[factors]
"jig.string_diameter_mm" = [0.2, 0.4]
"""


def write_plan(path: Path, repeats: int = 3, keep: float = 0.5) -> Path:
    path.write_text(PLAN.format(repeats=repeats, keep=keep), encoding="utf-8")
    return path


def tables(folder: Path) -> dict[str, bytes]:
    """The tables that must be the same bytes whoever computed them."""
    return {name: (folder / f"{name}.parquet").read_bytes() for name in ("trials", "frames")}


def start_sweep(plan: Path, out: Path, workers: int = 2) -> subprocess.Popen[str]:
    """The command in a process group of its own, as a terminal starts it.

    A shell lets its background jobs ignore Ctrl-C, and children inherit that: it would hold for the sweep, too.
    """
    command = [sys.executable, "-m", "workbench", "sweep", str(plan), "--out", str(out), "--workers", str(workers)]
    return subprocess.Popen(
        command, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True, start_new_session=True,
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),
    )  # fmt: skip


def shards_of(out: Path) -> list[Path]:
    """The finished shards."""
    return sorted((out / "shards").iterdir()) if (out / "shards").is_dir() else []


def wait_until(what: object, seconds: float = 120.0) -> None:
    """Wait until ``what()`` is true."""
    end = time.monotonic() + seconds
    while not what():  # type: ignore[operator]
        assert time.monotonic() < end, "it did not come to pass in time"
        time.sleep(0.05)


def group(leader: int) -> list[int]:
    """The living processes of the group led by ``leader``."""
    listed = subprocess.run(["ps", "-eo", "pid=,pgid=,stat="], capture_output=True, text=True, check=True).stdout
    rows = [line.split() for line in listed.splitlines()]
    return [int(pid) for pid, pgid, state in rows if int(pgid) == leader and not state.startswith("Z")]


def end(process: subprocess.Popen[str]) -> None:
    """Nothing of the group stays."""
    with contextlib.suppress(ProcessLookupError):
        os.killpg(process.pid, signal.SIGKILL)
    process.communicate(timeout=60)
