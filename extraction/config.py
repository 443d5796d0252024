"""Every default of the extraction package in one place."""

from __future__ import annotations

from typing import Literal

from pydantic import BaseModel, ConfigDict, Field


class _Section(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True)


class NoiseConfig(_Section):
    """The camera's and the speckle's noise; what is None is estimated from the frame itself."""

    read_noise_dn: float | None = Field(default=None, ge=0, description="camera noise without light [DN]")
    full_well_e: float = Field(default=10_000.0, gt=0, description="electrons at saturation; gives the shot noise")
    speckle_contrast: float = Field(
        default=0.4, ge=0, le=1, description="standard deviation of the speckle over the signal"
    )
    speckle_grain_px: float = Field(
        default=0.6, ge=0, description="Gaussian correlation length of the speckle [px]; 0 = none"
    )


class DetectConfig(_Section):
    """What counts as a spot."""

    blur_sigma_px: float = Field(default=1.3, ge=0.3, le=10, description="matched blur [px]")
    threshold: float = Field(
        default=7.0, gt=0, description="height of a spot over the local noise of the blurred image"
    )
    min_height_dn: float = Field(default=2.0, ge=0, description="height of a blurred spot over its surroundings [DN]")
    region_level: float = Field(
        default=0.4, gt=0.05, lt=0.95, description="share of the height at which the shape is taken"
    )
    max_length_mm: float = Field(default=4.0, gt=0, description="longest spot, in the laser plane [mm]")
    max_width_mm: float = Field(
        default=1.6, gt=0, description="widest spot across its long axis, in the laser plane [mm]"
    )
    min_length_px: float = Field(default=12.0, gt=0, description="a spot of this length is never too long [px]")
    min_width_px: float = Field(default=7.0, gt=0, description="a spot of this width is never too wide [px]")
    max_candidates: int = Field(default=2000, ge=1, le=100_000, description="brightest peaks that are looked at")


class LocaliseConfig(_Section):
    """How a spot's position is found."""

    method: Literal["ml", "fast"] = "ml"
    window_sigma: float = Field(default=3.0, gt=0.5, le=6, description="half window in spot widths")
    max_half_window_px: int = Field(default=20, ge=3, le=60)
    max_iterations: int = Field(default=30, ge=1, le=200)
    max_spots: int = Field(default=40, ge=1, description="spots kept, best first")
    min_score: float = Field(default=0.02, ge=0, le=1)


class ExtractionConfig(_Section):
    """All parameters of the extraction, with defaults."""

    noise: NoiseConfig = NoiseConfig()
    detect: DetectConfig = DetectConfig()
    localise: LocaliseConfig = LocaliseConfig()
