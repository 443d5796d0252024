"""The settings of stripe extraction, with their defaults."""

from __future__ import annotations

from typing import Literal

from pydantic import BaseModel, ConfigDict, Field, model_validator

Direction = Literal["auto", "columns", "rows"]
Selection = Literal["strongest", "first", "last", "continuous", "all"]


class StripeConfig(BaseModel):
    """How a laser stripe is found and localised; lengths in px, grey levels in DN."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    direction: Direction = Field(
        default="auto", description="search along image columns or rows; auto: along the depth's image"
    )
    along_normal: bool = Field(
        default=False, description="localise once more along the stripe's own normal, for steep stripes"
    )
    select: Selection = Field(default="strongest", description="which of several peaks of one section is the stripe")
    max_peaks: int = Field(default=6, ge=1, le=32, description="peaks kept per section before the selection")
    threshold_sigma: float = Field(
        default=4.0, gt=0, description="detection threshold in robust σ of the frame's own noise"
    )
    min_amplitude_dn: float = Field(default=2.0, ge=0, description="smallest peak above its local background")
    min_snr: float = Field(default=5.0, ge=0, description="smallest amplitude over its own σ")
    min_width_px: float = Field(default=0.45, gt=0, description="smallest Gaussian σ of the stripe")
    max_width_px: float = Field(default=8.0, gt=0, description="largest Gaussian σ of the stripe")
    surround_px: int = Field(
        default=8, ge=4, le=64, description="distance at which the background is taken for detection"
    )
    max_chi2_per_dof: float = Field(
        default=25.0, gt=1, description="above it the section is not one Gaussian peak: flagged shape"
    )
    region_px: tuple[int, int, int, int] | None = Field(
        default=None, description="u0, v0, u1, v1 of the part of the image looked at, u1 and v1 excluded"
    )
    read_noise_dn: float | None = Field(
        default=None, ge=0, description="noise in the dark; estimated from the frame if absent"
    )
    gain_dn_per_e: float | None = Field(default=None, ge=0, description="grey levels per electron; estimated if absent")
    speckle_contrast: float | None = Field(
        default=None, ge=0, le=1, description="multiplicative noise; estimated if absent"
    )
    min_run: int = Field(default=5, ge=1, le=1000, description="sections in a row that make a stripe; fewer are noise")
    jump_px: float = Field(
        default=6.0, gt=0, description="select = continuous: a step along the stripe that costs as much as a peak"
    )
    max_gap: int = Field(default=12, ge=1, le=200, description="select = continuous: sections that a chain may skip")

    @model_validator(mode="after")
    def _widths_are_ordered(self) -> StripeConfig:
        if self.min_width_px >= self.max_width_px:
            raise ValueError(f"min_width_px {self.min_width_px:g} must be below max_width_px {self.max_width_px:g}")
        return self
