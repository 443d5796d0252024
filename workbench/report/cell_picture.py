"""The picture of a calibrated cell, where off-screen OpenGL is there to draw it."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from calib import CalibrationResult
from geometry import Frame, MissingDependencyError, Pose, require_arm, target_at
from jig_cad import Jig
from perceptron_emu.gl import CellView, cell_picture
from workbench.files import Cell

Picture = NDArray[np.uint8]


def cell_image(cell: Cell, result: CalibrationResult) -> tuple[Picture | None, str]:
    """The picture (H, W, 3), RGB, and ""; or None and the one line that says why there is none."""
    output = cell.sensor.profile
    if output is not None and output.field_of_view_mm is None:
        return None, "no picture of the cell: [profile] field_of_view_mm of its sensor is not known"
    view = cell_view(cell, result)
    if view is None:
        return None, "no picture of the cell: no frame of it was used"
    try:
        return cell_picture(view), ""
    except MissingDependencyError as error:
        return None, f"no picture of the cell: {error}"


def cell_view(cell: Cell, result: CalibrationResult) -> CellView | None:
    """The cell at its first used frame: solved arm, SCP and jigs, each by design or as given where it is not solved."""
    used = {f.number for f in result.frames if f.used}
    row = next((r for r in cell.frames if r.number in used), None)
    if row is None:
        return None
    hand, links = _arm(cell, result, row)
    if hand is None:
        return None
    jigs = {name: place for name, place in cell.T_base_jig.items() if name in result.locations}
    jigs |= {name: found.T_base_target for name, found in result.locations.items() if found.T_base_target is not None}
    T_hand_sensor = result.T_hand_sensor or result.T_hand_sensor_design
    if T_hand_sensor is None:
        return None
    strings = ((target_at(cell.target, name), place) for name, place in jigs.items())
    drawn = tuple((target, place) for target, place in strings if isinstance(target, Jig))
    return CellView(cell.sensor, hand @ T_hand_sensor, drawn, links)


def _arm(cell: Cell, result: CalibrationResult, row: Frame) -> tuple[Pose | None, Pose | None]:
    """T_base_hand and the chain's frames, base first, hand last; no chain where only hand poses were recorded."""
    if row.joints_rad is None:
        return row.T_base_hand, None
    robot = require_arm(result.robot or cell.arm)
    links, hand = robot.link_poses(row.joints_rad), robot.pose(row.joints_rad)
    return hand, Pose(np.concatenate([links.R, hand.R[None]]), np.concatenate([links.t, hand.t[None]]))
