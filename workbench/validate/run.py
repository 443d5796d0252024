"""A validation from start to end."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from perceptron_emu import render
from workbench.cell import (
    ProfileSettings,
    Progress,
    find_emulator,
    find_jig,
    find_sensor,
    label_dataset,
    observe,
    with_known_grain,
)
from workbench.files import Settings, read_cell, read_image
from workbench.report import jpeg, overlay
from workbench.validate.dataset import measure_dataset
from workbench.validate.drawing import Drawn, draw_frames
from workbench.validate.measure import Measured, label_drawn, measure_drawn

WORST = 4  # frames that are shown


@dataclass(frozen=True, eq=False)
class Validation:
    """What was measured, and pictures of the worst frames."""

    measured: Measured
    worst: list[dict[str, Any]]


def validate_drawn(sensor: str, jig: str, frames: int, seed: int, settings: Settings, progress: Progress) -> Validation:
    """Hold extraction against the truth of frames that are rendered for it.

    Parameters
    ----------
    sensor, jig
        Files or presets.
    frames
        So many as the files say, and as many again under varied conditions.
    seed
        The same seed draws the same frames.
    settings
        Of extraction and calibration.
    progress
        Told the frames done and the frames in all.

    Returns
    -------
    Validation
        A row for every string, a row for every frame, pictures of the worst frames.

    """
    seen_by = find_sensor(sensor)
    seen_by.require_camera()
    settings = replace(settings, extraction=with_known_grain(seen_by, settings.extraction))
    drawn = list(draw_frames(seen_by, find_emulator(sensor), find_jig(jig), frames, seed))
    measured = measure_drawn(drawn, settings, progress)
    worst = [_drawn_picture(drawn[number], why, settings) for number, why in _worst(measured)]
    return Validation(measured, worst)


def validate_dataset(path: Path, settings: Settings, progress: Progress) -> Validation:
    """Hold extraction against the truth of a dataset.

    Parameters
    ----------
    path
        A dataset with truth.json.
    settings
        Of extraction and calibration, by whose chain the spots are labelled.
    progress
        Told the frames done and the frames in all.

    Returns
    -------
    Validation
        A row for every string, a row for every frame, pictures of the worst frames.

    Raises
    ------
    InputError
        Where there is no truth.

    """
    measured = measure_dataset(path, settings, progress)
    cell = read_cell(path)
    chosen = dict(_worst(measured))
    if not chosen or cell.points is not None:
        return Validation(measured, [])
    observed = observe(cell, settings.extraction, None, ProfileSettings.of(settings))
    worst = []
    for frame in label_dataset(cell, observed, settings.calib):
        if frame.number in chosen:
            picture = overlay(read_image(cell.folder / frame.image, cell.sensor), cell.sensor, frame)
            worst.append({"frame": frame.number, "why": chosen[frame.number], "image": jpeg(picture)})
    return Validation(measured, worst)


def _worst(measured: Measured) -> Sequence[tuple[int, str]]:
    """Frames with false or mislabelled points first, then missed strings, then the largest error."""
    out = []
    for count in measured.counts:
        rows = [s for s in measured.strings if s["frame"] == count["frame"] and s["visible"]]
        missed = sum(not s["found"] for s in rows)
        error = max((float(np.hypot(s["error_y_mm"], s["error_z_mm"])) for s in rows if s["found"]), default=0.0)
        why = (
            f"{count['false']} false, {count['mislabelled']} mislabelled, {missed} missed, largest error {error:.3f} mm"
        )
        out.append(((count["false"] + count["mislabelled"], missed, error), count["frame"], why))
    out.sort(key=lambda item: item[0], reverse=True)
    return [(frame, why) for _, frame, why in out[:WORST]]


def _drawn_picture(frame: Drawn, why: str, settings: Settings) -> dict[str, Any]:
    image = render(frame.scene, frame.config, np.random.default_rng(list(frame.seed))).image
    picture = overlay(image, frame.scene.sensor, label_drawn(frame, image, settings))
    conditions = "nominal" if frame.nominal else ", ".join(f"{k} {v:.3g}" for k, v in frame.factors.items())
    return {"frame": frame.number, "why": f"{why} ({conditions})", "image": jpeg(picture)}
