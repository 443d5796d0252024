"""Defaults of the string's surface and of labelling, sections of CalibConfig."""

from __future__ import annotations

from pydantic import BaseModel, ConfigDict, Field


class SurfaceConfig(BaseModel):
    """What is known of the strings' surface; where nothing is, plausible threads are averaged, their spread a σ."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)

    known: bool = Field(False, description="true: diffuse, specular and roughness below are the thread's own")
    diffuse: float = Field(0.6, ge=0, le=1, description="albedo of the matte part")
    specular: float = Field(
        0.05, ge=0, le=1, description="reflectance of the glossy part at normal incidence; 0: matte"
    )
    roughness: float = Field(0.35, ge=0.02, le=1, description="GGX α of the glossy part")
    diameter_sigma: float = Field(0.02, ge=0, le=0.5, description="σ of the string's diameter as a share of it")


class LabellingConfig(BaseModel):
    """Gates and odds of labelling."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)

    guess_sigma_mm: float = Field(4.0, gt=0, description="σ of a guess's position, at the jig, per axis")
    guess_sigma_deg: float = Field(1.5, gt=0, description="σ of a guess's rotation per axis")
    scp_sigma_mm: float = Field(3.0, gt=0, description="σ of the design SCP's translation per axis")
    scp_sigma_deg: float = Field(2.0, gt=0, description="σ of the design SCP's rotation per axis")
    robot_sigma_mm: float = Field(1.0, gt=0, description="σ of the robot's position from one configuration to another")
    robot_sigma_deg: float = Field(0.1, gt=0, description="σ of the robot's rotation from one configuration to another")
    floor_mm: float = Field(
        0.02, ge=0, description="σ added to every spot in labelling: what its covariance leaves out"
    )
    min_probability: float = Field(1e-5, gt=0, lt=1, description="a labelling whose χ² is less probable is none")
    max_tilt_deg: float = Field(65.0, gt=0, lt=90, description="between the pillar and the laser plane's normal")
    max_candidates: int = Field(40, ge=3, description="spots considered, best score first")
