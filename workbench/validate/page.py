"""The report of a validation as HTML, CSV and JSON."""

from __future__ import annotations

import csv
import io
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from geometry import json_text
from workbench.files import write_text
from workbench.report import Origin, render_page, svg
from workbench.validate.drawing import CLUTTER, FACTORS
from workbench.validate.measure import MeasuredFrames
from workbench.validate.plots import bias_map, curve_plot, pull_plot
from workbench.validate.summary import Failure, Thresholds, curve, in_words

WORDS = {
    "frames": "frames",
    "points": "points without a flag",
    "detection_rate": "visible strings found, of those bright enough to be told from the noise",
    "too_faint": "visible strings that are too faint for any detector",
    "false_rate": "labelled points that show no string",
    "mislabel_rate": "labelled points with another string's label",
    "flagged_rate": "found points that carry a flag",
    "bias_y_mm": "bias of the axis point, y [mm]",
    "bias_z_mm": "bias of the axis point, z [mm]",
    "scatter_y_mm": "scatter of the axis point, y [mm]",
    "scatter_z_mm": "scatter of the axis point, z [mm]",
    "bias_u_px": "bias of the spot, u [px]",
    "bias_v_px": "bias of the spot, v [px]",
    "scatter_px": "scatter of the spot [px]",
    "sigma_ratio": "claimed over empirical σ (1 is honest)",
    "bound_ratio": "error over the camera's Cramér-Rao bound (speckle is not in it)",
    "sensors": "sensors drawn from sensor.toml's uncertainty, a frame by each",
    "sensor_bias_y_mm": "their mean error of the axis point, y [mm]",
    "sensor_bias_z_mm": "their mean error of the axis point, z [mm]",
    "sensor_rms_y_mm": "their root mean square error, y [mm]",
    "sensor_rms_z_mm": "their root mean square error, z [mm]",
    "sensor_sigma_ratio": "claimed, the sensor's own part in it, over empirical σ (1 is honest)",
    "stripe_points": "points of the stripe on matte plates",
    "stripe_found_rate": "sections of the stripe that have a point",
    "stripe_wrong_rate": "points that are not the plate's",
    "stripe_bias_mm": "bias of the stripe, along the plate's normal [mm]",
    "stripe_scatter_mm": "scatter of a point about the plate [mm]",
    "stripe_sigma_ratio": "claimed over empirical σ of a point (1 is honest)",
}
UNITS = {
    "exposure_ms": "exposure time [ms]",
    "ambient": "ambient light [mW/m²/nm]",
    "speckle": "speckle contrast",
    "diameter_mm": "string diameter [mm]",
    "gloss": "gloss (specular reflectance)",
    "tilt_deg": "tilt of the view [°]",
    "clutter": "clutter (" + ", ".join(f"{i} {word}" for i, word in enumerate(CLUTTER)) + ")",
    "signal_e": "signal of the spot [e⁻]",
}


def write_pages(
    out: Path,
    measured: MeasuredFrames,
    result: dict[str, float | None],
    thresholds: Thresholds,
    failed: Sequence[Failure],
    worst: Sequence[dict[str, Any]],
    origin: Origin | None = None,
) -> None:
    """Write report.html, strings.csv, frames.csv, result.json and, of drawn sensors, drawn_sensors.csv into ``out``."""
    curves = {factor: curve(measured, factor) for factor in FACTORS}
    limits = {k: v for k, v in thresholds.model_dump(exclude={"name"}).items() if v is not None}
    content = {
        "figures": [{"words": WORDS[k], "key": k, "value": v} for k, v in result.items()],
        "words": in_words(result),
        "limits": limits,
        "values": result,
        "failed": {f.key for f in failed},
        "bias": svg(bias_map(measured)),
        "pulls": svg(pull_plot(measured)),
        "curves": [(UNITS[f], svg(curve_plot(UNITS[f], points))) for f, points in curves.items() if len(points) > 1],
        "worst": worst,
    }
    write_text(out / "report.html", render_page("workbench.validate", "page.html.j2", content, origin))
    write_text(out / "strings.csv", _csv(measured.strings))
    if measured.by_drawn_sensors:
        write_text(out / "drawn_sensors.csv", _csv(measured.by_drawn_sensors))
    write_text(out / "frames.csv", _csv(measured.counts))
    write_text(out / "result.json", json_text(result_object(result, limits, failed, curves)) + "\n")


def result_object(
    result: dict[str, float | None],
    limits: dict[str, float],
    failed: Sequence[Failure],
    curves: dict[str, list[dict[str, Any]]],
) -> dict[str, Any]:
    """The JSON of a validation."""
    return {"figures": result, "thresholds": limits, "failed": [f.key for f in failed], "curves": curves}


def _csv(rows: Sequence[dict[str, Any]]) -> str:
    columns = list(dict.fromkeys(key for row in rows for key in row))
    stream = io.StringIO()
    writer = csv.DictWriter(stream, columns, lineterminator="\n")
    writer.writeheader()
    writer.writerows(rows)
    return stream.getvalue()
