"""The difference of two calibrations."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from workbench.cli import exit_codes
from workbench.cli.console import say_on_stdout, standard_output

EXITS = {
    "different": exit_codes.THRESHOLD,
    "other_sensor": exit_codes.NO_ANSWER,
    "no_answer": exit_codes.NO_ANSWER,
}


def command(
    first: Annotated[
        Path, typer.Argument(metavar="FIRST.json", help="A result of calibrate --json, or a folder of --out.")
    ],
    second: Annotated[Path, typer.Argument(metavar="SECOND.json", help="Another one.")],
    max_mm: Annotated[
        float | None, typer.Option(min=0.0, max=1e6, help="Exit code 1 also where the origins are farther apart.")
    ] = None,
    other_sensor: Annotated[
        bool,
        typer.Option("--other-sensor", help="Compare also where the results belong to different sensor.toml files."),
    ] = False,
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON object on standard output.")] = False,
) -> None:
    """The second SCP against the first, with σ; exit code 1 where they differ by more than 4 σ."""
    from geometry import json_text
    from workbench.files import read_result
    from workbench.report import difference, difference_object, print_difference

    found = difference(read_result(first), read_result(second), max_mm, other_sensor=other_sensor)
    if as_json:
        say_on_stdout(json_text(difference_object(found)))
    else:
        print_difference(standard_output(), found)
    if found.code in EXITS:
        raise typer.Exit(EXITS[found.code])
