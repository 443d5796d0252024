"""The window's engine on the real chain: extraction's stages, and labels through the robot chain where there is one."""

from __future__ import annotations

import threading
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel

from calib import CalibConfig
from calib.labelling import label_frame
from extraction import ExtractionConfig, Stages, extract_stages, image_to_sheet
from geometry import InputError, Pose, SensorModel, SurfacePoints
from jig_cad import Jig
from workbench.formats.images import Image
from workbench.window.engine import Candidate, Labels, StageView
from workbench.window.refusals import Seen, explain

Array = NDArray[np.float64]


@dataclass(eq=False)
class Detector:
    """Extraction for ``sensor``; labels where ``jig`` is known.

    guesses: T_sensor_jig by image index, from the solved robot chain; ``epoch`` counts their changes.
    """

    sensor: SensorModel
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
        return StageView(stages.background, stages.mask.view(np.uint8), candidates, stages.points, stages.reason)

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


def _candidates(stages: Stages, sensor: SensorModel, config: ExtractionConfig) -> tuple[Candidate, ...]:
    found = stages.candidates
    spot_of = {int(k): i for i, k in enumerate(stages.candidate)}
    scale = _scale(sensor, found.peak_uv_px)
    out = []
    for k in range(len(found)):
        reason = found.reason[k] or ("" if k in spot_of else "low_score")
        score = float(stages.points.score[spot_of[k]]) if k in spot_of else float("nan")
        seen = Seen(
            float(found.height_dn[k]), float(found.ring_noise_dn[k]), float(found.length_px[k]),
            float(found.width_px[k]), float(found.area_px[k]), float(scale[k]), score,
        )  # fmt: skip
        text, parameter = explain(reason, seen, config) if reason else ("", "")
        u, v = (float(x) for x in found.peak_uv_px[k])
        measured = {name: value for name, value in seen.shown().items() if np.isfinite(value)}
        out.append(
            Candidate(u, v, _box(found.mean_uv_px[k], found.cov_uv_px2[k], u, v), reason, text, measured, parameter)
        )
    return tuple(out)


def _box(mean: Array, cov: Array, u: float, v: float) -> tuple[float, float, float, float]:
    """The region's box from its moments (a uniform bar of that variance), the peak inside."""
    if not np.all(np.isfinite(mean)) or not np.any(cov):
        return u - 2, v - 2, u + 2, v + 2
    half = np.sqrt(3 * np.maximum(np.diag(cov), 0)) + 1
    low, high = np.minimum(mean - half, (u, v)), np.maximum(mean + half, (u, v))
    return float(low[0]), float(low[1]), float(high[0]), float(high[1])


def _scale(sensor: SensorModel, uv_px: Array) -> Array:
    """Size of the pixels (N, 2) in the laser plane (N,) [mm/px]."""
    if not len(uv_px):
        return np.zeros(0)
    area = np.abs(np.linalg.det(image_to_sheet(sensor, uv_px)[1]))
    return np.asarray(np.sqrt(np.where(np.isfinite(area) & (area > 0), area, 1.0)))
