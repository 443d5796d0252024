"""Profile files from one maker's format to another's."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from workbench.cli.console import say_remark


def command(
    source: Annotated[Path, typer.Argument(metavar="IN", help="A profile file, of any format that is read.")],
    out: Annotated[Path, typer.Argument(metavar="OUT", help="The file to write.")],
    to_format: Annotated[
        str | None,
        typer.Option("--format", help="Format of OUT: csv, gocator, keyence_csv, ply, npy …; else by OUT's name."),
    ] = None,
    from_format: Annotated[
        str, typer.Option("--from", help="Format of IN; auto: recognised by its own signature.")
    ] = "auto",
    pitch_mm: Annotated[
        float | None, typer.Option(help="Lateral step, for formats without lateral coordinates.", show_default=False)
    ] = None,
    start_mm: Annotated[
        float | None, typer.Option(help="Lateral start, for those formats.", show_default=False)
    ] = None,
    unit: Annotated[
        int | None, typer.Option(help="Keyence LJ-X: a count in hundredths of a micrometre.", show_default=False)
    ] = None,
    width: Annotated[int | None, typer.Option(help="Points of a profile in raw files.", show_default=False)] = None,
) -> None:
    """Convert profiles from one format to another; missing points stay missing."""
    from workbench.profiles import convert

    remarks: list[str] = []
    done = convert(source, out, to_format, from_format, pitch_mm, start_mm, unit, width, remarks.append)
    for line in (*remarks, done):
        say_remark(line)
