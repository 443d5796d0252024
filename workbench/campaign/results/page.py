"""One HTML page of a run: the advice, errors against factors, consistency, verdicts, and the worst trials."""

from __future__ import annotations

from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from workbench.campaign.asked.trials import trial_seed, trial_settings
from workbench.campaign.results.advice import FEWEST, PoseBudget, advice, cells, reached
from workbench.campaign.results.plots import factor_plot, nees_plot
from workbench.campaign.results.summary import (
    AskedAccuracy,
    Group,
    Run,
    by_factor,
    consistency,
    groups_of,
    proportion_band,
    quantile_band,
    read_run,
    verdicts,
    worst_frame,
    worst_trials,
)
from workbench.campaign.trial.trial import one_trial_frame
from workbench.files import write_text
from workbench.report import origin_of, png, render_page

WORST = 4  # worst trials that are shown
NO_BOUND = "∞"
# the columns that a kind of run is judged by, and their names on the page
ERRORS = {
    "calibrate": (("error_mm", "SCP error [mm]"), ("error_deg", "SCP error [deg]")),
    "pose": (("pose_rms_mm", "jig pose error, rms [mm]"), ("pose_rms_deg", "jig pose error, rms [deg]")),
    "extract": (("point_rms_y_mm", "point error in y, rms [mm]"), ("point_rms_z_mm", "point error in z, rms [mm]")),
}


def write_page(folder: Path, target: AskedAccuracy, out: Path | None = None) -> Path:
    """Write the page of a finished run.

    Parameters
    ----------
    folder
        Of the run.
    target
        The accuracy that is asked for, by which the page advises.
    out
        The page; default: report.html in the folder.

    Returns
    -------
    Path
        The page.

    """
    run = read_run(folder)
    path = out or folder / "report.html"
    about = replace(origin_of(folder.glob("*.json"), folder), settings_sha256=run.plan.fingerprint)
    write_text(path, render_page("workbench.campaign.results", "page.html.j2", _content(run, target), about))
    return path


def run_object(run: Run, target: AskedAccuracy) -> dict[str, Any]:
    """The page's numbers plainly: the whole run, and each factor's groups; open ends of a band are None."""
    solved = run.plan.run == "calibrate"
    true = consistency(run)
    good = reached(run, target) if solved else None
    return {
        "folder": str(run.folder),
        "trials": run.size,
        "answered": int(run.answered.sum()),
        "verdicts": dict(verdicts(run)),
        "target": {"mm": target.mm, "deg": target.deg, "level": target.level},
        "reached": None if good is None else _share(int(good.sum()), run.size),
        "consistency": None if true is None else asdict(true),
        "errors": {c: _quantiles(np.where(run.answered, run.real(c), np.nan)) for c, _ in ERRORS[run.plan.run]},
        "factors": {
            name: {
                column: [asdict(group) for group in by_factor(run, name, column)] for column, _ in ERRORS[run.plan.run]
            }
            for name in run.plan.factors
        },
        "advice": advice(run, target) if solved else _spots(run),
    }


def _share(hits: int, trials: int) -> dict[str, Any]:
    return {"trials": hits, "share": hits / max(trials, 1), "share_band": list(proportion_band(hits, trials))}


def _quantiles(values: Any) -> dict[str, Any]:
    known = np.sort(values[np.isfinite(values)])
    median, p95 = (quantile_band(known, q) for q in (0.5, 0.95))
    return {"median": median[0], "median_band": list(median[1]), "p95": p95[0], "p95_band": list(p95[1])}


def _content(run: Run, target: AskedAccuracy) -> dict[str, Any]:
    solved = run.plan.run == "calibrate"
    nees = run.real("nees")
    nees = nees[np.isfinite(nees) & run.answered]
    errors = ERRORS[run.plan.run]
    return {
        "title": run.plan.name or run.folder.name,
        "folder": run.folder.name,
        "run": run,
        "solved": solved,
        "target": target,
        "answered": int(run.answered.sum()),
        "advice": advice(run, target) if solved else _spots(run),
        "spots": _spots(run),
        "cells": [_cell_row(c) for c in cells(run, target)] if solved else [],
        "fewest": FEWEST,
        "verdicts": [(code, n, _percent(n, run.size)) for code, n in verdicts(run)],
        "totals": [(name, _total(np.where(run.answered, run.real(column), np.nan))) for column, name in errors],
        "consistency": consistency(run),
        "nees_plot": nees_plot(nees) if len(nees) else "",
        "factors": [_factor(run, name, errors, target) for name in run.plan.factors],
        "worst": [_worst(run, i) for i in worst_trials(run, WORST)],
    }


