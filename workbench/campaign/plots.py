"""Plots of a run as inline SVG."""

from __future__ import annotations

import io
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from workbench.campaign.summary import Group

Array = NDArray[np.float64]

_BLUE, _ORANGE = "#2563a8", "#c2571a"


def factor_plot(factor: str, groups: Sequence[Group], unit: str) -> str:
    """Median and 95 % error against a factor, each with its confidence band; SVG text."""
    plt, figure, axes = _figure(5.2, 3.2)
    numeric = all(g.centre is not None for g in groups)
    x = np.array([g.centre for g in groups], dtype=float) if numeric else np.arange(len(groups), dtype=float)
    for name, colour, middle, band in (
        ("median", _BLUE, [g.median for g in groups], [g.median_band for g in groups]),
        ("95 %", _ORANGE, [g.p95 for g in groups], [g.p95_band for g in groups]),
    ):
        low, high = np.array(band).T
        axes.plot(x, middle, "o-", color=colour, label=name, markersize=4)
        axes.fill_between(x, low, high, color=colour, alpha=0.18, linewidth=0)
    if not numeric:
        axes.set_xticks(x, [g.value for g in groups])
    axes.set_xlabel(factor)
    axes.set_ylabel(f"SCP error [{unit}]")
    axes.set_ylim(bottom=0)
    axes.legend(frameon=False)
    return _svg(plt, figure)


def nees_plot(nees: Array) -> str:
    """The trials' NEES against the χ² distribution of 6 degrees of freedom; SVG text."""
    from scipy.stats import chi2

    plt, figure, axes = _figure(5.2, 3.0)
    top = float(max(20.0, np.quantile(nees, 0.99))) if len(nees) else 20.0
    axes.hist(np.clip(nees, 0, top), bins=40, range=(0, top), density=True, color=_BLUE, alpha=0.45, label="trials")
    x = np.linspace(0, top, 300)
    axes.plot(x, chi2.pdf(x, 6), color=_ORANGE, label="χ², 6 degrees of freedom")
    axes.set_xlabel("NEES of the SCP")
    axes.legend(frameon=False)
    return _svg(plt, figure)


def _figure(width: float, height: float) -> tuple[Any, Any, Any]:
    import matplotlib as mpl

    mpl.use("Agg")
    mpl.rcParams["svg.hashsalt"] = "campaign"  # the same SVG for the same data
    import matplotlib.pyplot as plt

    figure, axes = plt.subplots(figsize=(width, height), layout="constrained")
    axes.spines[["top", "right"]].set_visible(False)
    axes.grid(alpha=0.25)
    return plt, figure, axes


def _svg(plt: Any, figure: Any) -> str:
    sink = io.StringIO()
    figure.savefig(sink, format="svg", metadata={"Date": None})
    plt.close(figure)
    text = sink.getvalue()
    return text[text.index("<svg") :]
