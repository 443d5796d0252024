"""The answer of calibrate as one JSON object: null never NaN, ASCII labels, every frame."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from calib.printed import printed_sigmas
from geometry import CONVENTIONS, Frame, Pose, clean, express

if TYPE_CHECKING:
    from calib.result import CalibrationResult, DesignSolved, LocationResult, Pull


def result_object(
    result: CalibrationResult,
    complaints: Mapping[int, str] | None = None,
    inputs: Sequence[Mapping[str, str]] = (),
) -> dict[str, Any]:
    """The object that ``calibrate --json`` prints (docs/formats.md).

    Parameters
    ----------
    result
        The answer.
    complaints
        What was wrong with a frame's image, by frame.
    inputs
        The files that it was made from, with their hashes.

    Returns
    -------
    dict
        Plain JSON values, None where there is no number.

    """
    pose, design = result.T_hand_sensor, result.T_hand_sensor_design
    out: dict[str, Any] = clean(
        {
            "method": result.method,
            "model": result.model,
            "model_asked": result.model_asked or result.model,
            "verdict": {"code": result.verdict.code, "text": result.verdict.text},
            "chi2_per_dof": result.chi2_per_dof,
            "mount": result.mount,
            "T_hand_sensor": None if pose is None else pose.matrix,
            **({"T_base_sensor": None if pose is None else pose.matrix} if result.mount == "fixed" else {}),
            "rotation_deg": None if pose is None else pose.fixed_xyz_deg,
            "translation_mm": None if pose is None else pose.t,
            "sigma_rotation_deg": result.sigma_rotation_deg,
            "sigma_translation_mm": result.sigma_translation_mm,
            "covariance": result.covariance,
            **_nominal(result),
            "culprit": [_pull(c) | {"same_as": list(c.same_as)} for c in result.culprit],
            "pulls": [_pull(p) for p in result.pulls],
            "sensor": {} if result.trusted is None else result.trusted.sensor_delta,
            "compliance": [
                {
                    "joint": j.joint,
                    "urad_nm": 1e6 * j.compliance,
                    "sigma_urad_nm": 1e6 * j.sigma,
                    "prior_sigma_urad_nm": 1e6 * j.prior_sigma,
                    "observed": j.observed,
                }
                for j in result.joint_compliances
            ],
            "design": {
                "rotation_deg": None if design is None else design.fixed_xyz_deg,
                "translation_mm": None if design is None else design.t,
            },
            "conventions": _numbers(pose),
            "conventions_nominal": _numbers(None if result.nominal is None else result.nominal.T_hand_sensor),
            "convention_formulas": {name: f"{c.maker}: {c.formula}" for name, c in CONVENTIONS.items()},
            "locations": {name: location_object(location) for name, location in result.locations.items()},
            "frames": [
                frame_object(frame, (complaints or {}).get(frame.number), _stands_on_surface(frame, result))
                for frame in result.frames
            ],
            "left_out": _left_out(result),
            "equal_weights": _equal_weights(result),
            "solution": _solution(result),
            "inputs": list(inputs),
            "weak_directions": result.weak_directions,
            "notes": result.notes,
        }
    )
    return out


def _numbers(pose: Pose | None) -> dict[str, dict[str, float]]:
    """The pose in every maker's numbers."""
    return {} if pose is None else {name: express(pose, name) for name in CONVENTIONS}


def _nominal(result: CalibrationResult) -> dict[str, Any]:
    """The SCP that goes with the robot's nominal table."""
    nominal = result.nominal
    if nominal is None:
        names = ("T_hand_sensor", "sigma_rotation_deg", "sigma_translation_mm", "covariance")
        return {f"{name}_nominal": None for name in names}
    sigma = printed_sigmas(nominal.T_hand_sensor, nominal.covariance)
    return {
        "T_hand_sensor_nominal": nominal.T_hand_sensor.matrix,
        "sigma_rotation_deg_nominal": sigma[0],
        "sigma_translation_mm_nominal": sigma[1],
        "covariance_nominal": nominal.covariance,
    }


