"""A run that is stopped, killed, short of disk or tampered with: resumable, never wrong, and one sentence.

Does not prove that data reach the platters: only power loss would.
"""

from __future__ import annotations

import errno
import os
import random
import resource
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from geometry import InputError
from tests.campaign.plans import end, group, shards_of, start_sweep, tables, wait_until, write_plan
from workbench.campaign import Plan, read_plan, read_run, run_campaign
from workbench.campaign.store.store import ShardResult, opened_store
from workbench.campaign.work.trusted import check_cache

pytestmark = pytest.mark.processes
KILLS = 100


@pytest.fixture
def plan_path(tmp_path: Path) -> Path:
    return write_plan(tmp_path / "plan.toml")


def test_interrupted_is_resumable_and_said_so(tmp_path: Path) -> None:
    """Ctrl-C reaches the whole group, as on a terminal."""
    plan, out = write_plan(tmp_path / "plan.toml", repeats=200), tmp_path / "run"
    process = start_sweep(plan, out, workers=1)
    try:
        wait_until(lambda: shards_of(out))
        os.killpg(process.pid, signal.SIGINT)
        _, said = process.communicate(timeout=60)
        assert process.returncode == 130
        assert "trials are safe" in said
        assert "the same command goes on" in said
        assert len(said.strip().splitlines()) == 1
        wait_until(lambda: not group(process.pid), 20)
    finally:
        end(process)
    with opened_store(out, read_plan(plan)) as store:
        assert 0 < len(store.missing()) < store.shards


@pytest.mark.skipif(sys.platform != "linux", reason="elsewhere workers are spawned")
def test_ctrl_c_while_workers_are_being_started_is_one_line(tmp_path: Path) -> None:
    """The server that they are forked from is still importing."""
    process = start_sweep(write_plan(tmp_path / "plan.toml", repeats=200), tmp_path / "run", workers=1)
    try:
        wait_until(lambda: len(group(process.pid)) > 2)  # the command, who tidies up, the server
        time.sleep(0.3)
        os.killpg(process.pid, signal.SIGINT)
        _, said = process.communicate(timeout=60)
        assert process.returncode == 130
        assert len(said.strip().splitlines()) == 1
    finally:
        end(process)


def test_what_ctrl_c_caught_half_removed_is_tidied_up_in_silence() -> None:
    """A semaphore that is gone when the tidying process looks for it, as after Ctrl-C within its removal."""
    half_removed = (
        "from workbench.campaign.work.engines import _pool\n"
        "from multiprocessing import resource_tracker\n"
        "if __name__ == '__main__':\n"
        "    pool = _pool(1)\n"
        "    pool.submit(abs, -3).result()\n"
        "    resource_tracker.register('/loky-gone-already', 'semaphore')\n"
        "    pool.shutdown(wait=True, kill_workers=True)\n"
        "    tracker = resource_tracker._resource_tracker\n"
        "    print(tracker._pid)\n"
    )
    done = subprocess.run([sys.executable, "-c", half_removed], capture_output=True, text=True, timeout=60, check=False)
    assert int(done.stdout) > 0  # both pipes are at their end: the tidying process is over, too
    assert done.stderr == ""


def test_a_killed_parent_leaves_no_workers_and_no_lock(tmp_path: Path) -> None:
    plan, out = write_plan(tmp_path / "plan.toml", repeats=200), tmp_path / "run"
    process = start_sweep(plan, out)
    try:
        wait_until(lambda: shards_of(out))
        assert len(group(process.pid)) > 2
        with pytest.raises(InputError, match="another sweep runs in this folder"):
            run_campaign(read_plan(plan), out)
        process.kill()
        process.wait(30)
        wait_until(lambda: not group(process.pid), 20)
    finally:
        end(process)
    with opened_store(out, read_plan(plan)) as store:
        assert store.missing()


