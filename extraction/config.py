"""Every default of the extraction package in one place."""

from __future__ import annotations

from typing import Literal

from pydantic import BaseModel, ConfigDict, Field
from pydantic.config import JsonDict


def _slider(low: float, high: float, basic: bool = False, log: bool = False, search: bool = True) -> JsonDict:
    """What a panel of sliders and a search need to know: the useful range, and whether a search may move it."""
    return {"ui_min": low, "ui_max": high, "level": "basic" if basic else "expert", "log": log, "search": search}


class _Section(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True)


class NoiseConfig(_Section):
    """The camera's and the speckle's noise; what is None is estimated from the frame itself."""

    read_noise_dn: float | None = Field(
        default=None,
        ge=0,
        description="camera noise without light [DN]",
        json_schema_extra=_slider(0, 20, search=False),
    )
    gain_dn_per_e: float | None = Field(
        default=None,
        ge=0,
        description="shot noise: grey levels per electron",
        json_schema_extra=_slider(0.001, 1, log=True, search=False),
    )
    full_well_e: float = Field(
        default=10_000.0,
        gt=0,
        description="electrons at saturation, where no gain is given",
        json_schema_extra=_slider(500, 200_000, log=True, search=False),
    )
    speckle_contrast: float | None = Field(
        default=None,
        ge=0,
        le=1,
        description="standard deviation of a pixel's speckle over its signal",
        json_schema_extra=_slider(0, 1, search=False),
    )
    model_error: float = Field(
        default=0.01,
        ge=0,
        le=0.5,
        description="a spot's wings depart from the Gaussian by this share of its height",
        json_schema_extra=_slider(0, 0.1),
    )
    speckle_weight: float = Field(
        default=0.4,
        ge=0,
        le=1,
        description="contrast by which the fit weighs bright pixels",
        json_schema_extra=_slider(0, 1, basic=True),
    )
    speckle_grain_px: float | None = Field(
        default=None,
        ge=0,
        le=1.7,
        description="the speckle's grain on the chip, λF#(1 + m)",
        json_schema_extra=_slider(0.2, 1.7, search=False),
    )


class DetectConfig(_Section):
    """What counts as a spot."""

    blur_sigma_px: float = Field(
        default=1.3, ge=0.3, le=10, description="matched blur [px]", json_schema_extra=_slider(0.5, 4, basic=True)
    )
    threshold: float = Field(
        default=7.0,
        gt=0,
        description="height of a spot over the local noise of the blurred image",
        json_schema_extra=_slider(3, 40, basic=True, log=True),
    )
    min_height_dn: float = Field(
        default=2.0,
        ge=0,
        description="height of a blurred spot over its surroundings [DN]",
        json_schema_extra=_slider(0, 60, basic=True),
    )
    region_level: float = Field(
        default=0.4,
        gt=0.05,
        lt=0.95,
        description="share of the height at which the shape is taken",
        json_schema_extra=_slider(0.1, 0.9),
    )
    max_length_mm: float = Field(
        default=4.0,
        gt=0,
        description="longest spot, in the laser plane [mm]",
        json_schema_extra=_slider(0.3, 15, basic=True, log=True),
    )
    max_width_mm: float = Field(
        default=1.6,
        gt=0,
        description="widest spot across its long axis, in the laser plane [mm]",
        json_schema_extra=_slider(0.1, 6, basic=True, log=True),
    )
    min_length_px: float = Field(
        default=12.0,
        gt=0,
        description="a spot of this length is never too long [px]",
        json_schema_extra=_slider(2, 60, log=True),
    )
    min_width_px: float = Field(
        default=7.0,
        gt=0,
        description="a spot of this width is never too wide [px]",
        json_schema_extra=_slider(1, 40, log=True),
    )
    max_candidates: int = Field(
        default=2000,
        ge=1,
        le=30_000,
        description="brightest peaks that are looked at",
        json_schema_extra=_slider(10, 20_000, log=True, search=False),
    )


class LocaliseConfig(_Section):
    """How a spot's position is found."""

    method: Literal["ml", "fast"] = Field(
        default="ml",
        description="maximum likelihood, or the fast matched blur with a log-parabola",
        json_schema_extra={"level": "basic", "search": False},
    )
    window_sigma: float = Field(
        default=3.0, gt=0.5, le=6, description="half window in spot widths", json_schema_extra=_slider(1, 6)
    )
    max_half_window_px: int = Field(
        default=20, ge=3, le=60, description="largest half window [px]", json_schema_extra=_slider(3, 60, search=False)
    )
    max_iterations: int = Field(
        default=20,
        ge=1,
        le=200,
        description="steps of a fit before it is given up",
        json_schema_extra=_slider(1, 100, search=False),
    )
    min_sigma_px: float = Field(default=0.45, ge=0, description="a narrower spot is a hot pixel or a spark")
    max_spots: int = Field(
        default=40,
        ge=1,
        description="spots kept, best first",
        json_schema_extra=_slider(1, 100, basic=True, search=False),
    )
    min_score: float = Field(
        default=0.05,
        ge=0,
        le=1,
        description="least score of a spot that is kept",
        json_schema_extra=_slider(0, 1, basic=True),
    )


class ExtractionConfig(_Section):
    """All parameters of the extraction, with defaults."""

    noise: NoiseConfig = NoiseConfig()
    detect: DetectConfig = DetectConfig()
    localise: LocaliseConfig = LocaliseConfig()
