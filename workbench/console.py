"""What goes where: results on standard output, progress and remarks on standard error."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

WIDTH_WITHOUT_TERMINAL = 110


def standard_output() -> Console:
    """Console for results; wide enough for the tables where no terminal says its width."""
    return Console(highlight=False, width=None if sys.stdout.isatty() else WIDTH_WITHOUT_TERMINAL)


def standard_error() -> Console:
    """Console for progress and remarks."""
    return Console(stderr=True, highlight=False)


def say_on_stdout(text: str) -> None:
    """Write one result as it is."""
    sys.stdout.write(text + "\n")


@contextmanager
def progress_bar(title: str, total: int) -> Iterator[Callable[[int, int], None]]:
    """A bar on standard error, shown on terminals only; yields ``update(done, total)``."""
    console = standard_error()
    columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeRemainingColumn())
    with Progress(*columns, console=console, transient=True, disable=not console.is_terminal) as progress:
        task = progress.add_task(title, total=total)

        def update(done: int, of: int) -> None:
            progress.update(task, completed=done, total=of)

        yield update