def test_a_folder_of_another_plan_or_of_something_else_is_left_alone(plan_path: Path, tmp_path: Path) -> None:
    with opened_store(tmp_path / "run", read_plan(plan_path)):
        pass
    before = (tmp_path / "run" / "run.json").read_bytes()
    changed = Plan.model_validate({"run": "extract", "repeats": 99})
    with pytest.raises(InputError, match="another plan"):
        run_campaign(changed, tmp_path / "run")
    assert (tmp_path / "run" / "run.json").read_bytes() == before
    (tmp_path / "mine").mkdir()
    (tmp_path / "mine" / "thesis.txt").write_text("years of work", encoding="utf-8")
    with pytest.raises(InputError, match="not an empty folder"):
        run_campaign(changed, tmp_path / "mine")
    assert [p.name for p in (tmp_path / "mine").iterdir()] == ["thesis.txt"]


@pytest.mark.parametrize("text", ["", "{", "[]", '{"fingerprint": 1}', '{"fingerprint": 1, "trials": 1, "plan": []}'])
def test_a_corrupt_record_is_refused_and_kept(plan_path: Path, tmp_path: Path, text: str) -> None:
    manifest = tmp_path / "run" / "run.json"
    manifest.parent.mkdir()
    manifest.write_text(text, encoding="utf-8")
    for use in (lambda: run_campaign(read_plan(plan_path), manifest.parent), lambda: read_run(manifest.parent)):
        with pytest.raises(InputError):
            use()
    assert manifest.read_text(encoding="utf-8") == text


def test_a_run_killed_before_its_record_stood_is_begun_again(plan_path: Path, tmp_path: Path) -> None:
    (tmp_path / "run").mkdir()
    (tmp_path / "run" / "run.lock").touch()
    (tmp_path / "run" / ".run.json.abc.part").write_text("{", encoding="utf-8")
    with opened_store(tmp_path / "run", read_plan(plan_path)) as store:
        assert store.missing() == [0, 1, 2]


