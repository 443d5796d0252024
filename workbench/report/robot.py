"""The corrected robot as a file of the kind it came from."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from calib import CalibrationResult
from geometry import DH_ROWS, DhRobot, compliant_part, require_arm
from geometry.robot import GROUP as COMPLIANCE
from workbench.files import Cell, robot_text, urdf_of, write_text

_DECIMALS = 9  # of degrees and mm: some 1e-8 mm at the hand of a large arm


def write_corrected_robot(out: Path, cell: Cell, result: CalibrationResult) -> None:
    """Write robot_corrected.toml, or robot_corrected.urdf for a robot from a URDF; nothing where nothing changed."""
    if result.robot is None or not result.verdict.trustworthy or not np.any(result.robot_delta):
        return
    arm = require_arm(result.robot)
    table, compliant = _rounded(arm.dh_part()), compliant_part(arm)
    urdf = None if cell.robot_path is None else urdf_of(cell.robot_path)
    if urdf is None:
        whole = table if compliant is None else replace(compliant, robot=table)
        write_text(out / "robot_corrected.toml", _beside_the_table(result) + robot_text(whole))
        return
    from workbench.files import write_urdf

    write_urdf(urdf.path, urdf.base, urdf.tip, table, out / "robot_corrected.urdf")


def _beside_the_table(result: CalibrationResult) -> str:
    """Comments that name what was estimated of the robot and has no place in its file."""
    in_table = {row.group for row in DH_ROWS} | {COMPLIANCE}
    parameters = () if result.robot is None else result.robot.parameters
    rest = [(p, v) for p, v in zip(parameters, result.robot_delta, strict=True) if p.group not in in_table and v]
    if not rest:
        return ""
    lines = ["# The answer holds more than this table, which without it is not the robot that was solved:"]
    lines += [f"# {p.name} {v:+.6g} {p.unit}".rstrip() for p, v in rest]
    return "\n".join(lines) + "\n"


def _rounded(robot: DhRobot) -> DhRobot:
    """The table rounded in its file's units, so that every processor writes the same."""
    shown: dict[str, Any] = {
        row.column: np.round(row.to_file(getattr(robot, row.column)), _DECIMALS) + 0.0 for row in DH_ROWS
    }
    columns: dict[str, Any] = {row.column: row.from_file(shown[row.column]) for row in DH_ROWS}
    return replace(robot, **columns)
