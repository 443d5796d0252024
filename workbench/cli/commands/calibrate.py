"""Solve the sensor's pose in the hand from a dataset."""

from __future__ import annotations

from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer

from workbench.cli import exit_codes
from workbench.cli.console import progress_bar, say_on_stdout, standard_error, standard_output


class Method(StrEnum):
    """How the SCP is solved."""

    BUNDLE = "bundle"
    PAPER = "paper"


class CalibrateModel(StrEnum):
    """What is estimated."""

    AUTO = "auto"
    SCP = "scp"
    OFFSETS = "scp+offsets"
    FULL = "full"
    AUTO_SENSOR = "auto+sensor"
    OFFSETS_SENSOR = "scp+offsets+sensor"
    FULL_SENSOR = "full+sensor"


def command(
    dataset: Annotated[Path, typer.Argument(help="Folder of a cell dataset, or its cell.toml.")],
    method: Annotated[
        Method | None, typer.Option(help="A bundle over raw points (default), or the paper's own iteration.")
    ] = None,
    model: Annotated[
        CalibrateModel | None,
        typer.Option(
            help="The SCP with the robot's errors under their priors (auto, the default), alone, with joint offsets, "
            "with the full DH table; +sensor: with the sensor's own errors, too."
        ),
    ] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON object on standard output.")] = False,
    out: Annotated[
        Path | None, typer.Option(help="Folder for result.json, points.csv, fig7.png and a corrected robot.")
    ] = None,
    report: Annotated[Path | None, typer.Option(help="File for a self-contained HTML report.")] = None,
    config: Annotated[list[Path] | None, typer.Option(help="Settings TOML; may be given more than once.")] = None,
) -> None:
    """Solve the sensor's pose in the hand (SCP) from a cell dataset, emulated or recorded."""
    from workbench.cell import observe, solve
    from workbench.files import read_cell, read_settings
    from workbench.report import calibration_object, json_text, print_calibration

    settings = read_settings(config or [], method=method and method.value, model=model and model.value)
    cell = read_cell(dataset)
    with progress_bar("extracting", len(cell.frames)) as progress:
        observed = observe(cell, settings.extraction, progress)
    result = solve(cell, observed, settings.calib)
    if out is not None:
        from workbench.report import write_results

        write_results(out, cell, observed, result, settings)
    if report is not None:
        from workbench.report import ReportInput, cell_image, write_report

        picture, remark = cell_image(cell, result)
        if remark:
            standard_error().print(remark, markup=False, soft_wrap=True)
        write_report(report, ReportInput(cell, observed, result, settings, picture))
    if as_json:
        say_on_stdout(json_text(calibration_object(result, observed.complaints)))
    else:
        print_calibration(standard_output(), result, observed.complaints)
    if not result.verdict.trustworthy:
        raise typer.Exit(exit_codes.NO_ANSWER)
