"""A real Dask cluster of several worker processes on this machine: the same bytes, also when one of them is killed."""

from __future__ import annotations

import os
import signal
import socket
import subprocess
import sys
from collections.abc import Iterator
from contextlib import closing
from pathlib import Path

import pytest

from geometry import InputError
from tests.campaign.plans import shards_of, tables, write_plan
from workbench.campaign import read_plan, run_campaign

distributed = pytest.importorskip("distributed", reason="the campaign extra is not installed")

pytestmark = pytest.mark.processes

QUIET = {
    "DASK_DISTRIBUTED__DIAGNOSTICS__NVML": "False",
    "DASK_DISTRIBUTED__ADMIN__LARGE_GRAPH_WARNING_THRESHOLD": "1GB",
}


class Cluster:
    """A scheduler and its workers, started by the commands that the documentation names."""

    def __init__(self, folder: Path, environment: dict[str, str] | None = None) -> None:
        with closing(socket.socket()) as free:
            free.bind(("127.0.0.1", 0))
            self.address = f"tcp://127.0.0.1:{free.getsockname()[1]}"
        self._folder, self._environment = folder, {**os.environ, **QUIET, **(environment or {})}
        port = self.address.rsplit(":", 1)[1]
        self.scheduler = self._dask("scheduler", "--host", "127.0.0.1", "--port", port, "--no-dashboard")
        self.workers: list[subprocess.Popen[bytes]] = []

    def add_workers(self, count: int) -> None:
        """Start workers of one thread and wait for them."""
        for _ in range(count):
            self.workers.append(self._dask("worker", self.address, "--nthreads", "1", "--no-dashboard"))
        with distributed.Client(self.address, timeout=60, set_as_default=False) as client:
            client.wait_for_workers(count, timeout=120)

    def compute_pids(self) -> list[int]:
        """The processes that compute, which their nannies watch over."""
        with distributed.Client(self.address, timeout=60, set_as_default=False) as client:
            return list(client.run(os.getpid).values())

    def close(self) -> None:
        """End everything."""
        for process in (*self.workers, self.scheduler):
            process.terminate()
        for process in (*self.workers, self.scheduler):
            try:
                process.wait(20)
            except subprocess.TimeoutExpired:
                process.kill()
                process.wait(20)

    def _dask(self, *arguments: str) -> subprocess.Popen[bytes]:
        log = (self._folder / "dask.log").open("ab")
        with log:
            return subprocess.Popen(
                [sys.executable, "-m", "dask", *arguments],
                stdout=log,
                stderr=log,
                env=self._environment,
                cwd=Path.cwd(),
            )


@pytest.fixture(scope="module")
def cluster(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Cluster]:
    """One for the tests that leave it alive, in the order of the file: without workers, then with two."""
    made = Cluster(tmp_path_factory.mktemp("cluster"))
    yield made
    made.close()


@pytest.fixture
def short_lived(tmp_path: Path) -> Iterator[Cluster]:
    """One that a test may kill."""
    made = Cluster(tmp_path)
    yield made
    made.close()


@pytest.mark.slow
def test_a_scheduler_without_workers_is_one_sentence(
    small_run: Path, tmp_path: Path, cluster: Cluster, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("workbench.campaign.work.engines.NO_WORKER_S", 0.5)
    wait = distributed.Client(cluster.address, timeout=60, set_as_default=False)  # until the scheduler stands
    wait.close()
    with pytest.raises(InputError, match="has no workers: start some with `dask worker"):
        run_campaign(read_plan(small_run.parent / "plan.toml"), tmp_path / "run", dask=cluster.address)


@pytest.mark.slow
def test_a_cluster_gives_the_same_tables(small_run: Path, tmp_path: Path, cluster: Cluster) -> None:
    cluster.add_workers(2)
    run_campaign(read_plan(small_run.parent / "plan.toml"), tmp_path / "dask", dask=cluster.address)
    assert tables(small_run) == tables(tmp_path / "dask")
    kept = sorted(p.relative_to(small_run) for p in (small_run / "images").rglob("*.png"))
    assert all((tmp_path / "dask" / p).read_bytes() == (small_run / p).read_bytes() for p in kept)


@pytest.mark.slow
def test_a_worker_killed_and_a_scheduler_killed(tmp_path: Path, short_lived: Cluster) -> None:
    """The worker's death changes nothing; the scheduler's ends the run with a sentence, and it goes on elsewhere."""
    plan = read_plan(write_plan(tmp_path / "plan.toml", repeats=60, keep=0.0))
    run_campaign(plan, tmp_path / "calm", workers=2)
    short_lived.add_workers(2)
    out, killed = tmp_path / "run", []

    def progress(done: int, total: int) -> None:
        if done >= 0.2 * total and not killed:
            killed.append(short_lived.compute_pids()[0])
            os.kill(killed[0], signal.SIGKILL)
        if done >= 0.6 * total and short_lived.scheduler.poll() is None:
            short_lived.scheduler.kill()

    with pytest.raises(
        InputError, match=r"the Dask scheduler at tcp://127.0.0.1:\d+ is gone; what is finished is safe"
    ):
        run_campaign(plan, out, dask=short_lived.address, progress=progress)
    assert killed
    assert 36 <= len(shards_of(out)) < 60
    run_campaign(plan, out, workers=2)
    assert tables(tmp_path / "calm") == tables(out)


def test_a_dead_scheduler_is_one_sentence(small_run: Path, tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"no Dask scheduler answers at tcp://127\.0\.0\.1:9"):
        run_campaign(read_plan(small_run.parent / "plan.toml"), tmp_path / "run", dask="tcp://127.0.0.1:9")


@pytest.mark.slow
def test_a_worker_with_loose_threads_is_refused(small_run: Path, tmp_path: Path) -> None:
    loose = Cluster(tmp_path, {"OPENBLAS_NUM_THREADS": "2"})
    try:
        loose.add_workers(1)
        with pytest.raises(InputError, match="start it with OMP_NUM_THREADS=1"):
            run_campaign(read_plan(small_run.parent / "plan.toml"), tmp_path / "run", dask=loose.address)
    finally:
        loose.close()
