"""Imported by the server that workers are forked from: all modules, and the kernels by one small trial."""

import signal
import threading

if threading.current_thread() is threading.main_thread():
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is the caller's

from workbench.campaign.asked.plan import Plan
from workbench.campaign.work.shard import run_shard

FEW = {"plans": 1, "locations": 1, "per_location": 3}  # views: the fewest that can be planned

run_shard(Plan.model_validate({"run": "extract", "repeats": 1, "base": {"poses": FEW}}), 0)
