"""The paper's Fig. 7 as a picture: the jig origin's distance from the base by configuration, before and after."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from calib import CalibrationResult, LocationResult
from workbench.files import write_bytes
from workbench.report.page import new_figure, picture_bytes

if TYPE_CHECKING:
    from matplotlib.figure import Figure

DESIGN, SOLVED = "#c44e52", "#2a6f97"


def draw_fig7(result: CalibrationResult) -> Figure:
    """One panel for each location: distance minus its mean over the configurations, by design and as solved."""
    locations = {name: loc for name, loc in result.locations.items() if len(loc.distances.frame)}
    figure, drawn = new_figure(max(3.1 * len(locations), 5.0), 3.4, max(len(locations), 1))
    axes = np.atleast_1d(drawn)
    if not locations:
        axes[0].set_axis_off()
        figure.text(0.5, 0.5, "no frame shows all strings: no distance can be formed", ha="center")
        return figure
    for axis, (name, location) in zip(axes, locations.items(), strict=True):
        _panel(axis, name, location)
    axes[0].set_ylabel("distance base – jig origin,\nminus its mean [mm]")
    axes[0].legend(loc="best", fontsize=8)
    figure.suptitle("Deviation of the jig's distance from the base (Fig. 7 of the paper)", fontsize=11)
    return figure


def _panel(axis: Any, name: str, location: LocationResult) -> None:
    distances = location.distances
    number = np.arange(1, len(distances.frame) + 1)
    for values, colour, label, marker in (
        (distances.design_mm, DESIGN, "design", "o"),
        (distances.solved_mm, SOLVED, "calibrated", "s"),
    ):
        if len(values) and np.all(np.isfinite(values)):
            axis.plot(number, values - np.mean(values), marker + "-", color=colour, label=label, ms=4, lw=1.2)
    axis.axhline(0, color="0.6", lw=0.8)
    axis.set_title(f"location {name} ({location.role})", fontsize=10)
    axis.set_xlabel("configuration")
    axis.set_xticks(number)
    axis.grid(alpha=0.25)


def write_fig7(path: Path, result: CalibrationResult) -> None:
    """Write the picture atomically."""
    write_bytes(path, picture_bytes(draw_fig7(result)))
