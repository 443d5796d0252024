"""Judge an SCP on a dataset without solving."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from rich.markup import escape
from rich.table import Table

from workbench.cli import exit_codes
from workbench.cli.console import progress_bar, say_on_stdout, standard_output

if TYPE_CHECKING:
    from calib import Verification


def command(
    dataset: Annotated[Path, typer.Argument(metavar="DATASET", help="Folder of a cell dataset, or its cell.toml.")],
    scp: Annotated[
        Path | None, typer.Option(help="A result of calibrate --json whose SCP is judged; else \\[scp_initial].")
    ] = None,
    max_rms_mm: Annotated[
        float | None, typer.Option(min=0.0, max=1e6, help="Largest point rms of a location; exit code 1 above it.")
    ] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON object on standard output.")] = False,
    config: Annotated[
        list[Path] | None, typer.Option("--config", "--recipe", help="The recipe of all tools, TOML; may be repeated.")
    ] = None,
) -> None:
    """Judge an SCP on the frames of a dataset: places are fitted, nothing is solved."""
    from geometry import json_text
    from workbench.cell import ProfileSettings, observe, verify_cell
    from workbench.files import read_cell, read_result, read_settings

    settings = read_settings(config or [])
    saved = None if scp is None else read_result(scp)
    cell = read_cell(dataset)
    with progress_bar("extracting", len(cell.frames)) as progress:
        observed = observe(cell, settings.extraction, progress, ProfileSettings.of(settings))
    found = verify_cell(cell, observed, saved, settings.calib)
    code, text = _judged(found, max_rms_mm)
    if as_json:
        from workbench.report import inputs_of

        given = {"max_rms_mm": max_rms_mm, "inputs": inputs_of(cell)}
        say_on_stdout(json_text(_object(found, code, text, observed.complaints) | given))
    else:
        _show(found, code, text)
    exits = {"above_limit": exit_codes.THRESHOLD, "no_figures": exit_codes.NO_ANSWER}
    if code in exits:
        raise typer.Exit(exits[code])


def _judged(found: Verification, limit_mm: float | None) -> tuple[str, str]:
    """ok, above_limit, or no_figures where no location has three frames to judge by."""
    rms = found.largest_rms_mm
    if rms is None:
        return "no_figures", "no location has three frames that can be used: nothing is judged"
    if limit_mm is not None and rms > limit_mm:
        return "above_limit", f"the largest point rms of a location, {rms:.3f} mm, exceeds {limit_mm:g} mm"
    words = "" if limit_mm is None else f", the limit is {limit_mm:g} mm"
    return "ok", f"the largest point rms of a location is {rms:.3f} mm{words}"


def _object(found: Verification, code: str, text: str, complaints: dict[int, str]) -> dict[str, Any]:
    from calib import frame_object, location_object

    return {
        "verdict": {"code": code, "text": text},
        "T_hand_sensor": found.T_hand_sensor.matrix,
        "rotation_deg": found.T_hand_sensor.fixed_xyz_deg,
        "translation_mm": found.T_hand_sensor.t,
        "largest_point_rms_mm": found.largest_rms_mm,
        "locations": {name: location_object(p) for name, p in found.locations.items()},
        "left_out": {"by": "frame", "point_rms_mm": found.left_out_mm},
        "frames": [frame_object(f, complaints.get(f.number)) for f in found.frames],
        "notes": found.notes,
    }


def _show(found: Verification, code: str, text: str) -> None:
    from workbench.report import arrow, number

    console = standard_output()
    table = Table(title="Locations, design → this SCP, in mm", title_justify="left")
    for heading in ("location", "frames", "distance deviation, max", "3-D spread, max", "point rms", "frames left out"):
        table.add_column(heading, justify="left" if heading == "location" else "right")
    for name, p in found.locations.items():
        own = [f for f in found.frames if f.location == name]
        figures = [arrow(f) for f in (p.max_deviation_mm, p.spread_3d_mm, p.point_rms_mm)]
        used = f"{sum(f.used for f in own)} of {len(own)}"
        table.add_row(escape(name), used, *figures, number(found.left_out_mm.get(name), 3))
    console.print(table)
    for f in found.frames:
        if not f.used:
            console.print(f"frame {f.number} not used: {f.reason}", markup=False)
    for note in found.notes:
        console.print(f"note: {note}", markup=False, soft_wrap=True)
    console.print(f"verdict: {code}", markup=False)
    console.print(text, markup=False, soft_wrap=True)
