"""Check the installation."""

from __future__ import annotations

import typer

from workbench.cli import exit_codes
from workbench.cli.console import standard_output

MARKS = {"ok": "[green]ok     [/]", "absent": "[yellow]absent [/]", "broken": "[red]broken [/]"}


def command() -> None:
    """Check the installation and say what is missing and how to get it.

    Exit code 0 unless something that the default path needs is broken; what is absent and optional does not count.
    """
    from workbench.cli.diagnosis import diagnose

    console = standard_output()
    broken = False
    for finding in diagnose():
        broken |= finding.state == "broken"
        console.print(f"{MARKS[finding.state]} [bold]{finding.what}[/]  ", end="")
        console.print(finding.detail, markup=False, soft_wrap=True)
    if broken:
        raise typer.Exit(exit_codes.INPUT)
