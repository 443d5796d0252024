"""Who computes the shards: processes of this machine (joblib's loky) or the workers of a Dask cluster."""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Iterator
from itertools import islice
from typing import Any
from uuid import uuid4

from geometry import InputError, MissingDependencyError
from workbench.campaign.store.store import ShardResult
from workbench.campaign.work.warm import helpers_environment, warm_server
from workbench.campaign.work.worker import ONE_THREAD, begin_worker, worker_state

Work = Callable[[int], ShardResult]
MAX_DEATHS_WITHOUT_PROGRESS = 5  # of workers: more is no accident but the machine or the plan
AHEAD = 2  # shards handed out for each worker: the one in work and the next
NO_WORKER_S = 60.0  # a cluster whose workers do not come by then is not there
SETTLE_S = 2.0  # given to workers that join late before shards are dealt out


def run_local(work: Work, shards: list[int], workers: int) -> Iterator[ShardResult]:
    """Shards in any order from ``workers`` processes of one thread each; a worker that dies costs what was in flight,
    which is redone. The processes end when the iterator is closed, or when this process dies.
    """
    _require("joblib")
    from joblib.externals.loky.process_executor import BrokenProcessPool

    todo, deaths = dict.fromkeys(shards), 0
    while todo:
        count = min(workers, len(todo))
        pool = _pool(count)
        try:
            for result in _windowed(pool.submit, work, list(todo), AHEAD * count):
                del todo[result.shard]
                deaths = 0
                yield result
        except BrokenProcessPool:
            deaths += 1
            if deaths >= MAX_DEATHS_WITHOUT_PROGRESS:
                raise InputError(
                    f"a worker process was killed {deaths} times in a row without a shard done: it may lack memory, "
                    "take fewer --workers or a smaller shard_trials"
                ) from None
        finally:
            pool.shutdown(wait=True, kill_workers=True)


def _pool(workers: int) -> Any:
    from joblib.externals.loky import ProcessPoolExecutor

    begin: dict[str, Any] = {"initializer": begin_worker, "initargs": (os.getpid(),), "env": ONE_THREAD}
    with helpers_environment():
        return ProcessPoolExecutor(workers, context=warm_server(), **begin)


def _windowed(submit: Any, work: Work, shards: list[int], window: int) -> Iterator[ShardResult]:
    """Results as they come, never more than ``window`` shards handed out: none waits here for the disk."""
    from concurrent.futures import FIRST_COMPLETED, wait

    ahead = iter(shards)
    running = {submit(work, shard) for shard in islice(ahead, window)}
    try:
        while running:
            done, running = wait(running, return_when=FIRST_COMPLETED)
            for future in sorted(done, key=lambda f: f.exception() is not None):  # what is whole is taken first
                result = future.result()
                running |= {submit(work, shard) for shard in islice(ahead, 1)}
                yield result
    finally:
        _settle(running)


def _settle(futures: set[Any]) -> None:
    """Wait a moment until the pool has taken what it was handed: loky stumbles over what it finds when shut down."""
    end = time.monotonic() + SETTLE_S
    while time.monotonic() < end and not all(f.running() or f.done() for f in futures):
        time.sleep(0.005)


def run_dask(work: Work, shards: list[int], address: str) -> Iterator[ShardResult]:
    """Shards in any order from the workers of the Dask scheduler at ``address``; InputError where it dies or they can
    not serve. A worker that dies costs what was in flight there, which others redo.
    """
    _require("distributed")
    from distributed import Client
    from distributed.scheduler import KilledWorker

    try:
        client = Client(address, timeout=5)  # type: ignore[no-untyped-call]
    except (OSError, TimeoutError, ValueError) as error:
        reason = str(error) or type(error).__name__
        raise InputError(
            f"no Dask scheduler answers at {address} ({reason}): start one with `dask scheduler`"
        ) from None
    try:
        window = AHEAD * _threads(client, address)
        yield from _from_cluster(client, work, shards, window)
    except KilledWorker as error:
        raise InputError(
            f"Dask workers at {address} died again and again on a shard ({error.last_worker}): they may lack memory, "
            "give them more or take a smaller shard_trials; what is finished is safe"
        ) from None
    finally:
        client.close(timeout=2)  # type: ignore[no-untyped-call]


def _from_cluster(client: Any, work: Work, shards: list[int], window: int) -> Iterator[ShardResult]:
    """Results as they come; a window of shards is with the cluster, so that results never pile up there or here."""
    from concurrent.futures import CancelledError

    from distributed import as_completed

    run = uuid4().hex  # keys are the cluster's: two campaigns must never answer each other's
    ahead = iter(shards)

    def submit(shard: int) -> Any:
        return client.submit(work, shard, pure=False, retries=3, key=f"shard-{run}-{shard}")

    results = as_completed([submit(shard) for shard in islice(ahead, window)])  # type: ignore[no-untyped-call]
    for future in results:
        try:
            result = future.result()
        except CancelledError:
            raise InputError(
                f"the Dask scheduler at {client.scheduler.address} is gone; what is finished is safe: start it and run "
                "the same command again"
            ) from None
        for shard in islice(ahead, 1):
            results.add(submit(shard))  # type: ignore[no-untyped-call]
        yield result


def _threads(client: Any, address: str) -> int:
    """The threads of the cluster's workers, after a look at each; InputError where there are none or one can not do."""
    try:
        client.wait_for_workers(1, timeout=NO_WORKER_S)
        states: dict[str, dict[str, str]] = client.run(worker_state)
    except TimeoutError:
        raise InputError(
            f"the Dask scheduler at {address} has no workers: start some with `dask worker {address}`"
        ) from None
    except ImportError as error:
        raise InputError(f"a Dask worker of {address} lacks this package ({error}): install it on every node") from None
    own = worker_state()
    for name, state in states.items():
        if state["code"] != own["code"]:
            raise InputError(
                f"the Dask worker {name} runs another version of this package ({state['code']}, here {own['code']}): "
                "install the same on every node"
            )
        if state["blas"] != "1":
            raise InputError(f"the Dask worker {name} lets BLAS take all cores: start it with OMP_NUM_THREADS=1")
    return sum(client.nthreads().values())


def default_workers() -> int:
    """The cores that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def _require(package: str) -> None:
    from importlib.util import find_spec

    if find_spec(package) is None:
        raise MissingDependencyError(f"campaigns need {package}: pip install 'perceptron-emu[campaign]'")