def _pull(pull: Pull) -> dict[str, Any]:
    return {
        "block": pull.block,
        "parameter": pull.parameter,
        "row": pull.row,
        "size": pull.size,
        "unit": pull.unit,
        "pull_sigma": pull.pull_sigma,
    }


def _left_out(result: CalibrationResult) -> dict[str, Any] | None:
    """Parts predicted by the others: locations by name, or a list of frames."""
    found = result.left_out
    if found is None:
        return None
    parts = {
        p.name: {"point_rms_mm": p.point_rms_mm, "shift_mm": p.shift_mm, "shift_deg": p.shift_deg} for p in found.parts
    }
    out: dict[str, Any] = {"by": found.by, "point_rms_mm": found.point_rms_mm}
    if found.by == "location":
        return out | {"locations": parts}
    return out | {"frames": [{"frame": int(name), **row} for name, row in parts.items()]}


def _equal_weights(result: CalibrationResult) -> dict[str, Any] | None:
    """The answer with all points weighted alike, with σ by the jackknife."""
    alike = result.equal_weights
    if alike is None:
        return None
    pose = alike.T_hand_sensor
    sigma = printed_sigmas(pose, alike.covariance)
    return {
        "T_hand_sensor": pose.matrix,
        "rotation_deg": pose.fixed_xyz_deg,
        "translation_mm": pose.t,
        "sigma_rotation_deg": sigma[0],
        "sigma_translation_mm": sigma[1],
        "covariance": alike.covariance,
        "point_rms_mm": alike.point_rms_mm,
        "left_out_rms_mm": alike.left_out_rms_mm,
    }


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
        "prior_cost": None if e is None else e.prior_cost,
        "prior_cost_expected": None if e is None else e.prior_expected,
    }


def location_object(location: LocationResult) -> dict[str, Any]:
    """Figures and place of one location."""
    place: dict[str, Any] = {"T_base_jig": None if location.T_base_target is None else location.T_base_target.matrix}
    if location.surface is not None:
        place = {
            "target": dict(location.surface),
            "n_points": location.n_points,
            "n_found": location.n_found,
            "centres_left_out": location.centres_left_out,
        }
    return {
        "role": location.role,
        **place,
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
    return {"design": pair.design, "solved": pair.solved, "nominal": pair.nominal}


def _stands_on_surface(frame: Frame, result: CalibrationResult) -> bool:
    location = result.locations.get(frame.location)
    return location is not None and location.surface is not None


def frame_object(frame: Frame, complaint: str | None, surface: bool = False) -> dict[str, Any]:
    """One frame with its points, and the sentence about its image where that could not be used.

    surface: its points are counted, not listed.
    """
    residual = frame.residual_mm[np.isfinite(frame.residual_mm)]
    measured: dict[str, Any]
    if surface:
        measured = {
            "n_points": frame.n_points,
            "n_found": len(frame.axis),
            "rms_mm": float(np.sqrt(np.mean(residual**2))) if len(residual) else None,
        }
    else:
        sigma_mm = frame.axis.sigma_yz_mm
        measured = {"points": [_point(frame, i, sigma_mm[i]) for i in range(len(frame.axis))]}
    out = {
        "frame": frame.number,
        "location": frame.location,
        "role": frame.role,
        "image": frame.image,
        **({"profile": frame.profile} if frame.profile else {}),
        "used": frame.used,
        "reason": frame.reason,
        **measured,
    }
    return out | ({"complaint": complaint} if complaint else {})


def _point(frame: Frame, i: int, sigma_mm: NDArray[np.float64]) -> dict[str, Any]:
    (u, v), (y, z), (sigma_y, sigma_z) = frame.axis_uv_px[i], frame.axis.yz_mm[i], sigma_mm
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
