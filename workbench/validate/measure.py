"""One row for every string of every frame: found or not, how far off, what σ was claimed, what the bound allows."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from calib import CalibConfig
from calib.label import label_frame
from extraction import extract
from geometry import Frame
from geometry.sensor import calibration_covariance
from perceptron_emu import render
from workbench.compare import VISIBLE, Comparison, KnownString, Match, match, named_points, true_strings
from workbench.files import Settings
from workbench.validate.bound import DETECTABLE_SNR, best_snr, noise_free_electrons, position_bound_px
from workbench.validate.drawing import Drawn

Array = NDArray[np.float64]
Progress = Callable[[int, int], None]


@dataclass(frozen=True, eq=False)
class MeasuredFrames:
    """All frames. strings: a row for each string; counts: a row for each frame.

    by_drawn_sensors: rows of strings that sensors with errors of their own saw, read by the file's numbers. stripe:
    figures of the stripe on plates, by name, where it was looked at.
    """

    strings: list[dict[str, Any]]
    counts: list[dict[str, Any]]
    by_drawn_sensors: list[dict[str, Any]] = field(default_factory=list)
    stripe: dict[str, float | None] = field(default_factory=dict)


def measure_drawn_sensors(frames: Sequence[Drawn], settings: Settings, progress: Progress) -> list[dict[str, Any]]:
    """Rows of strings as sensors saw them that differ from their file, each beside its truth."""
    rows: list[dict[str, Any]] = []
    for done, frame in enumerate(frames, start=1):
        rendered = render(frame.scene, frame.config, np.random.default_rng(list(frame.seed)))
        table = label_drawn(frame, rendered.image, settings)
        own = calibration_covariance(frame.by_file or frame.scene.sensor, table.axis.yz_mm)
        own = np.zeros((len(table.axis), 2, 2)) if own is None else own
        for row in score(table, rendered.truth.strings)[0]:
            more: dict[str, Any] = {}
            if row["found"]:
                k = table.axis.label.index(row["label"])
                error = np.array([row["error_y_mm"], row["error_z_mm"]])
                both = table.axis.cov_yz_mm2[k] + own[k]
                more = {
                    "sigma_sensor_y_mm": float(np.sqrt(own[k, 0, 0])),
                    "sigma_sensor_z_mm": float(np.sqrt(own[k, 1, 1])),
                }
                more |= {"chi2_with_sensor": float(error @ np.linalg.solve(both, error))}
            rows.append({"sensor": done - 1} | row | more)
        progress(done, len(frames))
    return rows


def measure_drawn(frames: Sequence[Drawn], settings: Settings, progress: Progress) -> MeasuredFrames:
    """Render, extract and label every drawn frame and set it beside its truth."""
    strings: list[dict[str, Any]] = []
    counts: list[dict[str, Any]] = []
    for done, frame in enumerate(frames, start=1):
        rendered = render(frame.scene, frame.config, np.random.default_rng(list(frame.seed)))
        table = label_drawn(frame, rendered.image, settings)
        electrons = noise_free_electrons(frame.scene, frame.config)
        bounds = [position_bound_px(electrons, s.image_px, frame.config, frame.scene) if _seen(s) else np.nan
                  for s in rendered.truth.strings]  # fmt: skip
        rows, count = score(table, rendered.truth.strings, bounds)
        common = {"frame": frame.number, "nominal": frame.nominal} | frame.factors
        for row, s in zip(rows, rendered.truth.strings, strict=True):
            snr = best_snr(electrons, s.image_px, frame.config, frame.scene) if _seen(s) else float("nan")
            light = {"signal_e": s.electrons, "best_snr": snr, "detectable": row["visible"] and snr >= DETECTABLE_SNR}
            strings.append(common | row | light)
        counts.append(common | count)
        progress(done, len(frames))
    return MeasuredFrames(strings, counts)


def label_drawn(frame: Drawn, image: NDArray[Any], settings: Settings) -> Frame:
    """The labelled spots of one drawn frame."""
    sensor = frame.by_file or frame.scene.sensor
    points = extract(image, sensor, settings.extraction)
    if frame.scale != (1.0, 1.0):
        points = replace(points, yz_mm=points.yz_mm / frame.scale)
    labelled = label_frame(points, frame.jig, sensor, frame.guess, settings.calib or CalibConfig())
    return Frame(frame.number, "", points=points, axis=labelled.axis, reason=labelled.reason)


def score(
    frame: Frame, truth: Sequence[KnownString], bounds: Sequence[float] | None = None
) -> tuple[list[dict[str, Any]], dict[str, Any]]:
    """Rows of one frame's strings and its counts."""
    compared = match(true_strings(truth), named_points(frame.points, frame.axis), labelled=True)
    found = {m.string.label: m for m in compared.found}
    rows = []
    for i, string in enumerate(truth):
        row: dict[str, Any] = {
            "label": string.label,
            "visible": (visible := bool(string.visible_fraction >= VISIBLE)),
            "detectable": visible,  # where no more of its light is known
            "found": string.label in found,
            "bound_px": float("nan") if bounds is None else bounds[i],
        }
        if string.axis_mm is not None:
            y, z = np.asarray(string.axis_mm, dtype=float)
            row |= {"y_mm": float(y), "z_mm": float(z)}
        rows.append(row | (_errors(frame, found[string.label]) if string.label in found else {}))
    return rows, _counts(compared) | {"labelled": len(frame.axis), "spots": len(frame.points)}


def _counts(compared: Comparison) -> dict[str, int]:
    return {
        "visible": len(compared.visible),
        "found": len(compared.found),
        "false": len(compared.false_points),
        "mislabelled": compared.mislabelled,
    }


def _errors(frame: Frame, found: Match) -> dict[str, Any]:
    k = frame.axis.label.index(found.string.label)
    covariance = frame.axis.cov_yz_mm2[k]
    error_px, error = np.array(found.error_px), np.array(found.error_mm)
    return {
        "error_u_px": float(error_px[0]),
        "error_v_px": float(error_px[1]),
        "error_y_mm": float(error[0]),
        "error_z_mm": float(error[1]),
        "sigma_y_mm": float(np.sqrt(covariance[0, 0])),
        "sigma_z_mm": float(np.sqrt(covariance[1, 1])),
        "chi2": float(error @ np.linalg.solve(covariance, error)),
        "flag": frame.axis.flag[k] if k < len(frame.axis.flag) else "",
    }


def _seen(string: KnownString) -> bool:
    return string.image_px is not None and bool(np.all(np.isfinite(np.asarray(string.image_px, dtype=float))))
