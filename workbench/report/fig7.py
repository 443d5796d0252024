"""The paper's Fig. 7 as a picture: the jig origin's distance from the base by configuration, before and after."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from calib import CalibrationResult, LocationResult
from workbench.files.atomic import write_bytes
from workbench.report.page import picture_bytes

DESIGN, SOLVED = "#c44e52", "#2a6f97"


def draw_fig7(result: CalibrationResult) -> Figure:
    """One panel for each location: distance minus its mean over the configurations, by design and as solved."""
    locations = {name: loc for name, loc in result.locations.items() if len(loc.distances.frame)}
    figure = Figure(figsize=(max(3.1 * len(locations), 5.0), 3.4), layout="constrained")
    FigureCanvasAgg(figure)
    if not locations:
        figure.text(0.5, 0.5, "no frame shows all strings: no distance can be formed", ha="center")
        return figure
    axes = figure.subplots(1, len(locations), sharey=True, squeeze=False)[0]
    for axis, (name, location) in zip(axes, locations.items(), strict=True):
        _panel(axis, name, location)
    axes[0].set_ylabel("distance base – jig origin,\nminus its mean [mm]")
    axes[0].legend(loc="best", fontsize=8)
    figure.suptitle("Deviation of the jig's distance from the base (Fig. 7 of the paper)", fontsize=11)
    return figure


def _panel(axis: object, name: str, location: LocationResult) -> None:
    distances = location.distances
    number = np.arange(1, len(distances.frame) + 1)
    for values, colour, label, marker in (
        (distances.design_mm, DESIGN, "design", "o"),
        (distances.solved_mm, SOLVED, "calibrated", "s"),
    ):
        if len(values) and np.all(np.isfinite(values)):
            axis.plot(number, values - np.mean(values), marker + "-", color=colour, label=label, ms=4, lw=1.2)  # type: ignore[attr-defined]
    axis.axhline(0, color="0.6", lw=0.8)  # type: ignore[attr-defined]
    axis.set_title(f"location {name} ({location.role})", fontsize=10)  # type: ignore[attr-defined]
    axis.set_xlabel("configuration")  # type: ignore[attr-defined]
    axis.set_xticks(number)  # type: ignore[attr-defined]
    axis.grid(alpha=0.25)  # type: ignore[attr-defined]


def write_fig7(path: Path, result: CalibrationResult) -> None:
    """Write the picture atomically."""
    write_bytes(path, picture_bytes(draw_fig7(result)))
