"""Running a campaign: the same tables whoever computes them, on no more cores than asked for.

Does not prove that the trials themselves are right: the rooms' own tests do.
"""

from __future__ import annotations

import json
import pickle
import sys
import threading
from functools import partial
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
import pytest

from tests.campaign.plans import tables
from workbench.campaign import Plan, read_plan, remake_trial, run_campaign
from workbench.campaign.store.store import ShardResult
from workbench.campaign.trial import emulated
from workbench.campaign.work.engines import run_local
from workbench.campaign.work.shard import plans_to_send, run_shard


def test_tables_and_images_do_not_depend_on_who_computes_them(small_run: Path, tmp_path: Path) -> None:
    plan_path = small_run.parent / "plan.toml"
    one, two = small_run, tmp_path / "two"
    run_campaign(read_plan(plan_path), two, workers=2)
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


def test_a_finished_run_is_not_run_again(small_run: Path) -> None:
    before = {p: p.read_bytes() for p in small_run.rglob("*.parquet")}
    again = run_campaign(read_plan(small_run.parent / "plan.toml"), small_run, workers=1)
    assert again.resumed == again.trials == 6
    assert {p: p.read_bytes() for p in small_run.rglob("*.parquet")} == before


def threads_after(plan_path: Path, shard: int) -> ShardResult:
    """A shard's usual work and heavy BLAS and OpenCV calls; then the system's threads beyond Python's own."""
    import cv2

    run_shard(read_plan(plan_path), shard)
    big = np.ones((1500, 1500))
    cv2.GaussianBlur(big @ big, (31, 31), 3)
    cv2.resize(big, None, fx=2, fy=2)
    names = [(task / "comm").read_text().strip() for task in Path("/proc/self/task").iterdir()]
    native = (
        sum(not name.startswith("jemalloc") for name in names) - threading.active_count()
    )  # its sweeper computes not
    return ShardResult(shard, {"native": json.dumps(native).encode()}, {})


@pytest.mark.skipif(sys.platform != "linux", reason="threads are counted in /proc")
def test_a_worker_takes_one_core(small_run: Path) -> None:
    """Neither BLAS nor OpenCV nor numba has a pool of threads beside the worker's own."""
    results = list(run_local(partial(threads_after, small_run.parent / "plan.toml"), [0], 1))
    assert [json.loads(r.tables["native"]) for r in results] == [0]


def what_is_there(plan_path: Path, shard: int) -> ShardResult:
    """The main module of a worker, and whether the server that it was forked from had loaded what it needs."""
    main = getattr(sys.modules["__main__"], "__file__", None) or ""
    found = {"main": main, "loaded": "workbench.campaign.work.loaded" in sys.modules, "plan": plan_path.name}
    return ShardResult(shard, {"found": json.dumps(found).encode()}, {})


@pytest.mark.skipif(sys.platform != "linux", reason="elsewhere workers are spawned")
def test_workers_are_forked_warm_and_do_not_run_the_caller_s_script(small_run: Path) -> None:
    results = run_local(partial(what_is_there, small_run.parent / "plan.toml"), [0, 1], 2)
    found = [json.loads(r.tables["found"]) for r in results]
    assert [f["loaded"] for f in found] == [True, True]
    assert all(Path(f["main"]).name not in ("pytest", "__main__.py") for f in found)


def test_workers_use_the_plans_of_views_that_they_are_sent(monkeypatch: pytest.MonkeyPatch) -> None:
    """The rows are the same bytes, and nothing is planned anew; what a factor changes can not be sent."""
    asked = {"run": "extract", "repeats": 2, "base": {"poses": {"plans": 1, "locations": 1, "per_location": 3}}}
    plan = Plan.model_validate(asked)
    own, sent = run_shard(plan, 0), pickle.loads(pickle.dumps(plans_to_send(plan)))  # noqa: S301 - our own
    assert len(sent) == 1
    monkeypatch.setattr(emulated, "_known", {})
    monkeypatch.setattr(emulated, "_planned", lambda *_: pytest.fail("planned anew"))
    other = run_shard(plan, 0, sent)
    assert all(own.tables[name] == other.tables[name] for name in ("trials", "frames"))
    varied = Plan.model_validate(asked | {"factors": {"jig.string_diameter_mm": [0.2, 0.4]}})
    assert plans_to_send(varied) == {}