@pytest.mark.parametrize("table", ["trials", "frames"])
@pytest.mark.parametrize("harm", ["cut", "empty", "gone", "bit"])
def test_a_damaged_shard_is_named_and_nothing_overwritten(
    small_run: Path, tmp_path: Path, table: str, harm: str
) -> None:
    folder = tmp_path / "run"
    subprocess.run(["cp", "-r", str(small_run), str(folder)], check=True)
    before = tables(folder)
    shard = folder / "shards" / "000001" / f"{table}.parquet"
    whole = shard.read_bytes()
    if harm == "gone":
        shard.unlink()
    else:
        flipped = whole[:60] + bytes([whole[60] ^ 0xFF]) + whole[61:]
        shard.write_bytes({"cut": whole[: len(whole) // 2], "empty": b"", "bit": flipped}[harm])
    with pytest.raises(InputError, match=r"000001: this finished shard is damaged; take the folder away"):
        run_campaign(read_plan(small_run.parent / "plan.toml"), folder, workers=1)
    assert tables(folder) == before


def test_a_full_disk_is_one_sentence_and_costs_no_finished_shard(
    plan_path: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    with opened_store(tmp_path / "run", read_plan(plan_path)) as store:
        store.save(ShardResult(0, {"trials": b"whole"}, {}))

        def full(_: int) -> None:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

        monkeypatch.setattr(os, "fsync", full)
        with pytest.raises(InputError, match=r"No space left.*1 of 3 shards are safe"):
            store.save(ShardResult(1, {"trials": b"never"}, {}))
        assert store.missing() == [1, 2]
        assert (tmp_path / "run" / "shards" / "000000" / "trials.parquet").read_bytes() == b"whole"


@pytest.mark.slow
def test_no_room_for_the_merged_tables_or_the_page_is_one_sentence(small_run: Path, tmp_path: Path) -> None:
    """The system refuses files beyond a size, as a quota does."""
    folder = tmp_path / "run"
    subprocess.run(["cp", "-r", str(small_run), str(folder)], check=True)
    before = tables(folder)
    largest = max(p.stat().st_size for p in folder.glob("shards/*/*.parquet"))

    def command(*arguments: object, size: int) -> subprocess.CompletedProcess[str]:
        limit = lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (size, size))  # noqa: E731
        line = [sys.executable, "-m", "workbench", *map(str, arguments)]
        return subprocess.run(line, capture_output=True, text=True, check=False, preexec_fn=limit)

    for text, done in (
        ("all shards are safe", command("sweep", small_run.parent / "plan.toml", "--out", folder, size=largest)),
        ("report.html: can not be written", command("report", folder, size=largest)),
    ):
        assert done.returncode == 2, done.stderr
        assert text in done.stderr
        assert len(done.stderr.strip().splitlines()) == 1
    assert tables(folder) == before
    assert not list((folder / "parts").iterdir())


@pytest.mark.slow
def test_a_hundred_kills_end_with_the_same_table(tmp_path: Path) -> None:
    """SIGKILL at random moments of start-up and work, to the parent or a process of its group; the run goes on."""
    plan = write_plan(tmp_path / "plan.toml", repeats=150, keep=0.02)
    calm, out = tmp_path / "calm", tmp_path / "killed"
    start = time.monotonic()
    process = start_sweep(plan, calm)
    try:
        wait_until(lambda: shards_of(calm), 600)
        begin = time.monotonic() - start  # seconds to the first finished shard, on this machine
        assert process.wait(1800) == 0
    finally:
        end(process)
    rng = random.Random(5)  # noqa: S311 - moments of death, not secrets
    kills, parents, starts = 0, 0, 0
    while kills < KILLS:
        process, starts = start_sweep(plan, out), starts + 1
        try:
            while kills < KILLS and process.poll() is None:
                stood = {p: p.read_bytes() for p in out.glob("shards/*/*.parquet")}
                try:
                    process.wait(rng.uniform(0.05, 0.8 * begin))
                except subprocess.TimeoutExpired:
                    victim = rng.choice(group(process.pid))
                    kills, parents = kills + 1, parents + (victim == process.pid)
                    os.kill(victim, signal.SIGKILL)
                assert all(path.read_bytes() == whole for path, whole in stood.items())
            if process.poll() == 0:  # it was done too soon: take a third of its shards away
                for shard in shards_of(out)[::3]:
                    shutil.rmtree(shard)
            elif kills < KILLS:
                wait_until(lambda leader=process.pid: not group(leader), 60)  # no orphan lives on
        finally:
            end(process)
    assert run_campaign(read_plan(plan), out, workers=2).resumed > 0
    (tmp_path / "kills.txt").write_text(f"{kills} kills, {parents} of the parent, {starts} starts, {begin:.1f} s\n")
    assert parents >= 0.1 * KILLS
    assert tables(calm) == tables(out)
    kept = sorted(p.relative_to(out) for p in (out / "images").rglob("*"))
    assert kept == sorted(p.relative_to(calm) for p in (calm / "images").rglob("*"))
    assert all((out / p).read_bytes() == (calm / p).read_bytes() for p in kept if p.suffix == ".png")


def test_a_changed_robot_file_is_another_campaign(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The plan's text is the same; a URDF that its robot names counts too."""
    monkeypatch.chdir(tmp_path)
    link = '<link name="{0}"/>'
    ends = '<parent link="a"/><child link="b"/><axis xyz="0 0 1"/>'
    joint = f'<joint name="j" type="revolute">{ends}<origin xyz="{{0}} 0 0"/></joint>'
    arm = '<robot name="r">' + link.format("a") + link.format("b") + joint + "</robot>"
    Path("arm.urdf").write_text(arm.format(0.1))
    Path("robot.toml").write_text('urdf = "arm.urdf"\nbase = "a"\ntip = "b"\n')
    Path("plan.toml").write_text('[base.robot]\npreset = "robot.toml"\n')
    with opened_store(tmp_path / "run", read_plan(Path("plan.toml"))):
        pass
    with opened_store(tmp_path / "run", read_plan(Path("plan.toml"))):
        pass
    Path("arm.urdf").write_text(arm.format(0.2))
    with (
        pytest.raises(InputError, match=r"robot\.preset = robot\.toml was changed since"),
        opened_store(tmp_path / "run", read_plan(Path("plan.toml"))),
    ):
        pass


@pytest.mark.skipif(sys.platform == "win32", reason="rights are told in another way there")
def test_a_cache_that_others_can_write_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Before the folder of the run is made."""
    plan = tmp_path / "plan.toml"
    plan.write_text("seed = 1\n")
    cache = tmp_path / "cache"
    cache.mkdir()
    cache.chmod(0o777)
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(cache))
    with pytest.raises(InputError, match="everybody can write there"):
        run_campaign(read_plan(plan), tmp_path / "run", workers=1)
    assert not (tmp_path / "run").exists()
    cache.chmod(0o755)
    check_cache()
