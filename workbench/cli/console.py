"""What goes where: results on standard output, progress and remarks on standard error."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from rich.console import Console
from rich.progress import (
    BarColumn,
    MofNCompleteColumn,
    Progress,
    ProgressColumn,
    Task,
    TextColumn,
    TimeRemainingColumn,
)
from rich.text import Text

WIDTH_WITHOUT_TERMINAL = 110
RATE_S = 300.0  # over which rate and time left are estimated: long pieces of work come in seldom


class _RateColumn(ProgressColumn):
    """How many a second."""

    def render(self, task: Task) -> Text:
        """The rate, once there is one."""
        speed = task.finished_speed or task.speed
        return Text("" if speed is None else f"{speed:.3g}/s", style="progress.data.speed")


def standard_output() -> Console:
    """Console for results; wide enough for the tables where no terminal says its width."""
    return Console(highlight=False, width=None if sys.stdout.isatty() else WIDTH_WITHOUT_TERMINAL)


def standard_error() -> Console:
    """Console for progress and remarks."""
    return Console(stderr=True, highlight=False)


def say_remark(text: str) -> None:
    """One remark on standard error, as it is."""
    standard_error().print(text, markup=False, soft_wrap=True)


def say_on_stdout(text: str) -> None:
    """Write one result as it is."""
    sys.stdout.write(text + "\n")


@contextmanager
def progress_bar(
    title: str, total: int, *, rate: bool = False, quiet: bool = False
) -> Iterator[Callable[[int, int], None]]:
    """A bar on standard error, shown on terminals only; yields ``update(done, total)``. rate: tell it too."""
    console = standard_error()
    columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeRemainingColumn())
    shown = (*columns, _RateColumn()) if rate else columns
    hidden = quiet or not console.is_terminal
    with Progress(*shown, console=console, transient=True, disable=hidden, speed_estimate_period=RATE_S) as progress:
        task = progress.add_task(title, total=total)

        def update(done: int, of: int) -> None:
            progress.update(task, completed=done, total=of)

        yield update
