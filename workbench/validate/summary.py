"""Figures of a validation, curves over the conditions, and thresholds that make it pass or fail."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from workbench.files import FileSection, NotNegative, read_toml, validate
from workbench.validate.measure import MeasuredFrames

ERRORS = (
    "bias_y_mm", "bias_z_mm", "scatter_y_mm", "scatter_z_mm", "bias_u_px", "bias_v_px", "scatter_px", "sigma_ratio",
    "bound_ratio",
)  # fmt: skip
OF_SENSORS = ("sensor_bias_y_mm", "sensor_bias_z_mm", "sensor_rms_y_mm", "sensor_rms_z_mm", "sensor_sigma_ratio")
BINS = 5  # points of a curve
HONEST = 0.1  # claimed over empirical σ differs from 1 by less: a validation of usual length tells no more
MIN_IN_BIN = 10  # strings; a scatter of fewer is known to worse than a quarter of itself


class Thresholds(FileSection):
    """The keys of a thresholds file; what is absent is not asked for."""

    min_detection_rate: NotNegative | None = None
    max_false_rate: NotNegative | None = None
    max_mislabel_rate: NotNegative | None = None
    max_flagged_rate: NotNegative | None = None
    max_bias_y_mm: NotNegative | None = None
    max_bias_z_mm: NotNegative | None = None
    max_scatter_y_mm: NotNegative | None = None
    max_scatter_z_mm: NotNegative | None = None
    max_scatter_px: NotNegative | None = None
    max_bias_u_px: NotNegative | None = None
    max_bias_v_px: NotNegative | None = None
    max_bound_ratio: NotNegative | None = None
    min_sigma_ratio: NotNegative | None = None
    max_sigma_ratio: NotNegative | None = None
    max_sensor_rms_y_mm: NotNegative | None = None
    max_sensor_rms_z_mm: NotNegative | None = None
    min_sensor_sigma_ratio: NotNegative | None = None
    max_sensor_sigma_ratio: NotNegative | None = None
    min_stripe_found_rate: NotNegative | None = None
    max_stripe_wrong_rate: NotNegative | None = None
    max_stripe_bias_mm: NotNegative | None = None
    max_stripe_scatter_mm: NotNegative | None = None
    min_stripe_sigma_ratio: NotNegative | None = None
    max_stripe_sigma_ratio: NotNegative | None = None


@dataclass(frozen=True)
class Failure:
    """A figure on the wrong side of its threshold."""

    key: str
    value: float | None
    limit: float


def read_thresholds(path: Path) -> Thresholds:
    """Thresholds of a TOML file; InputError names file, line and key."""
    return validate(Thresholds, read_toml(path))


def figures(measured: MeasuredFrames) -> dict[str, float | None]:
    """Figures over the nominal frames; errors over visible, rightly labelled points without a flag.

    detection_rate: of the visible strings whose light an ideal detector would tell from the noise; too_faint counts the
    others, found or not.

    sigma_ratio: claimed over empirical, 1 is honest. bound_ratio: error over the camera's bound, speckle not in it.
    sensor_…: of sensors that were drawn from the file's uncertainty, their own part in the claimed σ; absent where none
    was drawn. stripe_…: of the stripe on plates; absent where it was not looked at.
    """
    counts = [c for c in measured.counts if c["nominal"]]
    strings = [s for s in measured.strings if s["nominal"] and s["visible"]]
    total = {key: sum(c[key] for c in counts) for key in ("visible", "found", "false", "mislabelled", "labelled")}
    found = [s for s in strings if s["found"]]
    good = [s for s in found if not s["flag"]]
    return {
        "frames": len(counts),
        "points": len(good),
        "detection_rate": _detected(strings),
        "too_faint": sum(not s["detectable"] for s in strings),
        "false_rate": _share(total["false"], total["labelled"]),
        "mislabel_rate": _share(total["mislabelled"], total["labelled"]),
        "flagged_rate": _share(len(found) - len(good), len(found)),
        **_errors(good),
        **_of_sensors(measured.by_drawn_sensors),
        **measured.stripe,
    }


def in_words(result: dict[str, float | None]) -> str:
    """What the figures say of extraction, in two sentences or three."""
    found, scatter_y, scatter_z = (result.get(k) for k in ("detection_rate", "scatter_y_mm", "scatter_z_mm"))
    if found is None:
        return "No string was visible: nothing can be said of spots."
    wrong = (result["false_rate"] or 0.0) + (result["mislabel_rate"] or 0.0)
    said = f"Of the strings bright enough {100 * found:.1f} % are found, " + (
        f"{100 * wrong:.2g} % of the labelled points are wrong." if wrong else "no labelled point is wrong."
    )
    if scatter_y is not None and scatter_z is not None:
        honest = _honest(result["sigma_ratio"])
        said += f" A string's axis is measured to {scatter_y:.2g} mm in y and {scatter_z:.2g} mm in z; {honest}."
    scatter, bias = result.get("stripe_scatter_mm"), result.get("stripe_bias_mm")
    if scatter is not None and bias is not None:
        share, honest = 100 * (result["stripe_found_rate"] or 0.0), _honest(result["stripe_sigma_ratio"])
        said += (
            f" On a matte plate {share:.1f} % of the stripe's sections have a point, which scatters by "
            f"{scatter:.2g} mm about a plate that lies {abs(bias):.1g} mm off; {honest}."
        )
    elif "stripe_points" in result:
        said += " On a matte plate extraction finds too little of the stripe for any figure."
    return said


def _honest(ratio: float | None) -> str:
    if ratio is None:
        return "nothing tells whether σ hold"
    off = abs(ratio - 1)
    return "σ hold" if off < HONEST else f"σ are stated {100 * off:.0f} % too {'small' if ratio < 1 else 'large'}"


def _of_sensors(rows: Sequence[dict[str, Any]]) -> dict[str, float | None]:
    """Figures over drawn sensors; empty without any."""
    if not rows:
        return {}
    good = [r for r in rows if r["visible"] and r["found"] and not r["flag"]]
    count: dict[str, float | None] = {"sensors": len({r["sensor"] for r in rows})}
    if len(good) < 2:
        return count | dict.fromkeys(OF_SENSORS)
    y, z, chi2 = (np.array([r[k] for r in good]) for k in ("error_y_mm", "error_z_mm", "chi2_with_sensor"))
    rms_y, rms_z = (float(np.sqrt(np.mean(e**2))) for e in (y, z))
    ratio = float(1 / np.sqrt(np.mean(chi2) / 2))
    return count | dict(zip(OF_SENSORS, (float(y.mean()), float(z.mean()), rms_y, rms_z, ratio), strict=True))


def _errors(rows: Sequence[dict[str, Any]]) -> dict[str, float | None]:
    if len(rows) < 2:
        return dict.fromkeys(ERRORS)
    y, z = (np.array([r[k] for r in rows]) for k in ("error_y_mm", "error_z_mm"))
    px = np.array([[r["error_u_px"], r["error_v_px"]] for r in rows])
    bound = np.array([r["bound_px"] for r in rows])
    known = np.isfinite(bound)
    mean_square = np.mean(np.sum((px - px.mean(axis=0)) ** 2, axis=1) / 2)
    ratio = float(np.sqrt(np.mean(np.sum(px[known] ** 2, 1) / 2 / bound[known] ** 2))) if known.any() else None
    return {
        "bias_y_mm": float(y.mean()),
        "bias_z_mm": float(z.mean()),
        "scatter_y_mm": float(y.std(ddof=1)),
        "scatter_z_mm": float(z.std(ddof=1)),
        "bias_u_px": float(px[:, 0].mean()),
        "bias_v_px": float(px[:, 1].mean()),
        "scatter_px": float(np.sqrt(mean_square)),
        "sigma_ratio": float(1 / np.sqrt(np.mean([r["chi2"] for r in rows]) / 2)),
        "bound_ratio": ratio,
    }


def failures(result: dict[str, float | None], thresholds: Thresholds) -> list[Failure]:
    """Thresholds that are not held; a figure that could not be formed fails its threshold."""
    out = []
    for key, limit in thresholds.model_dump(exclude={"name"}).items():
        if limit is None:
            continue
        value = result.get(key.split("_", 1)[1])
        size = None if value is None else abs(value)
        if size is None or (size < limit if key.startswith("min") else size > limit):
            out.append(Failure(key, value, limit))
    return out


def curve(measured: MeasuredFrames, factor: str) -> list[dict[str, Any]]:
    """Figures in bins of a factor over the varied frames, each with as many strings."""
    rows = [s for s in measured.strings if not s["nominal"] and s["visible"] and np.isfinite(s.get(factor, np.nan))]
    values = np.array([r[factor] for r in rows])
    if len(rows) < 2 * MIN_IN_BIN:
        return []
    kinds = np.unique(values)
    quantiles = np.unique(np.quantile(values, np.linspace(0, 1, BINS + 1)))
    edges = np.append(kinds, kinds[-1] + 1) if len(kinds) <= BINS else quantiles  # a few kinds: a point for each
    out = []
    for k in range(max(len(edges) - 1, 1)):
        last = k >= len(edges) - 2
        inside = (values >= edges[k]) & ((values <= edges[-1]) if last else (values < edges[k + 1]))
        mine = [r for r, use in zip(rows, inside, strict=True) if use]
        if len(mine) >= MIN_IN_BIN:
            found = [r for r in mine if r["found"]]
            good = [r for r in found if not r["flag"]]
            asked = mine if factor == "signal_e" else [r for r in mine if r["detectable"]]  # by light itself: of all
            rate = _share(sum(r["found"] for r in asked), len(asked))
            point: dict[str, Any] = {"at": float(np.median(values[inside])), "detection_rate": rate}
            out.append(point | _errors(good))
    return out


def _detected(rows: Sequence[dict[str, Any]]) -> float | None:
    """Share of the detectable strings that were found."""
    asked = [r for r in rows if r["detectable"]]
    return _share(sum(r["found"] for r in asked), len(asked))


def _share(part: int, whole: int) -> float | None:
    return part / whole if whole else None
