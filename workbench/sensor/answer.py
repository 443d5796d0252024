"""The answer of calibrate-sensor as JSON, and the sensor.toml that it writes."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from calib.sensor import FoundShape, PossibleTilts, SensorCalibration, SensorSolution
from geometry import (
    Camera,
    Pose,
    Sensor,
    Sheet,
    rounded_by_sigma,
    rounded_covariance,
    rounded_transform,
)
from geometry.sensor import CAMERA_PARAMETERS, DirectMap
from perceptron_emu import EmulatorConfig
from workbench.files import sensor_text

FAN_MARGIN = 1.15  # of the fan that the stripes filled: boards do not reach its ends
FAN_DEG = (10.0, 170.0)
UNSEEN = (
    "a wrong square size scales everything and can not be seen in the pictures: measure the board with a caliper",
    "mirrored pictures of a checkerboard can not be told from right ones: check that lettering reads the right way",
)

UNEQUAL = 2.5e-4  # of lengths by a board whose rows and columns differ, as a share: worth a word


def answer_object(
    result: SensorCalibration, n_corners: int, lost: tuple[tuple[str, str], ...], remarks: tuple[str, ...]
) -> dict[str, Any]:
    """The JSON of a calibration; lost: views without a board and why."""
    s = result.solution
    views: list[dict[str, Any]] = [
        {
            "view": v.name,
            "used": v.used,
            "reason": v.reason,
            "reprojection_rms_px": v.reprojection_rms_px,
            "plane_rms_mm": v.plane_rms_mm,
            "left_out_reprojection_rms_px": v.left_out_px,
            "left_out_plane_rms_mm": v.left_out_mm,
            "T_camera_board": None if v.T_camera_board is None else v.T_camera_board.matrix,
        }
        for v in result.views
    ]
    nothing = {"used": False, "reprojection_rms_px": None, "plane_rms_mm": None, "T_camera_board": None}
    views += [{"view": name, "reason": reason} | nothing for name, reason in lost]
    return {
        "n_views": result.n_views,
        "n_corners": n_corners,
        "n_stripe_points": sum(len(v.stripe_mm) for v in result.views if v.stripe_mm is not None),
        "reprojection_rms_px": result.reprojection_rms_px,
        "plane_rms_mm": result.plane_rms_mm,
        "left_out": {"by": "view", "reprojection_rms_px": result.left_out_px, "plane_rms_mm": result.left_out_mm},
        "camera": None if s is None else camera_object(s),
        "laser_plane_camera": None if s is None else plane_object(s),
        "T_sensor_camera": None if s is None else s.frame.T_sensor_camera.matrix,
        "sigma_z_mm": _by_depth(result.sigma_z_mm),
        "depth_mm": _by_depth(result.depth_mm),
        "chi2_per_dof": result.chi2_per_dof,
        "noise": {
            "corner_scale": result.corner_scale,
            "stripe_scale": result.stripe_scale,
            "view_offset_px": result.offset_px,
        },
        "untaken_tilt": None if result.untaken is None else tilt_object(result.untaken),
        "board_shape": None if result.shape is None else shape_object(result.shape),
        "terms_tried": [
            {
                "terms": t.terms,
                "left_out_reprojection_rms_px": t.reprojection_rms_px,
                "left_out_plane_rms_mm": t.plane_rms_mm,
            }
            for t in result.tried
        ],
        "verdict": {"code": result.verdict.code, "text": result.verdict.text},
        "views": sorted(views, key=lambda v: str(v["view"])),
        "notes": [*result.notes, *remarks, *untaken_note(result.untaken), *shape_note(result.shape), *UNSEEN],
    }


def tilt_object(tilt: PossibleTilts) -> dict[str, Any]:
    """A tilt of the chip that the answer does not hold and the views do not exclude."""
    angles = np.rad2deg([*tilt.mean_rad, *tilt.sigma_rad])
    names = ("tau_x_deg", "tau_y_deg", "sigma_tau_x_deg", "sigma_tau_y_deg")
    return {"probability": tilt.probability} | dict(zip(names, angles.tolist(), strict=True))


def untaken_note(tilt: PossibleTilts | None) -> list[str]:
    """The same in words."""
    if tilt is None:
        return []
    (x, y), (sx, sy) = np.rad2deg(tilt.mean_rad), np.rad2deg(tilt.sigma_rad)
    angles = f"by {x:.2f} ± {sx:.2f}° about x and {y:.2f} ± {sy:.2f}° about y"
    if tilt.probability > 0.5:
        return [
            "the chip is taken to stand upright, for a tilt does not make the errors of left-out views smaller; were "
            f"they independent, a tilt ({angles}) would be likelier, and every σ holds it: tilt the board more"
        ]
    return [
        f"the chip is taken to stand upright; the views leave a chance of {100 * tilt.probability:.0f} % that it is "
        f"tilted ({angles}), which every σ holds: tilt the board more"
    ]


def shape_object(shape: FoundShape) -> dict[str, Any]:
    """A board that is not as stated: curvatures of z = (a x² + 2 b x y + c y²) / 2, and its corners' offsets."""
    bent = shape.bend_per_mm is not None
    return {
        "bend_per_m": None if shape.bend_per_mm is None else 1e3 * shape.bend_per_mm,
        "sigma_bend_per_m": None if shape.sigma_bend_per_mm is None else 1e3 * shape.sigma_bend_per_mm,
        "sag_mm": shape.sag_mm if bent else None,
        "corners_mm": shape.corners_mm,
        "offset_mm": shape.offset_mm,
        "sigma_offset_mm": shape.sigma_offset_mm,
    }


