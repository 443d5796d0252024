"""What came out of a trial against its truth, as table rows."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from calib import CalibConfig, CalibrationResult
from calib.label import label_frame
from geometry import Frame, Pose, Sensor
from jig_cad import Jig
from perceptron_emu import RenderedFrame
from workbench.campaign.trial.emulated import VERIFY, EmulatedCell
from workbench.compare import Comparison, NamedPoints, Statistics, match, summarise, true_strings

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class TrialFrame:
    """One frame's labelled points and its own pose."""

    used: bool
    reason: str | None
    points: NamedPoints
    T_sensor_jig: Pose | None


@dataclass(frozen=True, eq=False)
class Outcome:
    """All frames, and the calibration where one was run."""

    frames: tuple[TrialFrame, ...]
    result: CalibrationResult | None


def labelled_only(frames: Sequence[Frame], sensor: Sensor, jig: Jig, config: CalibConfig) -> Outcome:
    """Every frame labelled by itself from the jig's geometry alone, no robot."""
    out = []
    for frame in frames:
        found = label_frame(frame.points, jig, sensor, None, config)
        uv = frame.points.uv_px[found.axis.spot] if len(found.axis) else np.zeros((0, 2))
        points = NamedPoints(found.axis.label, uv, found.axis.yz_mm)
        out.append(TrialFrame(found.reason is None, found.reason, points, found.T_sensor_jig))
    return Outcome(tuple(out), None)


def calibrated(result: CalibrationResult) -> Outcome:
    """Every frame as calibration used it."""
    frames = tuple(
        TrialFrame(f.used, f.reason, NamedPoints(f.axis.label, f.axis_uv_px, f.axis.yz_mm), f.T_sensor_target)
        for f in result.frames
    )
    return Outcome(frames, result)


@dataclass(frozen=True, eq=False)
class ScoredFrame:
    """A frame's row of the table, and the comparison that the trial's row sums up."""

    row: dict[str, Any]
    compared: Comparison


def score_frames(emulated: EmulatedCell, frames: Sequence[RenderedFrame], outcome: Outcome) -> list[ScoredFrame]:
    """Every frame against its truth."""
    scored = []
    for configuration, frame, answer in zip(emulated.configurations, frames, outcome.frames, strict=True):
        truth = frame.truth
        true_pose = truth.T_sensor_jig or Pose.identity()
        found = answer if outcome.result is not None else _as_turned(answer, true_pose, emulated.cell.jig)
        compared = match(true_strings(truth.strings), found.points, labelled=True)
        figures = summarise([compared])
        row: dict[str, Any] = {
            "frame": configuration.frame,
            "location": configuration.location,
            "role": configuration.role,
            "used": found.used,
            "reason": found.reason,
            "joints_deg": np.rad2deg(configuration.reading_rad).tolist(),
            "T_sensor_jig_true": true_pose.matrix.ravel().tolist(),
            "tilt_deg": _tilt_deg(true_pose),
            "visible": figures.visible,
            "found": figures.found,
            "false_points": figures.false,
            "mislabelled": figures.mislabelled,
        }
        scored.append(ScoredFrame(row | _errors(figures) | _pose_error(found.T_sensor_jig, true_pose), compared))
    return scored


def _as_turned(found: TrialFrame, true_pose: Pose, jig: Jig) -> TrialFrame:
    """A frame labelled by itself, named as its truth is: points alone can never tell the jig's symmetries."""
    if found.T_sensor_jig is None:
        return found
    best, nearest = found, float(np.sum(found.T_sensor_jig.R * true_pose.R))
    for turn in jig.symmetries:
        turned = found.T_sensor_jig @ turn.pose
        near = float(np.sum(turned.R * true_pose.R))  # grows with the cosine of the angle between them
        if near > nearest:
            renamed = replace(found.points, label=tuple(turn.relabelled(n) for n in found.points.label))
            best, nearest = replace(found, points=renamed, T_sensor_jig=turned), near
    return best


