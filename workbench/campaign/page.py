"""One HTML page of a run: errors against factors, consistency, verdicts, worst trials, and the advice."""

from __future__ import annotations

import base64
from importlib.resources import files
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from workbench.campaign.plots import factor_plot, nees_plot
from workbench.campaign.shard import trial_seed, trial_settings
from workbench.campaign.summary import (
    Group,
    Run,
    Target,
    advice,
    by_factor,
    consistency,
    read_run,
    verdicts,
    worst_trials,
)
from workbench.campaign.trial import trial_frames
from workbench.formats.atomic import write_text

WORST = 4
ERRORS = {"calibrate": (("error_mm", "mm"), ("error_deg", "deg"))}
POINT_ERRORS = (("point_rms_y_mm", "mm in y"), ("point_rms_z_mm", "mm in z"))


def write_page(folder: Path, target: Target, out: Path | None = None) -> Path:
    """Write the page of the run in ``folder`` (default report.html in it) and return its path."""
    import jinja2

    run = read_run(folder)
    environment = jinja2.Environment(autoescape=True, undefined=jinja2.StrictUndefined)
    template = environment.from_string((files("workbench.campaign") / "page.html.j2").read_text(encoding="utf-8"))
    path = out or folder / "report.html"
    write_text(path, template.render(**_content(run, target)))
    return path


def _content(run: Run, target: Target) -> dict[str, Any]:
    nees = run.real("nees")
    errors = ERRORS.get(run.plan.run, POINT_ERRORS)
    return {
        "title": run.plan.name or run.folder.name,
        "folder": run.folder.name,
        "trials": run.size,
        "run": run.plan.run,
        "design": run.plan.design,
        "seed": run.plan.seed,
        "fingerprint": run.plan.fingerprint,
        "advice": advice(run, target) if run.plan.run == "calibrate" else _spots(run),
        "verdicts": verdicts(run),
        "totals": [(f"SCP error [{u}]" if run.plan.run == "calibrate" else u, _total(run.real(e))) for e, u in errors],
        "consistency": consistency(run),
        "nees_plot": nees_plot(nees[np.isfinite(nees)]) if np.any(np.isfinite(nees)) else "",
        "factors": [_factor(run, name, errors) for name in run.plan.factors],
        "worst": [_worst(run, i) for i in worst_trials(run, WORST)],
    }


def _spots(run: Run) -> str:
    visible, found = np.nansum(run.real("spots_visible")), np.nansum(run.real("spots_found"))
    wrong, false = np.nansum(run.real("points_mislabelled")), np.nansum(run.real("points_false"))
    share = 100 * found / visible if visible else 0.0
    return (
        f"{found:.0f} of {visible:.0f} visible spots found ({share:.2f} %), {wrong:.0f} mislabelled, {false:.0f} false."
    )


def _total(values: Any) -> list[str]:
    known = values[np.isfinite(values)]
    if not len(known):
        return ["–"] * 3
    return [f"{np.median(known):.4f}", f"{np.quantile(known, 0.95):.4f}", f"{known.max():.4f}"]


def _factor(run: Run, name: str, errors: tuple[tuple[str, str], ...]) -> dict[str, Any]:
    groups = [by_factor(run, name, error) for error, _ in errors]
    rows = [
        [g[0].value, g[0].trials, g[0].answered, *(text for one in g for text in _cells(one))]
        for g in zip(*groups, strict=True)
    ]
    units = [unit for _, unit in errors]
    plots = [factor_plot(name, g, unit) for g, unit in zip(groups, units, strict=True)]
    return {"name": name, "plots": plots, "rows": rows, "units": units}


def _cells(group: Group) -> tuple[str, str]:
    return f"{group.median:.4f}", f"{group.p95:.4f} ({group.p95_band[0]:.4f} … {group.p95_band[1]:.4f})"


def _worst(run: Run, trial: int) -> dict[str, Any]:
    _, settings = trial_settings(run.plan, trial)
    frame = next(trial_frames(settings, run.plan.run, trial_seed(run.plan, trial)), None)
    error = run.trials["error_mm"][trial]
    text = f"{run.trials['verdict'][trial]}, " + ("no SCP" if error is None else f"{error:.3f} mm off")
    values = ", ".join(f"{name} = {run.trials[name][trial]}" for name in run.plan.factors)
    return {"trial": trial, "image": _picture(None if frame is None else frame[1].image), "text": f"{text}; {values}"}


def _picture(image: Any) -> str:
    """A small, brightened PNG as base64; a dark field where there is none."""
    if image is None:
        image = np.zeros((256, 320), np.uint8)
    low, high = np.median(image), max(float(np.quantile(image, 0.9995)), float(np.median(image)) + 8)
    bright = np.clip((image.astype(np.float32) - 0.6 * low) / (high - 0.6 * low), 0, 1) * 255
    kernel = np.ones((2, 2), np.uint8)  # spots of two pixels would vanish in the smaller picture
    small = cv2.resize(cv2.dilate(bright.astype(np.uint8), kernel), None, fx=0.5, fy=0.5, interpolation=cv2.INTER_AREA)
    return base64.b64encode(cv2.imencode(".png", small)[1].tobytes()).decode("ascii")
