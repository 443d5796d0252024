"""Imported by the server that workers are forked from: all modules, and the kernels by one small trial."""

import signal
import sys
import threading
from types import TracebackType

if threading.current_thread() is threading.main_thread():
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is the caller's

from workbench.campaign.asked.plan import Plan
from workbench.campaign.work.shard import run_shard


def _said(kind: type[BaseException], value: BaseException, trace: TracebackType | None) -> None:
    """What a worker dies of, but for one that finds its caller gone while it starts."""
    if not issubclass(kind, OSError | EOFError):
        sys.__excepthook__(kind, value, trace)


sys.excepthook = _said
FEW = {"plans": 1, "locations": 1, "per_location": 3}  # views: the fewest that can be planned

run_shard(Plan.model_validate({"run": "extract", "repeats": 1, "base": {"poses": FEW}}), 0)
