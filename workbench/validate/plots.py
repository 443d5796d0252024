"""Pictures of a validation: bias over the field of view, curves over the conditions, errors beside their σ."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from workbench.report import new_figure
from workbench.validate.measure import MeasuredFrames

if TYPE_CHECKING:
    from matplotlib.figure import Figure

CELLS = 6  # each way over the laser plane
MIN_IN_CELL = 3  # points; a mean of fewer is no bias
BLUE, RED, GREY = "#2a6f97", "#c44e52", "0.6"


def bias_map(measured: MeasuredFrames) -> Figure:
    """Mean error in cells of the laser plane as arrows, with the number of points."""
    figure, axis = new_figure(5.2, 4.2)
    rows = [s for s in measured.strings if s["found"] and s["visible"] and not s["flag"]]
    if not rows:
        return figure
    at = np.array([[r["y_mm"], r["z_mm"]] for r in rows])
    error = np.array([[r["error_y_mm"], r["error_z_mm"]] for r in rows])
    edges = [np.linspace(v.min(), v.max() + 1e-9, CELLS + 1) for v in at.T]
    cell = np.stack([np.digitize(at[:, k], edges[k]) - 1 for k in range(2)], 1)
    centres, means = [], []
    for key in np.unique(cell, axis=0):
        inside = np.all(cell == key, axis=1)
        if inside.sum() >= MIN_IN_CELL:
            centres.append(at[inside].mean(axis=0))
            means.append(error[inside].mean(axis=0))
    if centres:
        c, m = np.array(centres).T, np.array(means).T
        arrows = axis.quiver(c[0], c[1], m[0], m[1], color=RED, width=0.004)
        axis.quiverkey(arrows, 0.85, 1.03, 0.02, "0.02 mm", labelpos="E")
    axis.plot(at[:, 0], at[:, 1], ".", ms=2, color=GREY, zorder=0)
    axis.set_xlabel("y [mm]")
    axis.set_ylabel("z [mm]")
    axis.set_title("mean error over the laser plane", fontsize=10)
    return figure


def curve_plot(factor: str, points: Sequence[dict[str, Any]]) -> Figure:
    """Detection rate, scatter and bias against one condition."""
    figure, axis = new_figure(4.2, 2.8)
    x = [p["at"] for p in points]
    for key, colour, label in (("scatter_y_mm", BLUE, "scatter y"), ("scatter_z_mm", RED, "scatter z")):
        for kind, style, size in (("scatter", "o-", 4), ("bias", ":", 0)):
            name = key.replace("scatter", kind)
            values = [np.nan if p[name] is None else p[name] for p in points]
            axis.plot(
                x, values, style, ms=size, color=colour, label=label if size else label.replace("scatter", "bias")
            )
    axis.axhline(0, color=GREY, lw=0.6)
    axis.set_xlabel(factor)
    axis.set_ylabel("scatter, bias [mm]")
    axis.set_ylim(axis.get_ylim()[0], 1.5 * axis.get_ylim()[1])  # room for the legend
    rate = axis.twinx()
    rate.plot(
        x,
        [np.nan if p["detection_rate"] is None else 100 * p["detection_rate"] for p in points],
        "s--",
        ms=4,
        color="#5b8c5a",
        label="found",
    )
    rate.set_ylabel("found [%]")
    rate.set_ylim(0, 140)
    rate.set_yticks([0, 25, 50, 75, 100])
    axis.legend(fontsize=7, loc="upper left", frameon=False, ncols=2)
    rate.legend(fontsize=7, loc="lower right", frameon=False)
    return figure


def pull_plot(measured: MeasuredFrames) -> Figure:
    """Errors over their claimed σ, beside the normal distribution that they should follow."""
    figure, axis = new_figure(5.2, 3.0)
    rows = [s for s in measured.strings if s["found"] and s["visible"] and not s["flag"] and s["nominal"]]
    x = np.linspace(-5, 5, 200)
    for key, colour in (("y", BLUE), ("z", RED)):
        pulls = [np.clip(r[f"error_{key}_mm"] / r[f"sigma_{key}_mm"], -5, 5) for r in rows]
        if pulls:
            axis.hist(
                pulls, bins=40, range=(-5, 5), density=True, alpha=0.45, color=colour, label=f"error / σ in {key}"
            )
    axis.plot(x, np.exp(-(x**2) / 2) / np.sqrt(2 * np.pi), color="0.2", lw=1, label="normal")
    axis.legend(fontsize=7, frameon=False)
    axis.set_xlabel("error over claimed σ")
    return figure
