"""All jig poses that fit a frame's points."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from rich.table import Table

from workbench.cli import exit_codes
from workbench.cli.console import say_on_stdout, standard_output

if TYPE_CHECKING:
    from workbench.cell import FramePose

SHOWN = 6


def command(
    points: Annotated[Path, typer.Argument(metavar="POINTS.csv", help="Points as `extract` writes them.")],
    jig: Annotated[str | None, typer.Option(help="jig.toml or preset; default: jig.toml beside the points.")] = None,
    sensor: Annotated[
        str | None,
        typer.Option(help="sensor.toml or preset, for unlabelled points; default: beside the points."),
    ] = None,
    frame: Annotated[int | None, typer.Option(min=0, help="Only this frame.")] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON object on standard output.")] = False,
) -> None:
    """Show every pose of the jig in the sensor that explains a frame's points, with its likelihood."""
    from geometry import json_text
    from workbench.cell import frame_poses

    poses = frame_poses(points, jig, sensor, frame)
    if as_json:
        say_on_stdout(json_text({"frames": [_object(p) for p in poses]}))
    else:
        for pose in poses:
            _show(pose)
    if all(p.result is None for p in poses):
        raise typer.Exit(exit_codes.NO_ANSWER)


def _object(pose: FramePose) -> dict[str, Any]:
    if pose.result is None:
        return {"frame": pose.frame, "reason": pose.reason, "candidates": []}
    return {
        "frame": pose.frame,
        "reason": None,
        "ambiguity": pose.result.ambiguity,
        "condition": pose.result.condition,
        "dof": pose.result.dof,
        "candidates": [
            {
                "T_sensor_jig": c.T_sensor_jig.matrix,
                "likelihood": c.likelihood,
                "chi2": c.cost,
                "max_residual_mm": float(abs(c.residuals_mm).max()) if len(c.residuals_mm) else None,
                "covariance": c.covariance,
            }
            for c in pose.result.candidates
        ],
        "weak_directions": [{"tangent": w.tangent, "sigma_mm": w.sigma_mm} for w in pose.result.weak],
    }


def _show(pose: FramePose) -> None:
    console = standard_output()
    if pose.result is None:
        console.print(f"frame {pose.frame}: no pose, {pose.reason}", markup=False, soft_wrap=True)
        return
    table = Table(title=f"frame {pose.frame}: T_sensor_jig, {pose.words}", title_justify="left")
    for heading in ("likelihood", "χ²", "x", "y", "z \\[mm]", "rot X", "rot Y", "rot Z \\[°]", "max residual \\[mm]"):
        table.add_column(heading, justify="right")
    for c in pose.result.candidates[:SHOWN]:
        numbers = [*c.T_sensor_jig.t, *c.T_sensor_jig.fixed_xyz_deg]
        residual = f"{abs(c.residuals_mm).max():.4f}" if len(c.residuals_mm) else "–"
        table.add_row(f"{c.likelihood:.4f}", f"{c.cost:.2f}", *(f"{v:z.3f}" for v in numbers), residual)
    console.print(table)
