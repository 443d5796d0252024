"""The entry point: nothing heavy is imported before Ctrl-C is looked after."""

from __future__ import annotations

import atexit
import os
import signal
import sys
from collections.abc import Sequence
from types import FrameType

from workbench.cli.exit_codes import INTERRUPTED

# where a KeyboardInterrupt is lost: in modules being imported, and in what LLVM calls back while kernels are loaded
LOST = ("importlib._bootstrap", f"{os.sep}llvmlite{os.sep}")


def run(arguments: Sequence[str]) -> int:
    """Run one command and return its exit code; every error becomes one line on standard error."""
    from workbench.cli.app import run as run_command

    return run_command(arguments)


def main() -> None:
    """Entry point of the command."""
    signal.signal(signal.SIGINT, interrupted)
    # registered first, done last: what takes the interpreter down restores the default, which ends by a signal
    atexit.register(signal.signal, signal.SIGINT, signal.SIG_IGN)
    try:
        code = run(sys.argv[1:])
        signal.signal(signal.SIGINT, lambda *_: os._exit(code))  # all is said and written: only taking down is left
    except KeyboardInterrupt:  # before or after what `run` looks after
        os.write(2, b"interrupted\n")
        code = INTERRUPTED
    if code == INTERRUPTED:  # threads may still compute, and crash where the interpreter is taken down about them
        atexit._run_exitfuncs()
        sys.stdout.flush()
        os._exit(code)
    sys.exit(code)


def interrupted(_signal: int, frame: FrameType | None) -> None:
    """End at once where a KeyboardInterrupt would be swallowed, so that the command went on; else raise it."""
    while frame is not None:
        if any(part in frame.f_code.co_filename for part in LOST):
            os.write(2, b"interrupted\n")
            os._exit(INTERRUPTED)
        frame = frame.f_back
    raise KeyboardInterrupt
