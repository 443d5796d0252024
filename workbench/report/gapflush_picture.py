"""The process window of gap and flush: the profile, the fitted panels and the two lengths, as a picture."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from extraction import GapFlush, Profile
from extraction.gapflush import PanelEdge
from geometry import InputError
from workbench.files import write_bytes
from workbench.report.page import new_figure, picture_bytes

if TYPE_CHECKING:
    from matplotlib.axes import Axes

Array = NDArray[np.float64]

SUFFIXES = (".png", ".svg", ".pdf")
FACE_MM, AROUND_MM = 8.0, 10.0  # of a face that is drawn; of the profile around the gap that is shown
PANEL, LENGTH = "#2a6f97", "#b5403a"


def draw_gap_flush(profile: Profile, answer: GapFlush, path: Path, reference: str = "left") -> None:
    """Write the picture, PNG, SVG or PDF by the suffix of ``path``; the sensor is above."""
    if path.suffix.lower() not in SUFFIXES:
        raise InputError(f"{path}: a picture must end in {', '.join(SUFFIXES)}")
    figure, axis = new_figure(8, 3.8)
    shown = np.vstack([answer.gap_points, answer.flush_points])
    low, high = shown.min(axis=0) - (AROUND_MM, 2.0), shown.max(axis=0) + np.array([AROUND_MM, 4.5])
    axis.plot(*profile.with_tails().yz_mm.T, ".", color="0.6", markersize=3)
    for edge, side, radius in zip((answer.left, answer.right), ("left", "right"), answer.radius_mm, strict=True):
        _draw_edge(axis, edge, f"radius {side}\n{radius:.2f} mm" if np.isfinite(radius) else "")
    _draw_lengths(axis, answer, answer.left if reference == "left" else answer.right)
    axis.set(xlabel="y [mm]", ylabel="z [mm], away from the sensor", xlim=(low[0], high[0]), ylim=(high[1], low[1]))
    axis.set_aspect("equal")
    axis.set_title(
        f"gap {answer.gap_mm:.3f} ± {answer.sigma_gap_mm:.3f} mm      "
        f"flush {answer.flush_mm:+.3f} ± {answer.sigma_flush_mm:.3f} mm      "
        f"reference: {reference} face" + (f"      doubtful: {answer.flag}" if answer.flag else ""),
        fontsize=9,
    )
    write_bytes(path, picture_bytes(figure, path.suffix.lower()[1:], dpi=100))


def _draw_edge(axis: Axes, edge: PanelEdge, text: str) -> None:
    p = edge.parameters
    tangent, centre, along = edge.tangent_point(p), edge.centre(p), edge.face_direction(p)
    axis.plot(*np.array([tangent - edge.side * FACE_MM * along, tangent]).T, color=PANEL, linewidth=1.5)
    angle = np.linspace(0, 2 * np.pi, 200)
    axis.plot(*(centre[:, None] + p[3] * np.array([np.cos(angle), np.sin(angle)])), "--", color=PANEL, linewidth=0.8)
    axis.plot(*tangent, "o", color=PANEL, markersize=4)
    axis.annotate(text, tuple(centre), ha="center", va="center", fontsize=8, color=PANEL)


def _draw_lengths(axis: Axes, answer: GapFlush, reference: PanelEdge) -> None:
    """The gap below the panels and the flush beside the other one, along and across the reference face."""
    along = reference.face_direction(reference.parameters)
    down = np.array([-along[1], along[0]])
    foot = answer.flush_points[1]
    inwards = reference.side * along
    axis.plot(*np.array([foot - 10 * inwards, foot + 3 * inwards]).T, ":", color="black", linewidth=0.8)
    level = max(float((point - foot) @ down) for point in answer.gap_points) + 2.5
    ends = np.array([point + (level - (point - foot) @ down) * down for point in answer.gap_points])
    _arrow(axis, ends, f"gap {answer.gap_mm:.2f} mm", 0.7 * down, "center")
    _arrow(axis, answer.flush_points, f"flush {answer.flush_mm:+.2f} mm", 0.4 * along, "left")
    for point, end in zip(answer.gap_points, ends, strict=True):
        axis.plot(*np.array([point, end]).T, color=LENGTH, linewidth=0.6)
        axis.plot(*point, "o", color=LENGTH, markersize=4)


def _arrow(axis: Axes, ends: Array, text: str, offset: Array, align: str) -> None:
    axis.annotate("", tuple(ends[0]), tuple(ends[1]), arrowprops={"arrowstyle": "<->", "color": LENGTH})
    axis.annotate(text, tuple(ends.mean(axis=0) + offset), color=LENGTH, fontsize=9, ha=align, va="center")
