"""A sensor.toml from a data sheet."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from workbench.cli.console import say_remark


def command(
    out: Annotated[Path, typer.Argument(metavar="SENSOR.toml", help="File to write.")],
    clearance_mm: Annotated[float, typer.Option(help="From the sensor's face to the nearest depth.")],
    range_mm: Annotated[float, typer.Option(help="How deep it measures.")],
    near_mm: Annotated[float, typer.Option(help="Width of the field at the nearest depth.")],
    far_mm: Annotated[float, typer.Option(help="Width of the field at the farthest depth.")],
    points: Annotated[int, typer.Option(help="Points of a profile.")],
    repeatability_mm: Annotated[float, typer.Option(help="Of z, as the data sheet says.")],
    name: Annotated[str, typer.Option(help="What the sensor is called.")] = "",
) -> None:
    """Write the sensor.toml of a line profiler from its data sheet alone, to plan and emulate with it before buying."""
    from geometry import InputError
    from workbench.cell import DataSheet, data_sheet_text
    from workbench.files import write_text

    if out.is_dir():
        raise InputError(f"{out}: is a folder, the name of a file is needed")
    if not name.isprintable() or '"' in name or "\\" in name:
        raise InputError("--name: letters, digits and blanks are right")
    sheet = DataSheet(clearance_mm, range_mm, near_mm, far_mm, points, repeatability_mm, name)
    write_text(out, data_sheet_text(sheet))
    say_remark(f"{out}: perceptron-emu init FOLDER --sensor {out} makes a cell with it")
