"""The result of calibrate as the JSON object of docs/formats.md: null never NaN, ASCII labels, every frame."""

from __future__ import annotations

import json
import math
from typing import Any

import numpy as np

from calib import CalibrationResult, DesignSolved, LocationResult
from geometry import CONVENTIONS, Frame, express
from workbench.files import Cell, rounded, sha256_of


def calibration_object(
    result: CalibrationResult, complaints: dict[int, str] | None = None, cell: Cell | None = None
) -> dict[str, Any]:
    """The object that ``calibrate --json`` prints (docs/formats.md).

    Parameters
    ----------
    result
        The answer.
    complaints
        What was wrong with a frame's image, by frame.
    cell
        The dataset, whose files are named with their hashes.

    Returns
    -------
    dict
        Plain JSON values, None where there is no number.

    """
    pose = result.T_hand_sensor
    out: dict[str, Any] = clean(
        {
            "method": result.method,
            "model": result.model,
            "verdict": {"code": result.verdict.code, "text": result.verdict.text},
            "chi2_per_dof": result.chi2_per_dof,
            "T_hand_sensor": None if pose is None else pose.matrix,
            "rotation_deg": None if pose is None else pose.fixed_xyz_deg,
            "translation_mm": None if pose is None else pose.t,
            "sigma_rotation_deg": result.sigma_rotation_deg,
            "sigma_translation_mm": result.sigma_translation_mm,
            "covariance": result.covariance,
            "design": {
                "rotation_deg": result.T_hand_sensor_design.fixed_xyz_deg,
                "translation_mm": result.T_hand_sensor_design.t,
            },
            "conventions": {} if pose is None else {name: express(pose, name) for name in CONVENTIONS},
            "convention_formulas": {name: f"{c.maker}: {c.formula}" for name, c in CONVENTIONS.items()},
            "locations": {name: location_object(location) for name, location in result.locations.items()},
            "frames": [frame_object(frame, (complaints or {}).get(frame.number)) for frame in result.frames],
            "solution": _solution(result),
            "inputs": [] if cell is None else inputs_of(cell),
            "weak_directions": result.weak_directions,
            "notes": result.notes,
        }
    )
    return out


def inputs_of(cell: Cell) -> list[dict[str, str]]:
    """The files of a dataset, by their names from its folder, with the SHA-256 of their bytes; images aside."""
    found = []
    for path in cell.files:
        name = path.relative_to(cell.folder) if path.is_relative_to(cell.folder) else path
        what = {cell.sensor_path: "sensor", cell.robot_path: "robot"}.get(path)
        row = {"file": name.as_posix(), "sha256": sha256_of(path)}
        found.append(row | ({"kind": what} if what else {}))
    return found


def _solution(result: CalibrationResult) -> dict[str, Any]:
    e = result.estimate
    return {
        "converged": e is not None and e.converged,
        "iterations": 0 if e is None else e.iterations,
        "initial_cost": None if e is None else e.initial_cost,
        "final_cost": None if e is None else e.final_cost,
        "degrees_of_freedom": 0 if e is None else e.degrees_of_freedom,
        "condition": None if e is None else e.condition,
        "noise": {} if e is None else e.noise,
    }


def location_object(location: LocationResult) -> dict[str, Any]:
    """Figures and place of one location."""
    return {
        "role": location.role,
        "T_base_jig": None if location.T_base_target is None else location.T_base_target.matrix,
        "max_deviation_mm": _both(location.max_deviation_mm),
        "spread_3d_mm": _both(location.spread_3d_mm),
        "point_rms_mm": _both(location.point_rms_mm),
        "distances": {
            "frame": location.distances.frame,
            "design_mm": location.distances.design_mm,
            "solved_mm": location.distances.solved_mm,
        },
    }


def _both(pair: DesignSolved) -> dict[str, float | None]:
    return {"design": pair.design, "solved": pair.solved}


def frame_object(frame: Frame, complaint: str | None) -> dict[str, Any]:
    """One frame with its points, and the sentence about its image where that could not be used."""
    out = {
        "frame": frame.number,
        "location": frame.location,
        "role": frame.role,
        "image": frame.image,
        "used": frame.used,
        "reason": frame.reason,
        "points": [_point(frame, i) for i in range(len(frame.axis))],
    }
    return out | ({"complaint": complaint} if complaint else {})


def _point(frame: Frame, i: int) -> dict[str, Any]:
    (u, v), (y, z), (sigma_y, sigma_z) = frame.axis_uv_px[i], frame.axis.yz_mm[i], frame.axis.sigma_yz_mm[i]
    return {
        "label": frame.axis.label[i],
        "u_px": u,
        "v_px": v,
        "y_mm": y,
        "z_mm": z,
        "sigma_y_mm": sigma_y,
        "sigma_z_mm": sigma_z,
        "residual_mm": frame.residual_mm[i],
        "flag": frame.axis.flag[i],
    }


def clean(value: Any) -> Any:
    """Plain JSON values: arrays as lists, numpy numbers as numbers, what is not finite as None."""
    if isinstance(value, dict):
        return {str(k): clean(v) for k, v in value.items()}
    if isinstance(value, np.ndarray):
        return clean(value.tolist())
    if isinstance(value, list | tuple):
        return [clean(v) for v in value]
    if isinstance(value, np.generic):
        return clean(value.item())
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    return value


def json_text(value: Any, indent: int | None = 1) -> str:
    """One JSON object as ASCII text without NaN, its numbers rounded so that every processor writes the same."""
    return json.dumps(rounded(clean(value)), indent=indent, allow_nan=False)
