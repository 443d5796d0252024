"""The page of a sensor's calibration."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from calib.sensor import SensorCalibration
from geometry.sensor import CAMERA_PARAMETERS
from workbench.files import LOSSY_SUFFIXES, write_text
from workbench.report import origin_of, render_page, svg
from workbench.sensor.advice import next_views, weak_directions
from workbench.sensor.pictures import coverage_figure, plane_figure, reprojection_figure, views_figure
from workbench.sensor.recording import BoardFolder

BANNER = {"ok": "good", "weak": "care", "model_misfit": "care"}


def write_sensor_report(
    path: Path, folder: Path, recording: BoardFolder, result: SensorCalibration, answer: dict[str, Any]
) -> None:
    """Write the page of a calibration, whole or not at all; it opens offline.

    Parameters
    ----------
    path
        The HTML file.
    folder
        Where the pictures are.
    recording, result
        What was seen, and what came of it.
    answer
        The JSON, for views and notes.

    """
    camera = recording.sensor.require_camera()
    size = (camera.width_px, camera.height_px)
    solved = result.solution is not None
    content = {
        "title": folder.resolve().name,
        "result": result,
        "answer": answer,
        "banner": BANNER.get(result.verdict.code, "bad"),
        "rows": _rows(result),
        "reprojection": svg(reprojection_figure(result, size)) if solved else None,
        "coverage": svg(coverage_figure(result, size)) if solved else None,
        "plane": svg(plane_figure(result)) if solved else None,
        "by_view": svg(views_figure(result)) if solved else None,
        "weak": weak_directions(result.solution) if result.solution is not None else [],
        "next_views": next_views(result, size) if solved else [],
        "lost": recording.lost,
    }
    pictures = [p for p in folder.rglob("*") if p.suffix.lower() in LOSSY_SUFFIXES or p.name == "board.toml"]
    about = origin_of(pictures, folder, passed=result.verdict.code in ("ok", "weak"))
    write_text(path, render_page("workbench.sensor", "page.html.j2", content, about))


def _rows(result: SensorCalibration) -> list[dict[str, Any]]:
    s = result.solution
    if s is None:
        return []
    rows = []
    for name, sigma in s.uncertainty.sigma.items():
        if name in CAMERA_PARAMETERS:
            rows.append({"name": name, "value": float(s.camera[CAMERA_PARAMETERS.index(name)]), "sigma": sigma})
    turn = {"plane_tilt_y_rad": "laser plane, turn about y [°]", "plane_tilt_z_rad": "laser plane, turn about z [°]"}
    for name, words in turn.items():
        rows.append({"name": words, "value": 0.0, "sigma": float(np.rad2deg(s.uncertainty.sigma[name]))})
    rows.append(
        {
            "name": "laser plane, distance from the camera [mm]",
            "value": s.plane_mm,
            "sigma": s.uncertainty.sigma["plane_shift_mm"],
        }
    )
    return rows
