"""The window's engine on the real chain: extraction's stages, and labels through the robot chain where there is one."""

from __future__ import annotations

import threading
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel

from calib import CalibConfig
from calib.label.frame import label_frame
from extraction import ExtractionConfig, Stages, extract_stages, image_to_sheet
from extraction.spots import Candidates
from geometry import InputError, Pose, Sensor, SurfacePoints
from jig_cad import Jig
from workbench.files.images import Image
from workbench.window.engine import Candidate, Labels, StageView
from workbench.window.refusals import Seen, explain

Array = NDArray[np.float64]

MEASURES = (
    "height [DN]", "height / noise", "length [px]", "width [px]", "length [mm]", "width [mm]", "area [px]", "score",
)  # fmt: skip


@dataclass(eq=False)
class Detector:
    """Extraction for ``sensor``; labels where ``jig`` is known.

    guesses: T_sensor_jig by image index, from the solved robot chain; ``epoch`` counts their changes.
    """

    sensor: Sensor
    jig: Jig | None
    calib: CalibConfig = field(default_factory=CalibConfig)
    model: type[BaseModel] = ExtractionConfig
    epoch: int = 0
    _guesses: dict[int, Pose] = field(default_factory=dict)
    _lock: threading.Lock = field(default_factory=threading.Lock)

    @property
    def strings(self) -> tuple[str, ...]:
        """Names of the jig's strings."""
        return self.jig.strings if self.jig is not None else ()

    def stages(self, image: Image, config: BaseModel) -> StageView:
        """All stages of one image."""
        settings = _checked(config)
        stages = extract_stages(image, self.sensor, settings)
        candidates = _candidates(stages, self.sensor, settings)
        mask = stages.mask.view(np.uint8)
        return StageView(stages.background, mask, candidates, stages.points, stages.reason, MEASURES)

    def label(self, index: int, points: SurfacePoints) -> Labels:
        """Names of the spots by the jig's geometry, with the robot chain's guess where there is one."""
        if self.jig is None:
            raise InputError("labels need a jig: give --jig FILE")
        with self._lock:
            guess = self._guesses.get(index)
        found = label_frame(points, self.jig, self.sensor, guess, self.calib)
        return Labels(found.axis, found.T_sensor_jig, found.reason or "")

    def learn(self, guesses: dict[int, Pose]) -> None:
        """Take the poses of a solved chain."""
        with self._lock:
            self._guesses = guesses
            self.epoch += 1


def _checked(config: BaseModel) -> ExtractionConfig:
    if not isinstance(config, ExtractionConfig):
        raise InputError(f"the parameters are {type(config).__name__}, not ExtractionConfig")
    return config


def _candidates(stages: Stages, sensor: Sensor, config: ExtractionConfig) -> tuple[Candidate, ...]:
    found = stages.candidates
    score = np.full(len(found), np.nan)
    score[stages.candidate] = stages.points.score
    scale = _scale(sensor, found.peak_uv_px)
    noise = np.maximum(found.ring_noise_dn, 1e-9)
    length, width = found.length_px * scale, found.width_px * scale
    table = [
        found.height_dn,
        found.height_dn / noise,
        found.length_px,
        found.width_px,
        length,
        width,
        found.area_px,
        score,
    ]
    measured = _plain(np.column_stack(table), 3)
    numbers = np.column_stack([found.height_dn, noise, found.length_px, found.width_px, scale, score]).tolist()
    boxes, peaks = _plain(_boxes(found), 1), found.peak_uv_px.tolist()
    out = []
    for k, (u, v) in enumerate(peaks):
        reason = found.reason[k] or ("low_score" if np.isnan(score[k]) else "")
        text, parameter = explain(reason, Seen(*numbers[k]), config) if reason else ("", "")
        out.append(Candidate(u, v, boxes[k], reason, text, measured[k], parameter))
    return tuple(out)


def _plain(table: Array, digits: int) -> list[tuple[Any, ...]]:
    """Rows of rounded numbers, None for what is not finite."""
    rounded = np.round(table, digits).astype(object)
    rounded[~np.isfinite(table)] = None
    return list(map(tuple, rounded.tolist()))


def _boxes(found: Candidates) -> Array:
    """The regions' boxes (N, 4) from their moments (a uniform bar of that variance); the peak's own where none grew."""
    grown = (found.area_px > 0)[:, None]
    centre = np.where(grown, found.mean_uv_px, found.peak_uv_px)
    variance = np.where(grown, found.cov_uv_px2[:, [0, 1], [0, 1]], 0.5)
    half = np.sqrt(3 * np.maximum(variance, 0)) + 1
    return np.column_stack([np.minimum(centre - half, found.peak_uv_px), np.maximum(centre + half, found.peak_uv_px)])


def _scale(sensor: Sensor, uv_px: Array) -> Array:
    """Size of the pixels (N, 2) in the laser plane (N,) [mm/px]."""
    if not len(uv_px):
        return np.zeros(0)
    area = np.abs(np.linalg.det(image_to_sheet(sensor, uv_px)[1]))
    return np.asarray(np.sqrt(np.where(np.isfinite(area) & (area > 0), area, 1.0)))
