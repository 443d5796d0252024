"""Plots of a run as SVG, addresses that hold their data."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from workbench.campaign.results.summary import Group
from workbench.report import new_figure, svg

if TYPE_CHECKING:
    from matplotlib.figure import Figure

Array = NDArray[np.float64]

MARKED = 8  # so many values of a factor are written at its axis
_BLUE, _ORANGE = "#2563a8", "#c2571a"


def factor_plot(factor: str, groups: Sequence[Group], label: str, *, log: bool = False) -> str:
    """Median and 95 % error against a factor, each with its confidence band.

    An open band ends at the plot's upper edge, dotted. log: equal ratios along the factor's axis.
    """
    figure, axes = _figure(5.2, 3.2)
    groups = [g for g in groups if g.answered]
    if not groups:
        return ""
    numeric = all(g.centre is not None for g in groups)
    x = np.array([g.centre for g in groups], dtype=float) if numeric else np.arange(len(groups), dtype=float)
    known = [v for g in groups for v in (g.p95, g.median_band[1], g.p95_band[1]) if np.isfinite(v)]
    top = 1.08 * max(known)
    _series(axes, x, [(g.median, g.median_band) for g in groups], (_BLUE, "median"), top, joined=numeric)
    _series(axes, x, [(g.p95, g.p95_band) for g in groups], (_ORANGE, "95 % of the trials"), top, joined=numeric)
    if log and numeric:
        axes.set_xscale("log")
    elif len(groups) <= MARKED:
        axes.set_xticks(x, [g.value for g in groups])
    if not numeric:
        axes.set_xlim(-0.5, len(groups) - 0.5)
    axes.set_xlabel(factor)
    axes.set_ylabel(label)
    axes.set_ylim(0, top)
    axes.legend(frameon=False, ncols=2, loc="lower center", bbox_to_anchor=(0.5, 1.0))
    return svg(figure)


def _series(
    axes: Any,
    x: Array,
    values: list[tuple[float, tuple[float, float]]],
    look: tuple[str, str],
    top: float,
    *,
    joined: bool,
) -> None:
    """One quantile with its band: a ribbon along numbers, bars at names."""
    colour, name = look
    middle = np.array([v for v, _ in values])
    low, high = np.array([band for _, band in values]).T
    axes.plot(x, middle, "o-" if joined else "o", color=colour, label=name, markersize=4)
    seen = np.where(np.isfinite(high), high, top)
    if joined and len(x) > 1:
        axes.fill_between(x, low, seen, color=colour, alpha=0.15, linewidth=0)
    for one, a, b, closed in zip(x, low, seen, np.isfinite(high), strict=True):
        axes.plot([one, one], [a, b], color=colour, linewidth=1.2, linestyle="-" if closed else ":", alpha=0.7)


def nees_plot(nees: Array) -> str:
    """The trials' NEES against the χ² distribution of 6 degrees of freedom."""
    from scipy.stats import chi2

    figure, axes = _figure(5.2, 3.0)
    top = float(max(20.0, np.quantile(nees, 0.99))) if len(nees) else 20.0
    axes.hist(np.clip(nees, 0, top), bins=40, range=(0, top), density=True, color=_BLUE, alpha=0.45, label="trials")
    x = np.linspace(0, top, 300)
    axes.plot(x, chi2.pdf(x, 6), color=_ORANGE, label="χ², 6 degrees of freedom")
    axes.set_xlabel("NEES of the SCP")
    axes.legend(frameon=False)
    return svg(figure)


def _figure(width: float, height: float) -> tuple[Figure, Any]:
    figure, axes = new_figure(width, height)
    axes.spines[["top", "right"]].set_visible(False)
    axes.grid(alpha=0.25)
    return figure, axes
