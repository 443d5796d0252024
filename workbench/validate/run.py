"""A validation from start to end."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from geometry import InputError
from geometry.sensor import stated_uncertainty
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
from workbench.defaults import DRAWN_SENSORS
from workbench.files import Settings, read_cell, read_image
from workbench.report import jpeg, overlay
from workbench.validate.dataset import measure_dataset
from workbench.validate.drawing import Drawn, draw_frames, with_drawn_sensors
from workbench.validate.measure import MeasuredFrames, label_drawn, measure_drawn, measure_drawn_sensors
from workbench.validate.stripes import stripe_figures

WORST = 4  # frames that are shown


@dataclass(frozen=True, eq=False)
class Validation:
    """What was measured, and pictures of the worst frames."""

    measured: MeasuredFrames
    worst: list[dict[str, Any]]


def validate_drawn(
    sensor: str,
    jig: str,
    frames: int,
    seed: int,
    settings: Settings,
    progress: Progress,
    sensors: int | None = None,
    stripe: bool = False,
) -> Validation:
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
    sensors
        So many sensors are drawn from the uncertainty that the sensor's file states, a frame by each; where None,
        DRAWN_SENSORS, and none of a file that states none.
    stripe
        Whether the stripe on matte plates is looked at, too.

    Returns
    -------
    Validation
        A row for every string, a row for every frame, pictures of the worst frames.

    Raises
    ------
    InputError
        Where sensors are to be drawn from a file that states no uncertainty.

    """
    seen_by = find_sensor(sensor)
    seen_by.require_camera()
    if sensors and stated_uncertainty(seen_by) is None:
        raise InputError(
            f"{sensor} states no [uncertainty]: no sensor can be drawn from it (source or σ by name are missing)"
        )
    settings = replace(settings, extraction=with_known_grain(seen_by, settings.extraction))
    drawn = list(draw_frames(seen_by, find_emulator(sensor), find_jig(jig), frames, seed))
    others = list(with_drawn_sensors(drawn, DRAWN_SENSORS if sensors is None else sensors, seed))
    total = len(drawn) + len(others)
    measured = measure_drawn(drawn, settings, lambda done, _: progress(done, total))
    rows = measure_drawn_sensors(others, settings, lambda done, _: progress(len(drawn) + done, total))
    measured = replace(measured, by_drawn_sensors=rows)
    if stripe:
        found = stripe_figures(seen_by, find_emulator(sensor), settings.stripe, seed)
        measured = replace(measured, stripe=found)
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


def _worst(measured: MeasuredFrames) -> Sequence[tuple[int, str]]:
    """Frames with false or mislabelled points first, then missed strings, then the largest error."""
    out = []
    for count in measured.counts:
        rows = [s for s in measured.strings if s["frame"] == count["frame"] and s["visible"]]
        missed = sum(not s["found"] for s in rows if s["detectable"])
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
