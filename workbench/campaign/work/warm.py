"""Workers forked from one server that holds all modules and kernels: each begins at once, without imports of its own.

The server is multiprocessing's forkserver, a process of one thread; where there is none, workers are spawned.
"""

from __future__ import annotations

import os
import signal
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from multiprocessing import context, forkserver, popen_forkserver, resource_tracker
from types import ModuleType
from typing import Any

from workbench.campaign.work.worker import ONE_THREAD

LOADED = "workbench.campaign.work.loaded"  # what the server imports before it forks
# the processes that remove semaphores report those that Ctrl-C caught half removed: these are gone, nobody need know
NO_REMARKS = "ignore:resource_tracker"


class _Popen(popen_forkserver.Popen):
    """A worker that knows the package alone: the caller's main module, which may start campaigns, is not run again."""

    def _launch(self, process_obj: Any) -> None:
        main = sys.modules["__main__"]
        sys.modules["__main__"] = ModuleType("__main__")
        try:
            with helpers_environment():  # should the server have died, it is started anew here
                super()._launch(process_obj)  # type: ignore[misc]
        finally:
            sys.modules["__main__"] = main


class _Process(context.ForkServerProcess):
    @staticmethod
    def _Popen(process_obj: Any) -> Any:
        return _Popen(process_obj)


class WarmContext(context.ForkServerContext):
    """Where loky's pool takes its processes from."""

    Process = _Process


_started: list[WarmContext] = []


def warm_server() -> WarmContext | None:
    """Start the server, where the system allows it, without waiting for it; None where workers are to be spawned.

    A server that somebody else has started holds other modules and other threads: then workers are spawned, too.
    """
    if _started:
        return _started[0]
    if sys.platform != "linux" or getattr(forkserver._forkserver, "_forkserver_pid", None) is not None:
        return None
    warm = WarmContext()
    warm.set_forkserver_preload([LOADED])
    with helpers_environment():
        forkserver.ensure_running()
    _started.append(warm)
    return warm


@contextmanager
def helpers_environment() -> Iterator[None]:
    """The environment of workers and of those who tidy up after them, for what is started meanwhile.

    A terminal sends Ctrl-C to all: it is this process's alone, the others inherit that it waits.
    """
    warnings = ",".join(filter(None, (os.environ.get("PYTHONWARNINGS"), NO_REMARKS)))  # the last of them counts most
    asked = {**ONE_THREAD, "PYTHONWARNINGS": warnings}
    before = {name: os.environ.get(name) for name in asked}
    os.environ.update(asked)
    resource_tracker.ensure_running()  # it lets Ctrl-C through once it runs
    masked = signal.pthread_sigmask(signal.SIG_BLOCK, [signal.SIGINT]) if hasattr(signal, "pthread_sigmask") else None
    try:
        yield
    finally:
        if masked is not None:
            signal.pthread_sigmask(signal.SIG_SETMASK, masked)
        for name, value in before.items():
            if value is None:
                del os.environ[name]
            else:
                os.environ[name] = value


def end_warm_server() -> None:
    """End the server; the next campaign starts its own."""
    if _started:
        _started.clear()
        forkserver._forkserver._stop()  # type: ignore[attr-defined]
