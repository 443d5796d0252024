"""The window's engine on the real chain: extraction's stages, and labels through the robot chain where there is one."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel

from calib.label import LabelledFrame
from extraction import (
    ExtractionConfig,
    Profile,
    Seen,
    Stages,
    explain,
    extract_stages,
    image_to_sheet,
)
from extraction.spots import Candidates
from geometry import InputError, Sensor, SurfacePoints
from workbench.cell import (
    MeasuredProfile,
    Value,
    field_of_view_of,
    judged,
    measure,
    peak_values,
    profile_values,
    why_no_stripe,
)
from workbench.files import Image, Recipe
from workbench.opened import Content, Labeller
from workbench.window.boards import Boards, board_values
from workbench.window.engine import Candidate, ImageAnswer, StageView
from workbench.window.profile_view import ProfileView

Array = NDArray[np.float64]

MEASURES = (
    "height [DN]", "height / noise", "length [px]", "width [px]", "length [mm]", "width [mm]", "area [px]", "score",
)  # fmt: skip


@dataclass(frozen=True, eq=False)
class Detector:
    """The recipe's tools on one image or profile.

    labeller: names strings. boards: pictures of a calibration board in place of a target's. plane_known: False where
    images are looked at without their sensor, in pixels.
    """

    labeller: Labeller
    model: type[BaseModel] = Recipe
    boards: Boards | None = None
    plane_known: bool = True

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

    def looks_for(self, content: Content, config: BaseModel) -> str:
        """Strings where the recipe says so, or a jig is known and it says nothing."""
        if self.boards is not None:
            return "board"
        what = _recipe(config).what or ("strings" if self.strings else "stripe")
        return "stripe" if isinstance(content, Profile) else what

    def profile(self, index: int, content: Content, config: BaseModel) -> ProfileView:
        """The stripe of an image, in the laser plane where that is known, or a profile; with what is measured in it."""
        recipe = _recipe(config)
        if isinstance(content, Profile):
            reason = "" if len(content) else "the profile holds no points"
            return ProfileView(None, content, measure(content, recipe, field_of_view_of(self.sensor)), reason)
        if self.boards is not None:
            return self.boards.view(index, content, recipe)
        from extraction import detect_stripe, extract_profile, region_mask

        mask = region_mask(recipe.region, content.shape)
        if not self.plane_known:
            peaks = detect_stripe(content, recipe.stripe, mask=mask)
            return ProfileView(peaks, reason="" if len(peaks) else why_no_stripe(content, self.sensor, peaks, mask))
        profile = extract_profile(content, self.sensor, recipe.stripe, mask=mask)
        reason = "" if len(profile) else why_no_stripe(content, self.sensor, profile.peaks, mask)
        found = measure(profile, recipe, field_of_view_of(self.sensor)) if len(profile) else MeasuredProfile()
        return ProfileView(profile.peaks, profile, found, reason)

    def values(self, content: Content, answer: ImageAnswer, config: BaseModel) -> list[Value]:
        """Clipped pixels, then what the tools measured."""
        recipe = _recipe(config)
        out: list[Value] = []
        if not isinstance(content, Profile):
            clipped = int(np.count_nonzero(content >= self.sensor.require_camera().saturation_dn))
            out.append(Value("clipped_px", "exposure", clipped, unit="px", digits=0))
        view = answer.profile
        if view is None:
            out += _string_values(answer)
        elif self.boards is not None:
            out += board_values(view)
        elif view.profile is not None:
            out += profile_values(view.profile, view.measured, recipe)
        elif view.peaks is not None:
            out += peak_values(view.peaks, recipe)
        return judged(out, recipe.tolerances)


def _string_values(answer: ImageAnswer) -> list[Value]:
    if answer.view is None:
        return []
    points, found = answer.view.points, [] if answer.labels is None else answer.labels.axis.label
    variance = np.trace(points.cov_yz_mm2, axis1=1, axis2=2)
    largest = float(np.sqrt(variance.max())) if len(points) and np.isfinite(variance).all() else None
    spots = Value("spots", "strings", len(points), digits=0)
    named = [] if answer.labels is None else [Value("strings", "strings", len(found), digits=0)]
    return [*named, spots, Value("sigma_mm", "strings", largest, unit="mm", digits=4)]


def _recipe(config: BaseModel) -> Recipe:
    if isinstance(config, Recipe):
        return config
    return Recipe(**{name: getattr(config, name) for name in type(config).model_fields})


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
