"""Who computes the shards: processes of this machine (joblib) or the workers of a Dask cluster."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator

from geometry import InputError, MissingDependencyError
from workbench.campaign.store import ShardResult

Work = Callable[[int], ShardResult]
MAX_DEATHS_WITHOUT_PROGRESS = 5


def run_local(work: Work, shards: list[int], workers: int) -> Iterator[ShardResult]:
    """Shards in any order from ``workers`` processes; a worker that dies costs what was in flight, which is redone."""
    _require("joblib")
    from joblib import Parallel, delayed, parallel_config
    from joblib.externals.loky.process_executor import TerminatedWorkerError

    todo, deaths = list(shards), 0
    while todo:
        try:
            with parallel_config("loky", inner_max_num_threads=1):
                pool = Parallel(n_jobs=workers, return_as="generator_unordered", pre_dispatch="2*n_jobs", batch_size=1)
                for result in pool(delayed(work)(shard) for shard in list(todo)):
                    todo.remove(result.shard)
                    deaths = 0
                    yield result
        except TerminatedWorkerError:
            deaths += 1
            if deaths >= MAX_DEATHS_WITHOUT_PROGRESS:
                raise InputError(
                    f"a worker process was killed {deaths} times in a row without a shard done: it may lack memory, "
                    "take fewer --workers or a smaller shard_trials"
                ) from None


def run_dask(work: Work, shards: list[int], address: str) -> Iterator[ShardResult]:
    """Shards in any order from the workers of the Dask scheduler at ``address``."""
    _require("distributed")
    from distributed import Client, as_completed

    try:
        client = Client(address, timeout=5)  # type: ignore[no-untyped-call]
    except (OSError, TimeoutError, ValueError) as error:
        reason = str(error) or type(error).__name__
        raise InputError(
            f"no Dask scheduler answers at {address} ({reason}): start one with `dask scheduler`"
        ) from None
    with client:
        if not client.scheduler_info()["workers"]:
            client.wait_for_workers(1, timeout=60)
        futures = client.map(work, shards, pure=False, retries=3, key=[f"shard-{s}" for s in shards])
        for future in as_completed(futures):  # type: ignore[no-untyped-call]
            yield future.result()
            future.release()


def default_workers() -> int:
    """The cores that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def _require(package: str) -> None:
    from importlib.util import find_spec

    if find_spec(package) is None:
        raise MissingDependencyError(f"campaigns need {package}: pip install 'perceptron-emu[campaign]'")
