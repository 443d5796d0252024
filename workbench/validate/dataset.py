"""Validation on a dataset that has truth: its images, labels through the chain."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from geometry import InputError
from workbench.cell import ProfileSettings, Progress, label_dataset, observe
from workbench.files import Settings, read_cell
from workbench.validate.measure import MeasuredFrames, score


def measure_dataset(path: Path, settings: Settings, progress: Progress) -> MeasuredFrames:
    """Extract and label a dataset and set it beside its truth.json."""
    cell = read_cell(path)
    if cell.truth is None or not cell.truth.frames:
        raise InputError(f"{cell.folder / 'truth.json'}: no truth, nothing to compare with; `render` writes one")
    truth = {frame.frame: frame for frame in cell.truth.frames}
    observed = observe(cell, settings.extraction, progress, ProfileSettings.of(settings))
    out = MeasuredFrames([], [])
    for frame in label_dataset(cell, observed, settings.calib):
        if frame.number not in truth or frame.number in observed.complaints:
            continue
        known = truth[frame.number]
        tilt = float(np.rad2deg(np.arccos(np.clip(known.T_sensor_jig[2][2], -1, 1))))
        rows, count = score(frame, known.points)
        common = {"frame": frame.number, "nominal": True, "tilt_deg": tilt}
        out.strings.extend(common | row for row in rows)
        out.counts.append(common | count)
    return out
