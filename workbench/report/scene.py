"""The calibrated cell as lines, sheets and points in the base, for the 3-D view of the window and of the report."""

from __future__ import annotations

from importlib.resources import files
from typing import Any

import numpy as np
from numpy.typing import NDArray

from calib import CalibrationResult
from geometry import Frame, Pose, Target, require_arm, target_at
from jig_cad import Balls, Jig, Plane, Sphere
from workbench.cell import field_of_view_of
from workbench.files import Cell

Array = NDArray[np.float64]

DIGITS = 2  # of a millimetre: a screen shows no more
ROUND = 24  # sides of a circle that is drawn
PLATE_MM, EDGE_MM = 90.0, 120.0  # half sizes of what has none of its own
MOST_POINTS = 60  # of a frame: a stripe's are thinned to so many


def scene_object(cell: Cell, result: CalibrationResult) -> dict[str, Any]:
    """The scene in mm in the base.

    Parameters
    ----------
    cell
        The dataset.
    result
        Its solution.

    Returns
    -------
    dict
        targets by location with their lines; for each frame with a known hand the arm's joints, the sheet's outline
        from the laser on, the measured points and their residuals.

    """
    T_hand_sensor = result.T_hand_sensor or result.T_hand_sensor_design
    frames = [] if T_hand_sensor is None else [_frame(cell, result, f, T_hand_sensor) for f in result.frames]
    places = {n: p.T_base_target for n, p in result.locations.items() if p.T_base_target is not None}
    targets = [
        {
            "location": name,
            "role": result.locations[name].role,
            "lines": _rounded(_lines(target_at(cell.target, name), place)),
        }
        for name, place in places.items()
    ]
    if cell.mount == "fixed":  # the hand carries the targets: each frame has its own
        targets = []
    return {"targets": targets, "frames": [f for f in frames if f is not None]}


def scene_script() -> str:
    """The 3-D view's program: `startScene(canvas, scene, colours)`."""
    return (files("workbench.report") / "scene.js").read_text(encoding="utf-8")


def _frame(cell: Cell, result: CalibrationResult, frame: Frame, T_hand_sensor: Pose) -> dict[str, Any] | None:
    hand, joints = _arm(cell, result, frame)
    if hand is None:
        return None
    fixed = cell.mount == "fixed"
    sensor = T_hand_sensor if fixed else hand @ T_hand_sensor
    carried = result.locations[frame.location].T_base_target if fixed and frame.location in result.locations else None
    target = None if carried is None else _lines(target_at(cell.target, frame.location), hand @ carried)
    outline = field_of_view_of(cell.sensor)
    sheet = np.zeros((0, 3)) if outline is None else sensor @ _in_sheet(np.asarray(outline))
    points, residuals = frame.axis.yz_mm, frame.residual_mm
    step = max(1, -(-len(points) // MOST_POINTS))
    on = sensor @ _in_sheet(points[::step]) if len(points) else np.zeros((0, 3))
    finite = residuals[np.isfinite(residuals)]
    return {
        "frame": frame.number,
        "location": frame.location,
        "used": frame.used,
        "rms": round(float(np.sqrt(np.mean(finite**2))), 4) if len(finite) else None,
        "arm": _rounded(joints),
        "sensor": _rounded(sensor.t[None])[0],
        "laser": _rounded((sensor @ np.asarray(cell.sensor.sheet.origin_mm))[None])[0],
        "sheet": _rounded(sheet),
        "points": _rounded(on),
        "target": [] if target is None else _rounded(target),
    }


def _in_sheet(yz: Array) -> Array:
    return np.insert(yz, 0, 0.0, axis=1)


def _arm(cell: Cell, result: CalibrationResult, frame: Frame) -> tuple[Pose | None, Array]:
    """T_base_hand and where the joints are, the hand last."""
    if frame.joints_rad is None or cell.robot is None:
        hand = frame.T_base_hand
        return hand, np.zeros((0, 3)) if hand is None else hand.t[None]
    robot = require_arm(result.robot or cell.robot)
    hand = robot.pose(frame.joints_rad)
    return hand, np.vstack([robot.link_poses(frame.joints_rad).t, hand.t[None]])


def _lines(target: Target, T: Pose) -> Array:
    """A target's lines (N, 2, 3) in the base."""
    if isinstance(target, Jig):
        lines = np.stack([target.anchors_mm[target.start_index], target.anchors_mm[target.end_index]], axis=1)
    elif isinstance(target, Sphere):
        lines = _circles(target.diameter_mm / 2)
    elif isinstance(target, Balls):
        around = [_circles(d / 2) + c for c, d in zip(target.centres_mm, target.diameters_mm.tolist(), strict=True)]
        lines = np.concatenate(around)
    elif isinstance(target, Plane):
        corners = PLATE_MM * np.array([(-1, -1, 0), (1, -1, 0), (1, 1, 0), (-1, 1, 0)], dtype=float)
        lines = np.stack([corners, np.roll(corners, -1, axis=0)], axis=1)
    else:  # an edge, a ridge, an axis
        lines = EDGE_MM * np.array([[(-1.0, 0.0, 0.0), (1.0, 0.0, 0.0)]])
    return (T @ lines.reshape(-1, 3)).reshape(-1, 2, 3)


def _circles(radius: float) -> Array:
    """Three great circles."""
    angle = np.linspace(0, 2 * np.pi, ROUND + 1)
    flat = radius * np.column_stack([np.cos(angle), np.sin(angle), np.zeros_like(angle)])
    rings = [flat, flat[:, [2, 0, 1]], flat[:, [1, 2, 0]]]
    return np.concatenate([np.stack([ring[:-1], ring[1:]], axis=1) for ring in rings])


def _rounded(points: Array) -> list[Any]:
    out: list[Any] = np.round(points, DIGITS).tolist()
    return out
