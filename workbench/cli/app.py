"""The command line `perceptron-emu`: commands imported when called, errors as one line and an exit code."""

from __future__ import annotations

import os
import sys
from collections.abc import Sequence
from typing import Annotated

import typer

from workbench.cli import exit_codes
from workbench.cli.encoding import write_what_the_console_can
from workbench.cli.extras import install_hint
from workbench.cli.lazy import LazyGroup

app = typer.Typer(cls=LazyGroup, add_completion=True, no_args_is_help=True, rich_markup_mode="rich")


def _version(value: bool) -> None:
    if value:
        from importlib.metadata import version

        typer.echo(f"perceptron-emu {version('perceptron-emu')}")
        raise typer.Exit


@app.callback()
def _options(
    version: Annotated[
        bool, typer.Option("--version", callback=_version, is_eager=True, help="Show the version and exit.")
    ] = False,
    debug: Annotated[bool, typer.Option("--debug", help="Show the traceback of an error.")] = False,
) -> None:
    """Emulate a robot-mounted laser-line sensor, extract string points, calibrate its pose in the hand on a string jig.

    Exit codes: 0 an answer, 1 a threshold failed, 2 unusable input or arguments, 3 no trustworthy answer, 70 a fault of
    the program, 130 interrupted.
    """


def run(arguments: Sequence[str]) -> int:
    """Run one command and return its exit code; every error becomes one line on standard error."""
    debug = "--debug" in arguments
    write_what_the_console_can()
    try:
        code = app(args=list(arguments), prog_name="perceptron-emu", standalone_mode=False)
        sys.stdout.flush()
        if code == exit_codes.INTERRUPTED:  # how typer tells of a KeyboardInterrupt
            return _say("interrupted", code)
        return code if isinstance(code, int) else 0
    except BrokenPipeError:
        os.dup2(
            os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno()
        )  # the reader left; nothing more can be said to it
        return 0
    except (KeyboardInterrupt, typer.Abort) as error:
        return _say(str(error) or "interrupted", exit_codes.INTERRUPTED)
    except Exception as error:  # noqa: BLE001 - the one place where no error may pass as a traceback
        if debug:
            import traceback

            traceback.print_exc()
        return _explain(error)


def _explain(error: Exception) -> int:
    """Print what ``error`` means to the user and return its exit code."""
    if hasattr(error, "format_message") and hasattr(error, "exit_code"):  # how typer reports wrong arguments
        message = str(error.format_message())
        return _say(message, exit_codes.INPUT) if message else exit_codes.INPUT
    from geometry import NoAnswerError, PerceptronEmuError

    if isinstance(error, NoAnswerError):
        return _say(str(error), exit_codes.NO_ANSWER)
    if isinstance(error, PerceptronEmuError):
        return _say(str(error), exit_codes.INPUT)
    if isinstance(error, ModuleNotFoundError) and (hint := install_hint(error.name)):
        return _say(hint, exit_codes.INPUT)
    if isinstance(error, MemoryError):
        return _say("not enough memory for this input", exit_codes.INPUT)
    if isinstance(error, OSError):
        return _say(f"{error.filename or 'input or output'}: {error.strerror or error}", exit_codes.INPUT)
    where = " ".join(getattr(error, "__notes__", ()))
    words = (
        f"unexpected {type(error).__name__} {where}: {error}"
        if where
        else f"unexpected {type(error).__name__}: {error}"
    )
    return _say(f"{words} (a fault of the program; --debug shows where)", exit_codes.BUG)


def _say(message: str, code: int) -> int:
    text = " ".join(message.split())
    colour = sys.stderr.isatty() and "NO_COLOR" not in os.environ
    error = "\033[1;31merror:\033[0m" if colour else "error:"
    print(f"{error} {text}" if code != exit_codes.INTERRUPTED else text, file=sys.stderr)  # noqa: T201 - the command line's voice
    return code
