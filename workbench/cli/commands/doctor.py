"""Check the installation, or a dataset."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from workbench.cli import exit_codes
from workbench.cli.console import say_on_stdout, standard_output

if TYPE_CHECKING:
    from workbench.cli.diagnosis import Diagnosed
    from workbench.files import FileFinding

MARKS = {
    "ok": "[green]ok      [/]",
    "absent": "[yellow]absent  [/]",
    "doubtful": "[yellow]doubtful[/]",
    "missing": "[red]missing [/]",
    "broken": "[red]broken  [/]",
}


def command(
    dataset: Annotated[
        Path | None,
        typer.Argument(
            metavar="DATASET", help="A dataset's folder, to be looked through in place of the installation."
        ),
    ] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON object on standard output.")] = False,
) -> None:
    """Check the installation, or a dataset file by file: what is missing or doubtful, and what each frame is good for.

    Exit code 0 unless something is broken that the default path needs, or that `calibrate` could not use; what is
    absent and optional does not count.
    """
    found = []
    for finding in _findings(dataset):
        found.append(finding)
        if not as_json:
            _show(finding)
    usable = not any(f.state in ("broken", "missing") for f in found)
    if as_json:
        from geometry import json_text

        say_on_stdout(json_text({"usable": usable, "findings": [asdict(f) for f in found]}))
    if not usable:
        raise typer.Exit(exit_codes.INPUT)


def _show(finding: Diagnosed | FileFinding) -> None:
    console = standard_output()
    console.print(f"{MARKS[finding.state]} ", end="")
    console.print(f"{finding.what}  ", style="bold", end="", markup=False)
    console.print(finding.detail, markup=False, soft_wrap=True)


def _findings(dataset: Path | None) -> Iterator[Diagnosed | FileFinding]:
    if dataset is None:
        from workbench.cli.diagnosis import diagnose

        return diagnose()
    from workbench.files import examine_cell

    return examine_cell(dataset)
