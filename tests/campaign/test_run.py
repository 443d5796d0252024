"""Running a campaign: the same tables whoever computes them, resumed after kills, careful with what is in the way.

Does not prove that the trials themselves are right: the rooms' own tests do.
"""

from __future__ import annotations

import contextlib
import errno
import os
import random
import signal
import subprocess
import sys
import time
from pathlib import Path

import pyarrow.parquet as pq
import pytest

from geometry import InputError
from workbench.campaign.plan import Plan, read_plan
from workbench.campaign.remake import remake_trial
from workbench.campaign.runner import run_campaign
from workbench.campaign.store import ShardResult, open_store

PLAN = """
run = "extract"
repeats = {repeats}
shard_trials = 2
keep_images = 0.5
[base.poses]
plans = 1
[factors]
"jig.string_diameter_mm" = [0.2, 0.4]
"""


@pytest.fixture
def plan_path(tmp_path: Path) -> Path:
    path = tmp_path / "plan.toml"
    path.write_text(PLAN.format(repeats=3), encoding="utf-8")
    return path


def tables(folder: Path) -> dict[str, bytes]:
    return {name: (folder / f"{name}.parquet").read_bytes() for name in ("trials", "frames")}


def test_tables_and_images_do_not_depend_on_who_computes_them(plan_path: Path, tmp_path: Path) -> None:
    plan = read_plan(plan_path)
    one, two = tmp_path / "one", tmp_path / "two"
    run_campaign(plan, one, workers=1)
    run_campaign(plan, two, workers=2)
    assert tables(one) == tables(two)
    rows = pq.read_table(one / "trials.parquet").to_pydict()
    assert rows["trial"] == list(range(6))
    assert all(found == seen for found, seen in zip(rows["spots_found"], rows["spots_visible"], strict=True))
    kept = sorted(p.relative_to(one) for p in (one / "images").rglob("*.png"))
    assert kept
    assert kept == sorted(p.relative_to(two) for p in (two / "images").rglob("*.png"))
    for path in kept:
        remake_trial(plan_path, int(path.parent.name), tmp_path / "again")
        assert (tmp_path / "again" / path.name).read_bytes() == (one / path).read_bytes()
    assert remake_trial(one, 0, tmp_path / "from_run") == 1  # the run's own record of the plan serves as well


def test_dask_gives_the_same_tables(plan_path: Path, tmp_path: Path) -> None:
    distributed = pytest.importorskip("distributed", reason="the campaign extra is not installed")
    plan = read_plan(plan_path)
    run_campaign(plan, tmp_path / "local", workers=1)
    with distributed.LocalCluster(
        n_workers=2, threads_per_worker=1, processes=True, dashboard_address=None, silence_logs=50
    ) as cluster:
        run_campaign(plan, tmp_path / "dask", dask=cluster.scheduler_address)
    assert tables(tmp_path / "local") == tables(tmp_path / "dask")


def test_a_finished_run_is_not_run_again(plan_path: Path, tmp_path: Path) -> None:
    plan = read_plan(plan_path)
    first = run_campaign(plan, tmp_path / "run", workers=1)
    again = run_campaign(plan, tmp_path / "run", workers=1)
    assert (first.resumed, again.resumed) == (0, 6)


def test_a_folder_of_another_plan_or_of_something_else_is_left_alone(plan_path: Path, tmp_path: Path) -> None:
    open_store(tmp_path / "run", read_plan(plan_path))
    before = (tmp_path / "run" / "run.json").read_bytes()
    changed = Plan.model_validate({"run": "extract", "repeats": 99})
    with pytest.raises(InputError, match="another plan"):
        run_campaign(changed, tmp_path / "run")
    assert (tmp_path / "run" / "run.json").read_bytes() == before
    (tmp_path / "mine").mkdir()
    (tmp_path / "mine" / "thesis.txt").write_text("years of work", encoding="utf-8")
    with pytest.raises(InputError, match="not empty"):
        run_campaign(changed, tmp_path / "mine")
    assert [p.name for p in (tmp_path / "mine").iterdir()] == ["thesis.txt"]


def test_a_dead_scheduler_is_one_sentence(plan_path: Path, tmp_path: Path) -> None:
    pytest.importorskip("distributed", reason="the campaign extra is not installed")
    with pytest.raises(InputError, match=r"no Dask scheduler answers at tcp://127\.0\.0\.1:9"):
        run_campaign(read_plan(plan_path), tmp_path / "run", dask="tcp://127.0.0.1:9")


def test_a_full_disk_is_one_sentence_and_costs_no_finished_shard(
    plan_path: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    store = open_store(tmp_path / "run", read_plan(plan_path))
    store.save(ShardResult(0, {"trials": b"whole"}, {}))

    def full(_: int) -> None:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(os, "fsync", full)
    with pytest.raises(InputError, match=r"No space left.*1 of 3 shards are safe"):
        store.save(ShardResult(1, {"trials": b"never"}, {}))
    assert store.missing() == [1, 2]
    assert (tmp_path / "run" / "shards" / "000000" / "trials.parquet").read_bytes() == b"whole"


@pytest.mark.slow
def test_a_hundred_kills_end_with_the_same_table(tmp_path: Path) -> None:
    plan = tmp_path / "plan.toml"
    plan.write_text(PLAN.format(repeats=120), encoding="utf-8")
    run_campaign(read_plan(plan), tmp_path / "calm", workers=2)
    command = [
        sys.executable,
        "-m",
        "workbench",
        "sweep",
        str(plan),
        "--out",
        str(tmp_path / "killed"),
        "--workers",
        "2",
    ]
    rng = random.Random(5)  # noqa: S311 - moments of death, not secrets
    kills = 0
    for _ in range(400):
        process = subprocess.Popen(
            command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, start_new_session=True
        )
        patience = rng.uniform(0.5, 9.0) if kills < 100 else 600.0
        try:
            assert process.wait(patience) == 0
        except subprocess.TimeoutExpired:
            victims = _children(process.pid) if rng.random() < 0.3 else [process.pid]
            for pid in victims[:1]:
                os.kill(pid, signal.SIGKILL)
            kills += 1
            time.sleep(0.2)
            _end(process)
            continue
        if kills >= 100:
            break
        (tmp_path / "killed" / "trials.parquet").unlink()
        for shard in list((tmp_path / "killed" / "shards").iterdir())[::3]:  # it was done too soon: take a third away
            for file in shard.iterdir():
                file.unlink()
            shard.rmdir()
    assert kills >= 100
    assert tables(tmp_path / "calm") == tables(tmp_path / "killed")


def _children(pid: int) -> list[int]:
    listed = subprocess.run(["pgrep", "-P", str(pid)], capture_output=True, text=True, check=False).stdout.split()
    return [int(p) for p in listed] or [pid]


def _end(process: subprocess.Popen[bytes]) -> None:
    with contextlib.suppress(ProcessLookupError):
        os.killpg(process.pid, signal.SIGKILL)
    process.wait(30)
