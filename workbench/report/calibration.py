"""The result of calibrate as one self-contained HTML page that opens offline and prints well."""

from __future__ import annotations

import base64
import hashlib
import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from calib import CalibrationResult, printed_sigmas
from geometry import CONVENTIONS, Frame, Surface, clean, express, target_at
from workbench.cell import Observed
from workbench.files import Cell, Settings, read_image, settings_text, write_text
from workbench.report.as_text import AXES
from workbench.report.fig7 import draw_fig7
from workbench.report.overlays import overlay
from workbench.report.page import jpeg, origin_of, render_page, svg
from workbench.report.residuals import draw_residuals, draw_section
from workbench.report.scene import scene_object, scene_script

Array = NDArray[np.float64]

# of the program's own: the page begins with it
START = """
{
  const scene = JSON.parse(document.getElementById("scene").textContent), canvas = document.getElementById("cell");
  const paper = { ground: "#ffffff", text: "#1b2328", quiet: "#8b979f", accent: "#2a6f97" };
  const colours = { ...paper, good: "#1f7a4d", bad: "#b3261e", warn: "#8a5d00" };
  const tell = (frame) => { document.getElementById("cell-frame").textContent = `frame ${frame}`; };
  const view = startScene(canvas, scene, colours, tell);
  if (view) view.step(0);
  else canvas.parentElement.hidden = true;
}
"""
QUANTILE_95 = 1.96  # of the normal distribution, both sides
WORST = 3  # used frames that are shown beside those left out
BANNER = {"ok": "good"} | dict.fromkeys(("model_misfit", "priors_contradict", "sensor_suspect", "weak"), "care")
TANGENT = ("tx", "ty", "tz", "rx", "ry", "rz")


@dataclass(frozen=True, eq=False)
class ReportInput:
    """Everything the page is made of. picture: of the cell, (H, W, 3) RGB, where it could be drawn."""

    cell: Cell
    observed: Observed
    result: CalibrationResult
    settings: Settings
    picture: NDArray[np.uint8] | None = None


def write_report(path: Path, given: ReportInput) -> None:
    """Write the page of a calibration, whole or not at all; it opens offline.

    Parameters
    ----------
    path
        The HTML file.
    given
        Cell, frames, result and settings, and a picture of the cell where there is one.

    """
    write_text(path, report_page(given))


def report_page(given: ReportInput) -> str:
    """The page of a calibration as text.

    Parameters
    ----------
    given
        As of `write_report`.

    Returns
    -------
    str
        HTML that opens offline.

    """
    cell, result = given.cell, given.result
    images = [cell.folder / (f.image or f.profile) for f in cell.frames if f.image or f.profile]
    about = origin_of([*cell.files, *images], cell.folder, settings_text(given.settings), result.verdict.trustworthy)
    return render_page("workbench.report", "report.html.j2", _content(given) | _in_three_dimensions(given), about)


def _in_three_dimensions(given: ReportInput) -> dict[str, Any]:
    """The scene and its program; the page allows this one script, by its hash."""
    scene = scene_object(given.cell, given.result)
    if not scene["frames"]:
        return {"scene": "", "script": "", "script_hash": ""}
    script = scene_script() + START
    digest = base64.b64encode(hashlib.sha256(script.encode()).digest()).decode()
    text = json.dumps(clean(scene), separators=(",", ":")).replace("<", "\\u003c")
    return {"scene": text, "script": script, "script_hash": f"sha256-{digest}"}


def _content(given: ReportInput) -> dict[str, Any]:
    result, cell = given.result, given.cell
    rows = scp_rows(result)
    return {
        "title": cell.name or cell.folder.resolve().name,
        "result": result,
        "banner": BANNER.get(result.verdict.code, "bad"),
        "scp": rows,
        "two_tables": bool(np.isfinite(rows[0]["nominal"])),
        "matrix": _matrix_text(result),
        "conventions": _conventions(result),
        "picture": None if given.picture is None else jpeg(given.picture[..., ::-1]),
        "fig7": svg(draw_fig7(result)),
        "residuals": svg(draw_residuals(result)),
        "left_out": result.left_out,
        "correlations": _correlations(result),
        "tangent": TANGENT,
        "frames": [_frame_row(f) for f in result.frames],
        "complaints": given.observed.complaints,
        "worst": _worst(cell, result),
        "settings": settings_text(given.settings),
        "points": sum(len(f.axis) for f in result.frames if f.used),
    }


