"""All defaults of calibration in one model."""

from __future__ import annotations

from typing import Literal

from pydantic import BaseModel, ConfigDict, Field

Method = Literal["bundle", "paper"]
Model = Literal[
    "auto",
    "scp",
    "scp+offsets",
    "full",
    "auto+sensor",
    "scp+offsets+sensor",
    "full+sensor",
    "auto+compliance",
    "scp+offsets+compliance",
    "full+compliance",
    "auto+sensor+compliance",
    "scp+offsets+sensor+compliance",
    "full+sensor+compliance",
]


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


class CalibConfig(BaseModel):
    """How calibrate works; every key has a default."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)

    method: Method = Field("bundle", description="bundle over raw axis points, or the paper's iteration")
    model: Model = Field(
        "auto",
        description="what is estimated beside the SCP, within its priors: nothing, joint offsets, all DH parameters, "
        "the sensor's own, the compliance of the joints under gravity; "
        "auto: all DH parameters where joint readings and a robot allow it, else nothing",
    )

    # surface to axis and labels
    surface: SurfaceConfig = SurfaceConfig()
    labelling: LabellingConfig = LabellingConfig()
    relabel_rounds: int = Field(
        2, ge=0, description="how often labels and axis offsets are redone with the solved chain"
    )

    # noise
    noise: Literal["auto", "given"] = Field(
        "auto", description="auto: where the residuals contradict the noise stated, it is estimated from them"
    )
    hand_sigma_mm: float | None = Field(
        None, gt=0, description="noise of given hand poses; None: estimated from the data"
    )
    hand_sigma_deg: float | None = Field(
        None, gt=0, description="noise of given hand poses; None: estimated from the data"
    )
    hand_floor_mm: float = Field(
        0.3, ge=0, description="systematic error of hand poses whose joints are not known, added to σ"
    )
    hand_floor_deg: float = Field(
        0.03, ge=0, description="systematic error of hand poses whose joints are not known, added to σ"
    )
    beta_sigma_deg: float = Field(
        0.0, ge=0, description="prior of Hayati's β at parallel axes in model full; 0: not used"
    )

    # bundle
    outlier_chi2: float = Field(
        25.0, gt=0, description="a point's squared Mahalanobis distance (2 degrees) of an outlier"
    )
    max_outlier_share: float = Field(0.25, gt=0, le=1, description="more outliers than this: no trustworthy answer")

    max_lost_share: float = Field(
        1 / 3, gt=0, le=1, description="more of the frames left out than this: no trustworthy answer"
    )

    # paper
    paper_damping: float = Field(1e-3, ge=0, description="λ of scaled columns while far from the solution, then 0")
    paper_switch: float = Field(1e-3, ge=0, description="scaled step below which the damping is switched off")
    paper_tolerance: float = Field(1e-12, gt=0, description="stop when the scaled step falls below this")
    paper_joint_offsets: int = Field(
        0, ge=0, description="how many last joints' offsets the paper's iteration estimates"
    )

    # verdict
    misfit_chi2: float = Field(
        2.5,
        gt=1,
        description="χ² per degree of freedom above this is a misfit of the model; below it the σ stated of the points "
        "may be too small by 1.6, which weights and σ then follow",
    )
    pull_limit: float = Field(
        4.0,
        gt=0,
        description="σ of a pull from which a number of the files is contradicted: among the some 50 pulls of a sound "
        "cell one is beyond it by chance in 0.3 %",
    )
    min_rotation_deg: float = Field(3.0, gt=0, description="rotation between frames of a location that is too small")
    weak_condition: float = Field(1e3, gt=1, description="scaled condition number above which the answer is weak")
