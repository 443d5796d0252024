"""The window's engine on the real chain: extraction's stages, and labels through the robot chain where there is one."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel

from calib.label import LabelledFrame
from extraction import ExtractionConfig, Seen, Stages, explain, extract_stages, image_to_sheet
from extraction.spots import Candidates
from geometry import InputError, Sensor, SurfacePoints
from workbench.files import Image
from workbench.opened import Labeller
from workbench.window.engine import Candidate, StageView

Array = NDArray[np.float64]

MEASURES = (
    "height [DN]", "height / noise", "length [px]", "width [px]", "length [mm]", "width [mm]", "area [px]", "score",
)  # fmt: skip


@dataclass(frozen=True, eq=False)
class Detector:
    """Extraction with all its stages, and names by ``labeller``."""

    labeller: Labeller
    model: type[BaseModel] = ExtractionConfig

    @property
    def sensor(self) -> Sensor:
        """The sensor that took the images."""
        return self.labeller.sensor

    @property
    def strings(self) -> tuple[str, ...]:
        """Names of the jig's strings."""
        return self.labeller.strings

    @property
    def epoch(self) -> int:
        """Counts what the labeller learned."""
        return self.labeller.epoch

    def stages(self, image: Image, config: BaseModel) -> StageView:
        """All stages of one image."""
        settings = _checked(config)
        stages = extract_stages(image, self.sensor, settings)
        candidates = _candidates(stages, self.sensor, settings)
        mask = stages.mask.view(np.uint8)
        return StageView(stages.background, mask, candidates, stages.points, stages.reason, MEASURES)

    def label(self, index: int, points: SurfacePoints) -> LabelledFrame:
        """Names of the spots by the jig's geometry, with the robot chain's guess where there is one."""
        return self.labeller.label(index, points)


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
        reason = found.reason[k]
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
