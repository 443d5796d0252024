"""Fixed-point closure: a tool's point seated again and again in the same socket, joint readings alone."""

from calib.closure.judge import ClosureResult, closing_rms, closure
from calib.closure.terms import Socket

__all__ = [
    "ClosureResult",
    "Socket",
    "closing_rms",
    "closure",
]