def shape_note(shape: FoundShape | None) -> list[str]:
    """The same in words."""
    if shape is None:
        return []
    said = []
    if shape.bend_per_mm is not None:
        said.append(f"the board is not flat: it sags by {shape.sag_mm:.2f} mm over its corners")
    if len(shape.offset_mm):
        x, y, z = np.sqrt(np.mean(shape.offset_mm**2, axis=0))
        said.append(
            f"the board's corners stand off their stated places by {x:.3f}, {y:.3f} and {z:.3f} mm (root mean square "
            "along its columns, its rows and across it)"
        )
    notes = [
        f"{', and '.join(said)}: the bundle holds it, for left-out views are predicted better so, and every σ does"
    ]
    if shape.sigma_scale > UNEQUAL:
        notes.append(
            f"the board's columns and rows are {200 * shape.sigma_scale:.2f} % differently long: no picture "
            "shows which is right, so σ hold half of it for every length; measure both with a caliper"
        )
    return notes


def _by_depth(values: tuple[float, float, float] | None) -> dict[str, float] | None:
    return None if values is None else dict(zip(("near", "middle", "far"), values, strict=True))


def plane_object(s: SensorSolution) -> dict[str, Any]:
    """The laser plane in the camera's frame, with σ of its turns about {P}'s y and z and of its distance."""
    sigma = s.uncertainty.sigma
    return {
        "normal": s.plane_normal,
        "distance_mm": s.plane_mm,
        "sigma_tilt_y_deg": float(np.rad2deg(sigma["plane_tilt_y_rad"])),
        "sigma_tilt_z_deg": float(np.rad2deg(sigma["plane_tilt_z_rad"])),
        "sigma_distance_mm": sigma["plane_shift_mm"],
    }


def camera_object(s: SensorSolution) -> dict[str, Any]:
    """Camera of a solution with σ of each number."""
    sigma = s.uncertainty.sigma
    names = ("fx_px", "fy_px", "cx_px", "cy_px")
    out: dict[str, Any] = {name: float(v) for name, v in zip(names, s.camera, strict=False)}
    out["distortion"] = list(s.distortion)
    out["terms"] = list(s.terms)
    return out | {"sigma": {name: value for name, value in sigma.items() if not name.startswith("plane")}}


def calibrated_sensor(result: SensorCalibration, pictures: Sensor) -> Sensor | None:
    """The sensor of a calibration, rounded as its file has it; emitter and fan are assumed. None without a solution."""
    s = result.solution
    if s is None:
        return None
    seen, sigma = pictures.require_camera(), s.uncertainty.sigma
    given = (*s.camera[:4], *s.distortion)
    numbers = [rounded_by_sigma(float(v), sigma.get(k, 0.0)) for k, v in zip(CAMERA_PARAMETERS, given, strict=False)]
    fx, fy, cx, cy, *distortion = numbers
    T = rounded_transform(s.frame.T_sensor_camera.matrix)
    camera = Camera(
        seen.width_px,
        seen.height_px,
        fx,
        fy,
        cx,
        cy,
        Pose(T[:3, :3], T[:3, 3]),
        tuple(distortion),
        seen.bit_depth,
        channel=seen.channel,
    )
    known, tangent = s.uncertainty, s.uncertainty.tangent_covariance
    known = replace(
        known,
        covariance=rounded_covariance(known.covariance),
        tangent_covariance=None if tangent is None else rounded_covariance(tangent),
    )
    return Sensor(Sheet(np.zeros(3), np.deg2rad(_fan_deg(result))), camera, uncertainty=known)


