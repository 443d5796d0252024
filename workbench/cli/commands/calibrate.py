"""Solve the sensor's pose in the hand from a dataset."""

from __future__ import annotations

import json
import sys
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from workbench.cli import exit_codes
from workbench.cli.commands.compare import EXITS as DIFFERENCE_EXITS
from workbench.cli.console import progress_bar, say_on_stdout, standard_error, standard_output

if TYPE_CHECKING:
    from calib import CalibrationResult
    from workbench.files import Cell, Settings


class Method(StrEnum):
    """How the SCP is solved."""

    BUNDLE = "bundle"
    PAPER = "paper"


class Controller(StrEnum):
    """Whose tool frame is written."""

    KUKA = "kuka"
    FANUC = "fanuc"
    ABB = "abb"
    YASKAWA = "yaskawa"
    UR = "ur"


class CalibrateModel(StrEnum):
    """What is estimated."""

    AUTO = "auto"
    SCP = "scp"
    OFFSETS = "scp+offsets"
    FULL = "full"
    AUTO_SENSOR = "auto+sensor"
    OFFSETS_SENSOR = "scp+offsets+sensor"
    FULL_SENSOR = "full+sensor"
    AUTO_COMPLIANCE = "auto+compliance"
    OFFSETS_COMPLIANCE = "scp+offsets+compliance"
    FULL_COMPLIANCE = "full+compliance"
    AUTO_BOTH = "auto+sensor+compliance"
    OFFSETS_BOTH = "scp+offsets+sensor+compliance"
    FULL_BOTH = "full+sensor+compliance"


def command(
    dataset: Annotated[Path, typer.Argument(metavar="DATASET", help="Folder of a cell dataset, or its cell.toml.")],
    method: Annotated[
        Method | None, typer.Option(help="A bundle over raw points (default), or the paper's own iteration.")
    ] = None,
    model: Annotated[
        CalibrateModel | None,
        typer.Option(
            help="The SCP with the robot's errors under their priors (auto, the default), alone, with joint offsets, "
            "with the full DH table; +sensor: with the sensor's own errors, too; +compliance: with how the joints "
            "give way under gravity."
        ),
    ] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON object on standard output.")] = False,
    out: Annotated[
        Path | None, typer.Option(help="Folder for result.json, points.csv, fig7.png and a corrected robot.")
    ] = None,
    daily: Annotated[
        Path | None, typer.Option(help="A result of calibrate --json to compare with; exit code 1 beyond 4 σ.")
    ] = None,
    max_mm: Annotated[
        float | None, typer.Option(min=0.0, max=1e6, help="With --daily: exit code 1 also beyond this many mm.")
    ] = None,
    export: Annotated[
        tuple[Controller, Path] | None,
        typer.Option(metavar="MAKER FILE", help="Write the tool frame as kuka, fanuc, abb, yaskawa or ur takes it."),
    ] = None,
    watch: Annotated[
        bool,
        typer.Option(
            "--watch", help="Answer anew with each image or profile and row of frames.csv; name the next pose."
        ),
    ] = False,
    until: Annotated[
        float | None,
        typer.Option(
            min=1e-6, max=1e6, help="With --watch: end once the longest σ, rotations at 300 mm, is so many mm."
        ),
    ] = None,
    every: Annotated[
        float,
        typer.Option(min=0.05, max=3600, help="With --watch: seconds between looks; files must stand still so long."),
    ] = 1.0,
    report: Annotated[Path | None, typer.Option(help="File for a self-contained HTML report.")] = None,
    config: Annotated[
        list[Path] | None, typer.Option("--config", "--recipe", help="The recipe of all tools, TOML; may be repeated.")
    ] = None,
) -> None:
    """Solve the sensor's pose in the hand (SCP) from a cell dataset, emulated or recorded."""
    from geometry import json_text
    from workbench.answered import calibrate_cell
    from workbench.files import read_cell, read_result, read_settings
    from workbench.report import print_calibration

    if until is not None and not watch:
        from geometry import InputError

        raise InputError("--until says when a watch ends: give --watch, too")
    reference = None if daily is None else read_result(daily)
    settings = read_settings(config or [], method=method and method.value, model=model and model.value)
    cell = _watched(dataset, settings, until, every, as_json=as_json) if watch else read_cell(dataset)
    with progress_bar("extracting", len(cell.frames)) as progress:
        answered = calibrate_cell(cell, settings, progress)
    result = answered.result
    if out is not None:
        answered.save(out)
    if report is not None and (remark := answered.report(report)):
        standard_error().print(remark, markup=False, soft_wrap=True)
    answer = answered.as_object()
    moved = None
    if reference is not None:
        from workbench.files import saved_result
        from workbench.report import difference, difference_object

        moved = difference(reference, saved_result(dataset, answer), max_mm)
        answer["daily"] = difference_object(moved)
    if as_json:
        say_on_stdout(json_text(answer))
    else:
        print_calibration(standard_output(), result, answered.observed.complaints)
        if moved is not None:
            from workbench.report import print_difference

            print_difference(standard_output(), moved)
    if not result.verdict.trustworthy:
        raise typer.Exit(exit_codes.NO_ANSWER)
    if export is not None:
        _export(export[1], export[0].value, cell, result)
    if moved is not None and moved.code in DIFFERENCE_EXITS:
        raise typer.Exit(DIFFERENCE_EXITS[moved.code])


def _watched(dataset: Path, settings: Settings, until: float | None, every: float, *, as_json: bool) -> Cell:
    """Tell every round of a watch; returns the dataset once σ is what was asked for."""
    from workbench.plan import rounds
    from workbench.report import print_round, round_object

    def say(words: str) -> None:
        standard_error().print(words, markup=False, soft_wrap=True)

    for found in rounds(dataset, settings.extraction, settings.calib, until, every, say):
        if as_json:
            say_on_stdout(json.dumps(round_object(found), allow_nan=False))
        else:
            print_round(standard_output(), found)
        sys.stdout.flush()  # a program reads along
        last = found
    return last.cell


def _export(path: Path, maker: str, cell: Cell, result: CalibrationResult) -> None:
    """Write the SCP that goes with the controller's own table."""
    from workbench.files import controller_text, write_text

    nominal = result.nominal
    pose = result.T_hand_sensor if nominal is None else nominal.T_hand_sensor
    if pose is None:
        return
    which = "" if nominal is None else ", T_hand_sensor_nominal: it goes with the controller's own, nominal table"
    about = f"calibrate {cell.folder.resolve().name}: model {result.model}, verdict {result.verdict.code}{which}"
    write_text(path, controller_text(pose, maker, about))
