"""The files beside a result: the JSON, the points, the picture of Fig. 7 and the settings that led to them."""

from __future__ import annotations

from pathlib import Path

from calib import CalibrationResult
from geometry import json_text
from workbench.cell import Observed, label_dataset, rows
from workbench.files import Cell, Settings, points_text, settings_text, write_text
from workbench.report.as_json import calibration_object
from workbench.report.fig7 import write_fig7
from workbench.report.robot import write_corrected_robot


def write_results(out: Path, cell: Cell, observed: Observed, result: CalibrationResult, settings: Settings) -> None:
    """Write result.json, points.csv, fig7.png, settings.toml and, where corrected, the robot.

    Parameters
    ----------
    out
        The folder; made where it is not there.
    cell, observed, result, settings
        The dataset, its frames as measured, the answer, and what both stages were told.

    """
    write_text(out / "result.json", json_text(calibration_object(result, observed.complaints, cell)) + "\n")
    write_text(
        out / "points.csv", points_text(rows(label_dataset(cell, observed, settings.calib, result), cell.sensor))
    )
    write_fig7(out / "fig7.png", result)
    write_text(out / "settings.toml", settings_text(settings))
    write_corrected_robot(out, cell, result)
