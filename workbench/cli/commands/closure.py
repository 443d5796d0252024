"""A ball seated in sockets, joint readings alone: does calibrating the robot pay?"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import numpy as np
import typer
from rich.table import Table

from workbench.cli.console import say_on_stdout, standard_output

if TYPE_CHECKING:
    from calib.closure import ClosureResult

MIN_LOCATIONS = 2  # one alone can not be left out


def command(
    joints: Annotated[
        list[Path],
        typer.Argument(
            metavar="JOINTS.csv...",
            help="One file a socket, a row a configuration; the folder's name is the base's location.",
        ),
    ],
    robot: Annotated[str, typer.Option(help="robot.toml or preset (franka_panda, kuka_iiwa14, …).")],
    distance_mm: Annotated[
        float | None,
        typer.Option(min=0.0, max=1e5, help="Distance of a base's two sockets; without it the scale is open."),
    ] = None,
    degrees: Annotated[bool, typer.Option("--degrees", help="The files hold degrees, not radians.")] = False,
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON object on standard output.")] = False,
) -> None:
    """Fit tool and robot to a point that stands still, and judge the robot on locations that it did not see."""
    from calib.closure import closure
    from workbench.cell import find_robot
    from workbench.files import read_sockets
    from workbench.report import json_text

    arm = find_robot(robot)
    result = closure(read_sockets(joints, arm.n_joints, degrees=degrees), arm, distance_mm)
    if as_json:
        say_on_stdout(json_text(_object(result)))
    else:
        _show(result)


def _object(result: ClosureResult) -> dict[str, Any]:
    held_out = [
        {"location": h.location, "nominal_rms_mm": h.nominal_mm, "calibrated_rms_mm": h.calibrated_mm}
        for h in result.held_out
    ]
    return {
        "verdict": {"code": _verdict(result), "text": result.text},
        "text": result.text,
        "gains": result.gains,
        "gain_mm2": {"mean": result.gain_mm2[0], "standard_error": result.gain_mm2[1]},
        "rms_mm": {"nominal": result.nominal.rms_mm, "calibrated": result.calibrated.rms_mm},
        "held_out": held_out,
        "kept": "calibrated" if result.gains else "nominal",
        "chi2_per_dof": result.keep.chi2_per_dof,
        "tool_mm": result.keep.tool_mm,
        "tool_sigma_mm": np.sqrt(np.diag(result.keep.tool_covariance)),
        "tool_covariance_mm2": result.keep.tool_covariance,
    }


def _show(result: ClosureResult) -> None:
    console = standard_output()
    table = Table("held-out location", "nominal rms, mm", "calibrated rms, mm", title="Predicted from the others")
    for h in result.held_out:
        table.add_row(h.location, f"{h.nominal_mm:.3f}", f"{h.calibrated_mm:.3f}")
    console.print(table)
    console.print(f"all sockets: {result.nominal.rms_mm:.3f} → {result.calibrated.rms_mm:.3f} mm", markup=False)
    sigmas = np.sqrt(np.diag(result.keep.tool_covariance))
    numbers = ", ".join(f"{v:.2f} ± {e:.2f}" for v, e in zip(result.keep.tool_mm, sigmas, strict=True))
    which = "calibrated" if result.gains else "nominal"
    console.print(f"tool in the hand, {which} robot: {numbers} mm (σ)", markup=False, soft_wrap=True)
    console.print(f"χ² per degree of freedom {result.keep.chi2_per_dof:.1f}", markup=False)
    console.print(f"verdict: {_verdict(result)}", markup=False)
    console.print(result.text, markup=False, soft_wrap=True)


def _verdict(result: ClosureResult) -> str:
    """ok: the calibrated robot is to be used; no_gain: the nominal one; too_few_locations: nothing could be judged."""
    if not result.keep.converged:
        return "not_converged"
    if len(result.held_out) < MIN_LOCATIONS:
        return "too_few_locations"
    return "ok" if result.gains else "no_gain"