def trial_row(emulated: EmulatedCell, scored: Sequence[ScoredFrame], outcome: Outcome) -> dict[str, Any]:
    """The trial's row: sums over frames, and the calibration against the true SCP."""
    rows = [s.row for s in scored]
    row: dict[str, Any] = {
        "frames_used": sum(r["used"] for r in rows),
        "spots_visible": sum(r["visible"] for r in rows),
        "spots_found": sum(r["found"] for r in rows),
        "points_false": sum(r["false_points"] for r in rows),
        "points_mislabelled": sum(r["mislabelled"] for r in rows),
        "tilt_max_deg": max((r["tilt_deg"] for r in rows), default=None),
        "pose_rms_mm": _rms([r["pose_error_mm"] for r in rows]),
        "pose_rms_deg": _rms([r["pose_error_deg"] for r in rows]),
        "T_hand_sensor_true": emulated.true.T_hand_sensor.matrix.ravel().tolist(),
    }
    row |= {f"point_{name}": value for name, value in _errors(summarise(s.compared for s in scored)).items()}
    if outcome.result is None:
        return row | {"verdict": "ok" if row["frames_used"] == len(rows) else "not_labelled"}
    return row | _calibration(outcome.result, emulated.true.T_hand_sensor)


def _calibration(result: CalibrationResult, true: Pose) -> dict[str, Any]:
    row: dict[str, Any] = {"verdict": result.verdict.code, "message": result.verdict.text}
    row["chi2_per_dof"] = result.chi2_per_dof
    check = result.locations.get(VERIFY)
    if check is not None:
        row["verify_max_deviation_mm"] = check.max_deviation_mm.solved
        row["verify_point_rms_mm"] = check.point_rms_mm.solved
    if result.T_hand_sensor is None or result.covariance is None:
        return row
    xi = (result.T_hand_sensor.inverse() @ true).log()
    cov = result.covariance
    return row | {
        "error_mm": float(np.linalg.norm(result.T_hand_sensor.t - true.t)),
        "error_deg": float(np.rad2deg(np.linalg.norm(xi[3:]))),
        "nees": float(xi @ np.linalg.solve(cov, xi)),
        "error": xi.tolist(),
        "covariance": cov.ravel().tolist(),
        "T_hand_sensor": result.T_hand_sensor.matrix.ravel().tolist(),
        "sigma_mm": float(np.sqrt(np.trace(cov[:3, :3]))),
        "sigma_deg": float(np.rad2deg(np.sqrt(np.trace(cov[3:, 3:])))),
    }


def _errors(figures: Statistics) -> dict[str, float]:
    """Bias and rms of the axis points; nothing where none was found."""
    if not figures.found:
        return {}
    (by, bz), (ry, rz) = figures.bias_mm, figures.rms_yz_mm
    return {"bias_y_mm": by, "bias_z_mm": bz, "rms_y_mm": ry, "rms_z_mm": rz}


def _pose_error(found: Pose | None, true: Pose) -> dict[str, float | None]:
    """Distance of the jig's origin and angle; None where the frame has no pose of its own."""
    if found is None:
        return {"pose_error_mm": None, "pose_error_deg": None}
    xi = (found.inverse() @ true).log()
    return {
        "pose_error_mm": float(np.linalg.norm(found.t - true.t)),
        "pose_error_deg": float(np.rad2deg(np.linalg.norm(xi[3:]))),
    }


def _tilt_deg(T_sensor_jig: Pose) -> float:
    """Angle between the laser plane's normal and the pillar."""
    return float(np.rad2deg(np.arccos(min(1.0, abs(T_sensor_jig.R[0, 0])))))


def _rms(values: Sequence[float | None]) -> float | None:
    known = np.array([v for v in values if v is not None], dtype=float)
    return float(np.sqrt(np.mean(known**2))) if len(known) else None
