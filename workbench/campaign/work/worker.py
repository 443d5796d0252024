"""A worker process: one thread, no longer alive than its parent."""

from __future__ import annotations

import os
import signal
import threading
import time

from workbench.campaign.store.environment import code_version

ONE_THREAD = dict.fromkeys(
    ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "VECLIB_MAXIMUM_THREADS", "NUMBA_NUM_THREADS"), "1"
)
WATCH_S = 0.5  # between two looks at whether the parent still lives


def begin_worker(caller: int) -> None:
    """Prepare a process that works for the process ``caller``: it leaves Ctrl-C to that, and ends when that ends."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    threading.Thread(target=_watch, args=(caller, os.getppid()), daemon=True).start()
    one_thread()


def one_thread() -> None:
    """No more than one core for OpenCV; BLAS is told by the environment before it starts, no kernel is parallel."""
    import cv2

    cv2.setNumThreads(1)


def worker_state() -> dict[str, str]:
    """What a campaign must know of the process that runs its shards: the code, and the threads that BLAS may take."""
    blas = [os.environ[name] for name in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS") if name in os.environ]
    return {"code": code_version(), "blas": blas[0] if blas else ""}


def _watch(caller: int, parent: int) -> None:
    """End this process as soon as its parent is another or the caller is gone: a killed one leaves no workers behind.

    The parent is the caller, or the server that workers are forked from, which ends with the caller.
    """
    while os.getppid() == parent and _lives(caller):
        time.sleep(WATCH_S)
    os._exit(1)


def _lives(process: int) -> bool:
    try:
        os.kill(process, 0)
    except ProcessLookupError:
        return False
    except PermissionError:
        return True
    return True
