"""The entry point: nothing heavy is imported before Ctrl-C is looked after."""

from __future__ import annotations

import atexit
import gc
import os
import signal
import sys
from collections.abc import Sequence
from contextlib import suppress
from types import FrameType

from workbench.cli.exit_codes import INTERRUPTED

# where a KeyboardInterrupt is lost, or becomes another error: in modules being imported, in what LLVM calls back while
# kernels are loaded, and while models' validators are built, on import or at their first use
LOST = ("importlib._bootstrap", f"{os.sep}llvmlite{os.sep}", f"{os.sep}pydantic{os.sep}_internal{os.sep}")
# objects that come to be between two searches for unreachable ones. Of Python's 700, modules being imported cause
# hundreds of searches that find nothing, a fifth of a second
NEW_OBJECTS = 100_000
# linear algebra on one thread: matrices here are small, and a thread that waits for the next one takes its core all the
# same (a calibration took twice the processor time)
ONE_BLAS_THREAD = ("OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "VECLIB_MAXIMUM_THREADS")


def run(arguments: Sequence[str]) -> int:
    """Run one command and return its exit code; every error becomes one line on standard error."""
    from workbench.cli.app import run as run_command

    return run_command(arguments)


def main() -> None:
    """Entry point of the command."""
    signal.signal(signal.SIGINT, interrupted)
    sys.unraisablehook = _unraisable
    os.environ.setdefault("PYDANTIC_DISABLE_PLUGINS", "__all__")  # looked for in all that is installed
    if "OMP_NUM_THREADS" not in os.environ:  # which speaks for all of them
        for name in ONE_BLAS_THREAD:
            os.environ.setdefault(name, "1")
    gc.set_threshold(NEW_OBJECTS, *gc.get_threshold()[1:])
    code = 1  # of what is raised beyond `run`
    atexit.register(lambda: _leave(code))  # registered first, done last, once threads have ended
    try:
        code = run(sys.argv[1:])
        signal.signal(signal.SIGINT, lambda *_: os._exit(code))  # all is said and written: only taking down is left
    except KeyboardInterrupt:  # before or after what `run` looks after
        os.write(2, b"interrupted\n")
        code = INTERRUPTED
    if code == INTERRUPTED:  # threads may still compute, and crash where the interpreter is taken down about them
        atexit._run_exitfuncs()
    sys.exit(code)


def _leave(code: int) -> None:
    """End the process; taking the interpreter down module by module would take a third of a second, and end by a signal
    where Ctrl-C meets it.
    """
    with suppress(OSError, ValueError):  # nobody reads
        sys.stdout.flush()
        sys.stderr.flush()
    os._exit(code)


def _unraisable(ignored: sys.UnraisableHookArgs) -> None:
    """End at once where a KeyboardInterrupt met what can raise nothing, a destructor say: Python would only tell of it,
    and the command go on.
    """
    if issubclass(ignored.exc_type, KeyboardInterrupt):
        os.write(2, b"interrupted\n")
        os._exit(INTERRUPTED)
    sys.__unraisablehook__(ignored)


def interrupted(_signal: int, frame: FrameType | None) -> None:
    """End at once where a KeyboardInterrupt would be swallowed, so that the command went on; else raise it."""
    while frame is not None:
        if any(part in frame.f_code.co_filename for part in LOST):
            os.write(2, b"interrupted\n")
            os._exit(INTERRUPTED)
        frame = frame.f_back
    raise KeyboardInterrupt