def _spots(run: Run) -> str:
    visible, found = np.nansum(run.real("spots_visible")), np.nansum(run.real("spots_found"))
    wrong, false = np.nansum(run.real("points_mislabelled")), np.nansum(run.real("points_false"))
    if not visible:
        return "No string is visible in any trial."
    low, high = (100 * b for b in proportion_band(int(found), int(visible)))
    return (
        f"{found:.0f} of {visible:.0f} visible spots found: {100 * found / visible:.2f} % (95 % interval {low:.2f} … "
        f"{high:.2f} %), {wrong:.0f} mislabelled, {false:.0f} false."
    )


def _percent(hits: int, trials: int) -> str:
    low, high = (100 * b for b in proportion_band(hits, trials))
    return f"{100 * hits / trials:.1f} % ({low:.1f} … {high:.1f})"


def _total(values: Any) -> list[str]:
    known = values[np.isfinite(values)]
    if not len(known):
        return ["–"] * 3
    return [f"{np.median(known):.4f}", f"{np.quantile(known, 0.95):.4f}", f"{known.max():.4f}"]


def _cell_row(cell: PoseBudget) -> list[str]:
    return [f"{cell.poses:.0f}", f"{cell.tilt_deg:.0f}°", str(cell.trials), _percent(cell.hits, cell.trials)]


def _factor(run: Run, name: str, errors: tuple[tuple[str, str], ...], target: AskedAccuracy) -> dict[str, Any]:
    groups = [by_factor(run, name, column) for column, _ in errors]
    good = reached(run, target) if run.plan.run == "calibrate" else None
    rows = []
    for (_, _, mask), one in zip(groups_of(run, name), zip(*groups, strict=True), strict=True):
        share = [] if good is None else [_percent(int(good[mask].sum()), int(mask.sum()))]
        texts = [text for group in one for text in _cells(group)]
        rows.append([one[0].value, one[0].trials, one[0].answered, *texts, *share])
    factor = run.plan.factors[name]
    log = not isinstance(factor, list) and factor.log
    plots = [factor_plot(name, g, label, log=log) for g, (_, label) in zip(groups, errors, strict=True)]
    return {"name": name, "plots": plots, "rows": rows, "labels": [label for _, label in errors]}


def _cells(group: Group) -> tuple[str, str]:
    return _with_band(group.median, group.median_band), _with_band(group.p95, group.p95_band)


def _with_band(value: float, band: tuple[float, float]) -> str:
    if not np.isfinite(value):
        return "–"
    high = f"{band[1]:.3g}" if np.isfinite(band[1]) else NO_BOUND
    return f"{value:.3g} ({band[0]:.3g} … {high})"


def _worst(run: Run, trial: int) -> dict[str, Any]:
    _, settings = trial_settings(run.plan, trial)
    number = worst_frame(run, trial)
    frame = one_trial_frame(settings, run.plan.run, trial_seed(run.plan, trial), number)
    values = ", ".join(f"{name} = {run.trials[name][trial]}" for name in run.plan.factors)
    text = f"frame {number}; {run.trials['verdict'][trial]}; {_how_bad(run, trial)}; {values}"
    return {"trial": trial, "image": _picture(None if frame is None else frame.image), "text": text}


def _how_bad(run: Run, trial: int) -> str:
    parts = []
    for column, name in ERRORS[run.plan.run]:
        value = run.trials[column][trial]
        parts.append(f"{name} " + ("–" if value is None else f"{value:.4f}"))
    seen, found = run.trials["spots_visible"][trial], run.trials["spots_found"][trial]
    return ", ".join(parts) + ("" if seen is None else f"; {found} of {seen} spots")


def _picture(image: Any) -> str:
    """A small, brightened picture for the page; a dark field where there is none."""
    if image is None:
        image = np.zeros((256, 320), np.uint8)
    low, high = np.median(image), max(float(np.quantile(image, 0.9995)), float(np.median(image)) + 8)
    bright = np.clip((image.astype(np.float32) - 0.6 * low) / (high - 0.6 * low), 0, 1) * 255
    kernel = np.ones((2, 2), np.uint8)  # spots of two pixels would vanish in the smaller picture
    small = cv2.resize(cv2.dilate(bright.astype(np.uint8), kernel), None, fx=0.5, fy=0.5, interpolation=cv2.INTER_AREA)
    return png(small)
