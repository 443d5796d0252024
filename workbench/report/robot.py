"""The corrected robot as a file of the kind it came from."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from calib import CalibrationResult
from geometry import require_arm
from workbench.files import Cell, robot_text, urdf_of, write_text


def write_corrected_robot(out: Path, cell: Cell, result: CalibrationResult) -> None:
    """Write robot_corrected.toml, or robot_corrected.urdf for a robot from a URDF; nothing where nothing changed."""
    if result.robot is None or not result.verdict.trustworthy or not np.any(result.robot_delta):
        return
    table = require_arm(result.robot).dh_part()
    urdf = None if cell.robot_path is None else urdf_of(cell.robot_path)
    if urdf is None:
        write_text(out / "robot_corrected.toml", robot_text(table))
        return
    from workbench.files import write_urdf

    write_urdf(urdf.path, urdf.base, urdf.tip, table, out / "robot_corrected.urdf")
