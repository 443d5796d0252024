"""The settings of the gap and flush measurement, with their defaults."""

from __future__ import annotations

from typing import Literal

from pydantic import BaseModel, ConfigDict, Field


class GapFlushConfig(BaseModel):
    """How two panels and their edges are found in a profile; lengths in mm."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    reference: Literal["left", "right"] = Field(default="left", description="panel whose face gives the directions")
    min_face_mm: float = Field(default=3.0, gt=0, description="shortest straight stretch that is a panel's face")
    face_length_mm: float = Field(default=8.0, gt=0, description="length of the face that is used, from its edge")
    tolerance_mm: float = Field(default=0.05, gt=0, description="least distance at which a point is off a face")
    max_angle_deg: float = Field(default=40.0, gt=0, lt=90, description="largest angle between the two faces")
    min_gap_mm: float = Field(default=0.2, gt=0, description="smallest gap, along the profile")
    max_gap_mm: float = Field(default=40.0, gt=0, description="largest gap, along the profile")
    max_radius_mm: float = Field(default=8.0, gt=0, description="largest edge radius")
    max_step_mm: float = Field(default=0.8, gt=0, description="a longer step between neighbours ends a surface")
