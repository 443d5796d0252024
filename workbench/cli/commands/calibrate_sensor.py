"""A sensor's own calibration from pictures of a board with the stripe on it."""

from __future__ import annotations

from dataclasses import replace
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from workbench.cli import exit_codes
from workbench.cli.console import progress_bar, say_on_stdout, standard_error, standard_output

if TYPE_CHECKING:
    from calib.sensor import DirectModel, SensorCalibration


class Export(StrEnum):
    """For which software."""

    OPENCV = "opencv"
    ROS = "ros"
    JSON = "json"


class Model(StrEnum):
    """What is written: camera and plane, and a direct map beside them."""

    PINHOLE = "pinhole"
    HOMOGRAPHY = "homography"
    POLYNOMIAL = "polynomial"


class Channel(StrEnum):
    """Of colour pictures."""

    RED = "red"
    GREEN = "green"
    BLUE = "blue"
    GREY = "grey"
    MAX = "max"


def command(
    folder: Annotated[
        Path, typer.Argument(metavar="FOLDER", help="Pairs NAME_off and NAME_on, a views.csv, or single pictures.")
    ],
    board: Annotated[Path, typer.Option(help="board.toml: what is printed on the board.")],
    out: Annotated[Path, typer.Option(help="The sensor.toml to write.")],
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON object on standard output.")] = False,
    report: Annotated[Path | None, typer.Option(help="An HTML page with residuals and coverage.")] = None,
    model: Annotated[
        Model, typer.Option(help="What takes pixels to (y, z): the camera, or a direct map as \\[direct] beside it.")
    ] = Model.PINHOLE,
    terms: Annotated[int, typer.Option(min=0, max=14, help="Longest OpenCV distortion vector that may be used.")] = 14,
    origin_z_mm: Annotated[float, typer.Option(help="Moves {P}'s origin along z.")] = 0.0,
    origin_y_mm: Annotated[float, typer.Option(help="Moves {P}'s origin along y.")] = 0.0,
    channel: Annotated[Channel | None, typer.Option(help="Of colour pictures; default: the largest.")] = None,
    export: Annotated[Export | None, typer.Option(help="Write the camera for other software too.")] = None,
    export_to: Annotated[Path | None, typer.Option(help="File of --export.")] = None,
) -> None:
    """Calibrate a line sensor from pictures of a board with the laser's stripe on it: camera, lens and laser plane."""
    from calib.sensor import fit_direct
    from geometry import InputError, json_text
    from workbench.files import find_views, read_board, write_text
    from workbench.sensor import (
        answer_object,
        calibrate_recording,
        calibrated_sensor,
        calibrated_text,
        exported,
        read_recording,
        write_sensor_report,
    )

    if (export is None) != (export_to is None):
        raise InputError("--export and --export-to go together: which software, and which file")
    said: list[str] = []
    printed = read_board(board)
    files = find_views(folder, said.append)
    with progress_bar("finding boards", len(files), quiet=as_json) as progress:
        recording = read_recording(files, printed, None if channel is None else channel.value, progress)
    result = calibrate_recording(recording, terms, (origin_y_mm, origin_z_mm))
    remarks = (*said, *recording.remarks)
    answer = answer_object(result, sum(len(v.corners) for v in recording.views), recording.lost, remarks)
    sensor = calibrated_sensor(result, recording.sensor) if result.verdict.is_answer else None
    if sensor is not None:
        camera = recording.sensor.require_camera()
        size = (camera.width_px, camera.height_px)
        kind: DirectModel = "homography" if model is Model.HOMOGRAPHY else "polynomial"
        direct = None if model is Model.PINHOLE else fit_direct(result, kind, size)
        answer |= {} if direct is None else {"direct": {"model": model.value, "rms_mm": direct.rms_mm}}
        sensor = replace(sensor, direct=direct)
        write_text(out, calibrated_text(sensor, result))
        if export is not None and export_to is not None:
            write_text(export_to, exported(sensor, export.value))
    if report is not None:
        write_sensor_report(report, folder, recording, result, answer)
    if as_json:
        say_on_stdout(json_text(answer))
    else:
        _show(result, answer["notes"], recording.lost)
    if sensor is None:
        raise typer.Exit(exit_codes.NO_ANSWER)
    standard_error().print(f"{out}", markup=False, soft_wrap=True)


def _show(result: SensorCalibration, notes: list[str], lost: tuple[tuple[str, str], ...]) -> None:
    from rich.table import Table

    console = standard_output()
    s = result.solution
    if s is not None:
        sigma = s.uncertainty.sigma
        table = Table("", "value", "σ", title="Camera and laser plane")
        values = dict(zip(("fx_px", "fy_px", "cx_px", "cy_px"), s.camera, strict=False))
        values |= dict(zip(s.terms, (s.camera[4:][list(_order()).index(t)] for t in s.terms), strict=True))
        for name, value in values.items():
            table.add_row(name, f"{value:.6g}", f"{sigma[name]:.2g}")
        table.add_row("plane distance, mm", f"{s.plane_mm:.4f}", f"{sigma['plane_shift_mm']:.2g}")
        console.print(table)
        console.print(
            f"reprojection {result.reprojection_rms_px:.4f} px, stripe on plane {result.plane_rms_mm:.4f} mm; "
            f"left-out views {result.left_out_px:.4f} px, {result.left_out_mm:.4f} mm",
            markup=False,
            soft_wrap=True,
        )
    for v in result.views:
        if v.reason:
            console.print(f"{v.name}: {v.reason}", markup=False, soft_wrap=True)
    for name, reason in lost:
        console.print(f"{name}: {reason}", markup=False, soft_wrap=True)
    for note in notes:
        console.print(f"note: {note}", markup=False, soft_wrap=True)
    console.print(f"verdict: {result.verdict.code}", markup=False)
    console.print(result.verdict.text, markup=False, soft_wrap=True)


def _order() -> tuple[str, ...]:
    from geometry.sensor import CAMERA_PARAMETERS

    return CAMERA_PARAMETERS[4:]
