"""Residuals of every point by frame, as a picture."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from calib import CalibrationResult
from geometry import Frame
from workbench.report.page import new_figure

if TYPE_CHECKING:
    from matplotlib.figure import Figure

COLOURS = ("#2a6f97", "#c77d2e", "#5b8c5a", "#8a5a8c", "#a34a4a", "#4a4a4a")
MANY = 1000  # points that are drawn as pixels: as lines of a page they would be megabytes
REASON_HEIGHT = 0.97  # of the axes


def draw_section(frame: Frame) -> Figure:
    """How far each point of a frame lies off its surface [mm], over y."""
    figure, axis = new_figure(5, 2.2)
    axis.plot(frame.axis.yz_mm[:, 0], frame.residual_mm, ".", ms=2.5, color=COLOURS[0])
    axis.set_xlabel("y [mm]")
    axis.set_ylabel("off the target [mm]")
    axis.set_ylim(bottom=0)
    axis.grid(alpha=0.25)
    return figure


def draw_residuals(result: CalibrationResult) -> Figure:
    """Each point's distance from the target [mm] over the frames, by location; frames left out are named."""
    figure, axis = new_figure(10, 3.2)
    for k, name in enumerate(result.locations):
        colour = COLOURS[k % len(COLOURS)]
        frames = [f for f in result.frames if f.location == name and f.used]
        x = np.concatenate([np.full(len(f.axis), f.number) for f in frames]) if frames else np.zeros(0)
        y = np.concatenate([f.residual_mm for f in frames]) if frames else np.zeros(0)
        role = result.locations[name].role
        axis.plot(x, y, "o", ms=3.5, color=colour, alpha=0.8, rasterized=len(x) > MANY, label=f"{name} ({role})")
        for f in frames:
            finite = f.residual_mm[np.isfinite(f.residual_mm)]
            if len(finite):
                rms = float(np.sqrt(np.mean(finite**2)))
                axis.plot([f.number - 0.35, f.number + 0.35], [rms, rms], "-", color=colour, lw=1.6)
    for f in result.frames:
        if not f.used:
            axis.axvline(f.number, color="0.85", lw=6, zorder=0)
            upright = axis.get_xaxis_transform()
            text = axis.text(f.number, REASON_HEIGHT, f.reason or "", transform=upright, va="top", ha="center")
            text.set(rotation=90, fontsize=7)
    axis.set_xlabel("frame")
    axis.set_ylabel("distance from the target [mm]\n(bar: rms of the frame)")
    axis.set_ylim(bottom=0)
    axis.grid(alpha=0.25)
    if axis.get_legend_handles_labels()[0]:
        axis.legend(fontsize=8, ncols=4, loc="upper right")
    return figure