def _fan_deg(result: SensorCalibration) -> float:
    """A fan from {P}'s origin that holds all stripes."""
    points = np.concatenate([v.stripe_yz_mm for v in result.views if v.stripe_yz_mm is not None])
    widest = float(np.max(np.abs(np.arctan2(points[:, 0], points[:, 1]))))
    return float(np.clip(np.ceil(np.rad2deg(2 * widest) * FAN_MARGIN), *FAN_DEG))


def calibrated_text(sensor: Sensor, result: SensorCalibration) -> str:
    """The sensor.toml of a calibration."""
    facing = result.solution is not None and result.solution.frame.z_is_image_v
    axis = (
        "the image's v direction, for the optical axis stands near the plane's normal" if facing else "the optical axis"
    )
    head = [
        "# calibrated from views of a board with the stripe on it",
        f"# {{P}}: x = 0 the laser plane, x towards the camera, z {axis} in the plane, y = z × x;",
        "# its origin is the foot of the camera's centre, unless it was moved",
        "# [laser] origin_mm and fan_deg are assumed: a board does not show where the light comes from",
        f"# verdict {result.verdict.code}: left-out views {result.left_out_px:.4f} px, {result.left_out_mm:.4f} mm off",
    ]
    return "\n".join(head) + "\n" + sensor_text(sensor, EmulatorConfig())


def direct_object(direct: DirectMap) -> dict[str, Any]:
    """A direct map as sensor.toml has it."""
    values = {"homography": direct.homography, "polynomial": [list(row) for row in direct.polynomial] or None}
    return values | {"rms_mm": direct.rms_mm, "seen_px": direct.seen_px}


def exported(sensor: Sensor, kind: str) -> str:
    """The camera for other software: "opencv" YAML, "ros" camera_info, or plain "json" with the laser plane."""
    c = sensor.require_camera()
    k, d = c.matrix, list(c.distortion) or [0.0] * 5
    if kind == "opencv":
        rows = [("camera_matrix", 3, 3, k.ravel().tolist()), ("distortion_coefficients", 1, len(d), d)]
        normal = (-c.T_sensor_camera.R[0] * np.sign(c.centre_mm[0])).tolist()
        plane = [*normal, float(abs(c.centre_mm[0]))]
        rows.append(("laser_plane", 1, 4, plane))
        body = [f"image_width: {c.width_px}", f"image_height: {c.height_px}"]
        for name, r, n, data in rows:
            body += [f"{name}: !!opencv-matrix", f"   rows: {r}", f"   cols: {n}", "   dt: d", f"   data: {data!r}"]
        return "%YAML:1.0\n---\n" + "\n".join(body) + "\n"
    if kind == "ros":
        model = "plumb_bob" if len(d) <= 5 else "rational_polynomial"
        lines = [f"image_width: {c.width_px}", f"image_height: {c.height_px}", "camera_name: line_sensor"]
        lines += ["camera_matrix:", "  rows: 3", "  cols: 3", f"  data: {k.ravel().tolist()!r}"]
        lines += [f"distortion_model: {model}", "distortion_coefficients:", "  rows: 1"]
        five = (d + [0.0] * 5)[:5] if model == "plumb_bob" else d
        lines += [f"  cols: {len(five)}", f"  data: {five!r}"]
        lines += ["rectification_matrix:", "  rows: 3", "  cols: 3", f"  data: {np.eye(3).ravel().tolist()!r}"]
        p = np.column_stack([k, np.zeros(3)])
        lines += ["projection_matrix:", "  rows: 3", "  cols: 4", f"  data: {p.ravel().tolist()!r}"]
        return "\n".join(lines) + "\n"
    from geometry import json_text

    T = c.T_sensor_camera
    return (
        json_text(
            {
                "image_size": [c.width_px, c.height_px],
                "camera_matrix": k,
                "distortion": d,
                "T_sensor_camera": T.matrix,
                "laser_plane_camera": {"normal": -T.R[0] * np.sign(T.t[0]), "distance_mm": float(abs(T.t[0]))},
                "direct": None if sensor.direct is None else direct_object(sensor.direct),
            }
        )
        + "\n"
    )
