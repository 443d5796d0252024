"""A ball seated in sockets, joint readings alone: does calibrating the robot pay?"""

from __future__ import annotations

import tomllib
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import numpy as np
import typer
from rich.table import Table

from workbench.cli import exit_codes
from workbench.cli.console import say_on_stdout, standard_output

if TYPE_CHECKING:
    from calib.closure import ClosureResult, Socket

CLOSES_BETTER = 0.2  # of the rms that the stated robot leaves: another preset is named
SHOWN_PULLS = 5


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
    out: Annotated[Path | None, typer.Option(help="File for the robot that is kept, as robot.toml.")] = None,
) -> None:
    """Fit tool and robot to a point that stands still, and judge the robot on locations that it did not see."""
    from calib.closure import closure
    from geometry import json_text, require_arm
    from workbench.cell import find_robot
    from workbench.files import read_sockets, robot_text

    arm = find_robot(robot)
    sockets = read_sockets(joints, arm.n_joints, degrees=degrees)
    result = closure(sockets, arm, distance_mm)
    text = result.text
    if result.code == "robot_contradicts":
        text += _better(sockets, result.nominal.rms_mm, arm.n_joints)
    kept = require_arm(result.keep.robot)
    if out is not None and result.trustworthy:
        from workbench.files import write_text

        write_text(out, robot_text(kept))
    if as_json:
        say_on_stdout(json_text(_object(result, text) | {"robot": tomllib.loads(robot_text(kept))}))
    else:
        _show(result, text)
    if not result.trustworthy:
        raise typer.Exit(exit_codes.NO_ANSWER)


def _better(sockets: list[Socket], rms_mm: float, n_joints: int) -> str:
    """The preset that closes the sockets far better, if there is one."""
    import assets
    from calib.closure import closing_rms
    from workbench.cell import find_robot

    arms = {name: find_robot(name) for name in assets.list_presets("robots")}
    rms = {name: closing_rms(sockets, arm) for name, arm in arms.items() if arm.n_joints == n_joints}
    best = min(rms, key=lambda name: rms[name], default="")
    return (
        f"; the preset {best} closes them to {rms[best]:.2f} mm" if best and rms[best] < CLOSES_BETTER * rms_mm else ""
    )


def _object(result: ClosureResult, text: str) -> dict[str, Any]:
    keep = result.keep
    held_out = [
        {
            "location": h.location,
            "nominal_rms_mm": h.nominal_mm,
            "calibrated_rms_mm": h.calibrated_mm,
            "predicted_sigma_mm": result.widened * (h.calibrated_sigma_mm if result.gains else h.nominal_sigma_mm),
        }
        for h in result.held_out
    ]
    distance = result.found_distance_mm
    return {
        "verdict": {"code": result.code, "text": text},
        "text": text,
        "gains": result.gains,
        "gain_mm2": {"mean": result.gain_mm2[0], "standard_error": result.gain_mm2[1]},
        "rms_mm": {"nominal": result.nominal.rms_mm, "calibrated": result.calibrated.rms_mm},
        "held_out": held_out,
        "kept": "calibrated" if result.gains else "nominal",
        "chi2_per_dof": keep.chi2_per_dof,
        "pulls": [
            {"block": "robot", "parameter": p.parameter, "size": p.size, "unit": p.unit, "pull_sigma": p.pull_sigma}
            for p in result.pulls[:SHOWN_PULLS]
        ],
        "found_distance_mm": None if distance is None else {"value": distance[0], "sigma": distance[1]},
        "tool_mm": keep.tool_mm if result.trustworthy else None,
        "tool_sigma_mm": np.sqrt(np.diag(result.tool_covariance)) if result.trustworthy else None,
        "tool_covariance_mm2": result.tool_covariance if result.trustworthy else None,
        "predicted_sigma_mm": result.predicted_sigma_mm if result.trustworthy else None,
        "sigma_widened": result.widened,
    }


def _show(result: ClosureResult, text: str) -> None:
    console = standard_output()
    table = Table("held-out location", "nominal rms, mm", "calibrated rms, mm", title="Predicted from the others")
    for h in result.held_out:
        table.add_row(h.location, f"{h.nominal_mm:.3f}", f"{h.calibrated_mm:.3f}")
    console.print(table)
    console.print(f"all sockets: {result.nominal.rms_mm:.3f} → {result.calibrated.rms_mm:.3f} mm", markup=False)
    if result.trustworthy:
        sigmas = np.sqrt(np.diag(result.tool_covariance))
        numbers = ", ".join(f"{v:.2f} ± {e:.2f}" for v, e in zip(result.keep.tool_mm, sigmas, strict=True))
        which = "calibrated" if result.gains else "nominal"
        console.print(f"tool in the hand, {which} robot: {numbers} mm (σ)", markup=False, soft_wrap=True)
        if result.predicted_sigma_mm is not None:
            console.print(f"σ of positions predicted elsewhere: {result.predicted_sigma_mm:.3f} mm", markup=False)
    pulls = ", ".join(
        f"{p.parameter} {p.size:+.3g} {p.unit} ({p.pull_sigma:+.1f} σ)" for p in result.pulls[:SHOWN_PULLS]
    )
    console.print(f"largest corrections: {pulls}", markup=False, soft_wrap=True)
    console.print(f"χ² per degree of freedom {result.keep.chi2_per_dof:.1f}", markup=False)
    console.print(f"verdict: {result.code}", markup=False)
    console.print(text, markup=False, soft_wrap=True)
