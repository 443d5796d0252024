"""One complete pixel-to-transform trial in memory: the same code as single runs."""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Any

import cv2
import numpy as np

from calib import calibrate
from extraction import extract
from geometry import Frame, PerceptronEmuError, SurfacePoints
from perceptron_emu import RenderedFrame, render
from workbench.campaign.asked.settings import TrialSettings
from workbench.campaign.trial.emulated import EmulatedCell, emulated_cell
from workbench.campaign.trial.outcome import Outcome, calibrated, labelled_only, score_frames, trial_row
from workbench.cell import dataset_config
from workbench.emulate import Configuration, frame_scene

ONE_VIEW = "extract"  # the kind of run whose trials are a single frame
PNG_FASTEST = [cv2.IMWRITE_PNG_COMPRESSION, 1]


@dataclass(frozen=True, eq=False)
class Trial:
    """What a trial leaves: its row, its frames' rows, seconds by stage, kept images by name."""

    row: dict[str, Any]
    frames: list[dict[str, Any]] = field(default_factory=list)
    timings: dict[str, float] = field(default_factory=dict)
    images: dict[str, bytes] = field(default_factory=dict)


def run_trial(settings: TrialSettings, run: str, seed: np.random.SeedSequence, *, keep_images: bool = False) -> Trial:
    """Render, extract and (run "pose": label; "calibrate": solve) one cell drawn by ``seed``.

    A trial from which no answer follows is a row too: its verdict says why.
    """
    clock = _Clock()
    try:
        with clock("plan_s"):
            emulated = emulated_cell(settings, _cell_rng(seed), one_view=run == ONE_VIEW)
        frames, points = _measure(emulated, settings, seed, clock)
        with clock("calibrate_s"):
            outcome = _answer(_records(emulated, points), emulated, settings, run)
    except PerceptronEmuError as error:
        return Trial({"verdict": "no_answer", "message": str(error)}, timings=clock.seconds)
    scored = score_frames(emulated, frames, outcome)
    kept = zip(emulated.configurations, frames, strict=True) if keep_images else ()
    images = {image_name(c.frame): png(f) for c, f in kept}
    return Trial(trial_row(emulated, scored, outcome), [s.row for s in scored], clock.seconds, images)


def _answer(frames: tuple[Frame, ...], emulated: EmulatedCell, settings: TrialSettings, run: str) -> Outcome:
    cell = emulated.cell
    if run != "calibrate":
        return labelled_only(frames, cell.sensor, cell.jig, settings.calib)
    result = calibrate(frames, cell.jig, cell.robot, cell.sensor, cell.T_hand_sensor_design, config=settings.calib)
    return calibrated(result)


def trial_frames(
    settings: TrialSettings, run: str, seed: np.random.SeedSequence
) -> Iterator[tuple[Configuration, RenderedFrame]]:
    """The frames of a trial alone, the same bytes as when it was run; none where no configurations were found."""
    try:
        emulated = emulated_cell(settings, _cell_rng(seed), one_view=run == ONE_VIEW)
    except PerceptronEmuError:
        return
    for configuration in emulated.configurations:
        yield configuration, render_frame(emulated, configuration, seed)


def one_trial_frame(
    settings: TrialSettings, run: str, seed: np.random.SeedSequence, frame: int
) -> RenderedFrame | None:
    """One frame of a trial as when it was run; None where no configurations were found."""
    try:
        emulated = emulated_cell(settings, _cell_rng(seed), one_view=run == ONE_VIEW)
    except PerceptronEmuError:
        return None
    return render_frame(emulated, emulated.configurations[frame], seed)


def _cell_rng(seed: np.random.SeedSequence) -> np.random.Generator:
    """The generator of the trial's cell; not by ``spawn``, which remembers how often it was asked."""
    return np.random.default_rng(np.random.SeedSequence(seed.entropy, spawn_key=(*seed.spawn_key, 0)))


def frame_rng(seed: np.random.SeedSequence, frame: int) -> np.random.Generator:
    """The generator of one frame's noise: a function of the trial's seed and the frame's number alone."""
    key = (*seed.spawn_key, 1000 + frame)
    return np.random.default_rng(np.random.SeedSequence(seed.entropy, spawn_key=key))


def render_frame(emulated: EmulatedCell, configuration: Configuration, seed: np.random.SeedSequence) -> RenderedFrame:
    """One frame of the trial, the same bytes whenever it is made."""
    scene = frame_scene(emulated.cell, emulated.true, configuration)
    return render(scene, emulated.cell.emulator, frame_rng(seed, configuration.frame))


def _measure(
    emulated: EmulatedCell, settings: TrialSettings, seed: np.random.SeedSequence, clock: _Clock
) -> tuple[list[RenderedFrame], list[SurfacePoints]]:
    """All frames, and their spots by the configuration that a dataset of these images would be given."""
    sensor = emulated.cell.sensor
    with clock("render_s"):
        frames = [render_frame(emulated, c, seed) for c in emulated.configurations]
    with clock("extract_s"):
        config = dataset_config(sensor, settings.extraction, len(frames), lambda some: [frames[i].image for i in some])
        points = [extract(f.image, sensor, config) for f in frames]
    return frames, points


def _records(emulated: EmulatedCell, points: list[SurfacePoints]) -> tuple[Frame, ...]:
    return tuple(
        Frame(c.frame, c.location, c.role, points=p, joints_rad=c.reading_rad)
        for c, p in zip(emulated.configurations, points, strict=True)
    )


def image_name(frame: int) -> str:
    """The file name of a trial's frame."""
    return f"{frame:03d}.png"


def png(frame: RenderedFrame) -> bytes:
    """A frame's image as it is kept."""
    return bytes(cv2.imencode(".png", frame.image, PNG_FASTEST)[1])


class _Clock:
    """Seconds spent by stage."""

    def __init__(self) -> None:
        self.seconds: dict[str, float] = {}

    @contextmanager
    def __call__(self, stage: str) -> Iterator[None]:
        start = time.perf_counter()
        try:
            yield
        finally:
            self.seconds[stage] = self.seconds.get(stage, 0.0) + time.perf_counter() - start
