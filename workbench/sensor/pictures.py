"""Pictures of a sensor's calibration: reprojection vectors, stripes off the plane, what was covered."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from calib.sensor import SensorCalibration
from workbench.report import new_figure

if TYPE_CHECKING:
    from matplotlib.figure import Figure

BLUE, RED, GREY = "#2a6f97", "#c44e52", "0.6"
ARROW_SHARE = 0.05  # of the image's width, of the longest usual arrow


def reprojection_figure(result: SensorCalibration, size_px: tuple[int, int]) -> Figure:
    """Where corners were seen, with what is left of them as arrows, much enlarged."""
    figure, axis = new_figure(7.0, 5.2)
    seen = [v for v in result.views if v.corners_px is not None and v.errors_px is not None]
    at = np.concatenate([v.corners_px for v in seen if v.corners_px is not None])
    error = np.concatenate([v.errors_px for v in seen if v.errors_px is not None])
    usual = max(float(np.percentile(np.linalg.norm(error, axis=1), 95)), 1e-9)
    scale = ARROW_SHARE * size_px[0] / usual
    axis.quiver(*at.T, *(-error.T), angles="xy", scale_units="xy", scale=1 / scale, color=RED, width=0.0016)
    axis.plot(*at.T, ".", ms=1.5, color=GREY)
    _image_axes(axis, size_px)
    axis.set_title(f"seen less projected; an arrow of {ARROW_SHARE * size_px[0]:.0f} px is {usual:.3f} px", fontsize=10)
    return figure


def coverage_figure(result: SensorCalibration, size_px: tuple[int, int]) -> Figure:
    """What of the image corners and stripes covered."""
    figure, axis = new_figure(7.0, 5.2)
    for v in result.views:
        if v.corners_px is not None:
            axis.plot(*v.corners_px.T, ".", ms=2, color=BLUE)
        if v.stripe_px is not None:
            axis.plot(*v.stripe_px.T, ",", color=RED)
    axis.plot([], [], ".", color=BLUE, label="corners")
    axis.plot([], [], "-", color=RED, label="stripes")
    axis.legend(fontsize=8, loc="upper right")
    _image_axes(axis, size_px)
    return figure


def plane_figure(result: SensorCalibration) -> Figure:
    """The stripes in the laser plane, coloured by their distance from it."""
    figure, axis = new_figure(7.0, 4.6)
    yz = np.concatenate([v.stripe_yz_mm for v in result.views if v.stripe_yz_mm is not None])
    off = np.concatenate([v.stripe_mm for v in result.views if v.stripe_mm is not None])
    top = max(float(np.percentile(np.abs(off), 98)), 1e-9)
    dots = axis.scatter(*yz.T, c=off, s=4, cmap="coolwarm", vmin=-top, vmax=top)
    figure.colorbar(dots, ax=axis, label="off the plane [mm]")
    axis.set_xlabel("y [mm]")
    axis.set_ylabel("z [mm]")
    axis.set_aspect("equal", adjustable="datalim")
    return figure


def views_figure(result: SensorCalibration) -> Figure:
    """Every view's own figures, as fitted and as predicted by the others."""
    figure, axes = new_figure(8.6, 0.6 + 0.24 * max(len(result.views), 6), columns=2)
    names = [v.name for v in result.views]
    y = np.arange(len(names))
    kinds = (("reprojection_rms_px", "left_out_px", "reprojection [px]"), ("plane_rms_mm", "left_out_mm", "plane [mm]"))
    for axis, (own, out, title) in zip(axes, kinds, strict=True):
        axis.barh(y, [getattr(v, own) for v in result.views], color=BLUE, height=0.5, label="fitted")
        axis.plot([getattr(v, out) for v in result.views], y, "d", color=RED, ms=4, label="left out")
        axis.set_xlabel(title)
    axes[0].set_yticks(y, names, fontsize=7)
    axes[0].invert_yaxis()
    axes[0].legend(fontsize=7)
    return figure


def _image_axes(axis: object, size_px: tuple[int, int]) -> None:
    from matplotlib.axes import Axes

    assert isinstance(axis, Axes)  # noqa: S101 - for the type checker
    axis.set_xlim(-0.5, size_px[0] - 0.5)
    axis.set_ylim(size_px[1] - 0.5, -0.5)
    axis.set_aspect("equal")
    axis.set_xlabel("u [px]")
    axis.set_ylabel("v [px]")