def scp_rows(result: CalibrationResult) -> list[dict[str, Any]]:
    """The six numbers with design, σ and 95 % interval, and those that go with the robot's nominal table.

    Parameters
    ----------
    result
        Of calibrate.

    Returns
    -------
    list of dict
        name, unit, design, solved, sigma, low, high, nominal and nominal_sigma; NaN where there is none. Nominal is
        there only where the solved pose goes with another table.

    """
    pose, design = result.T_hand_sensor, result.T_hand_sensor_design
    nothing = np.full(3, np.nan)
    angles, place = (nothing, nothing) if pose is None else (pose.fixed_xyz_deg, pose.t)
    parts = (
        ("rotation", "°", nothing if design is None else design.fixed_xyz_deg, angles, result.sigma_rotation_deg),
        ("translation", "mm", nothing if design is None else design.t, place, result.sigma_translation_mm),
    )
    nominal = result.nominal_apart
    by_nominal = (
        (nothing, nothing) if nominal is None else (nominal.T_hand_sensor.fixed_xyz_deg, nominal.T_hand_sensor.t)
    )
    sigma_nominal = (nothing, nothing) if nominal is None else printed_sigmas(nominal.T_hand_sensor, nominal.covariance)
    rows = []
    for k, (what, unit, d, s, sigma) in enumerate(parts):
        spread = nothing if sigma is None else sigma
        for i, axis in enumerate(AXES):
            half = QUANTILE_95 * spread[i]
            row = {"name": f"{what} {axis}", "unit": unit, "design": float(d[i]) + 0.0, "solved": float(s[i])}
            row |= {"sigma": float(spread[i]), "low": float(s[i] - half), "high": float(s[i] + half)}
            rows.append(row | {"nominal": float(by_nominal[k][i]), "nominal_sigma": float(sigma_nominal[k][i])})
    return rows


def _conventions(result: CalibrationResult) -> list[dict[str, Any]]:
    if result.T_hand_sensor is None:
        return []
    pose = result.T_hand_sensor if result.nominal_apart is None else result.nominal_apart.T_hand_sensor
    return [{"maker": c.maker, "formula": c.formula, "numbers": express(pose, key)} for key, c in CONVENTIONS.items()]


def _matrix_text(result: CalibrationResult) -> str:
    if result.T_hand_sensor is None:
        return ""
    return "\n".join("".join(f"{v:14.8f}" for v in row) for row in result.T_hand_sensor.matrix)


def _correlations(result: CalibrationResult) -> list[list[float]] | None:
    if result.covariance is None or not np.all(np.isfinite(result.covariance)):
        return None
    sigma = np.sqrt(np.diag(result.covariance))
    return [[float(v) for v in row] for row in result.covariance / np.outer(sigma, sigma)]


def _rms(frame: Frame) -> float:
    finite = frame.residual_mm[np.isfinite(frame.residual_mm)]
    return float(np.sqrt(np.mean(finite**2))) if len(finite) else float("nan")


def _frame_row(frame: Frame) -> dict[str, Any]:
    flags = [f"{label} {flag}" for label, flag in zip(frame.axis.label, frame.axis.flag, strict=False) if flag]
    return {"frame": frame, "rms": _rms(frame), "points": len(frame.axis), "flags": ", ".join(flags)}


def _worst(cell: Cell, result: CalibrationResult) -> list[dict[str, Any]]:
    """The frames left out and those with the largest residuals, with their overlays."""
    if cell.points is not None:
        return []
    rms = {f.number: _rms(f) if f.used else np.inf for f in result.frames}
    order = sorted(result.frames, key=lambda f: -rms[f.number])[: WORST + sum(np.isinf(v) for v in rms.values())]
    out = []
    for frame in order[: 2 * WORST]:
        surface = isinstance(target_at(cell.target, frame.location), Surface)
        if surface and len(frame.residual_mm):
            why = "not used" if np.isinf(rms[frame.number]) else f"rms {rms[frame.number]:.3f} mm"
            out.append({"frame": frame.number, "why": why, "image": svg(draw_section(frame))})
        elif not surface and frame.image and frame.reason != "image_unreadable":
            picture = overlay(read_image(cell.folder / frame.image, cell.sensor), cell.sensor, frame)
            why = "not used" if np.isinf(rms[frame.number]) else f"rms {rms[frame.number]:.3f} mm"
            out.append({"frame": frame.number, "why": why, "image": jpeg(picture)})
    return out
