"""All defaults of calibration in one model."""

from __future__ import annotations

from typing import Literal

from pydantic import BaseModel, ConfigDict, Field

from calib.surface_config import LabellingConfig, SurfaceConfig

Method = Literal["bundle", "paper"]
Model = Literal["scp", "scp+offsets", "full"]


class CalibConfig(BaseModel):
    """How calibrate works; every key has a default."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)

    method: Method = Field("bundle", description="bundle over raw axis points, or the paper's iteration")
    model: Model = Field(
        "scp", description="what is estimated beside the SCP: nothing, joint offsets, all DH parameters"
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

    # paper
    paper_damping: float = Field(1e-3, ge=0, description="λ of scaled columns while far from the solution, then 0")
    paper_switch: float = Field(1e-3, ge=0, description="scaled step below which the damping is switched off")
    paper_tolerance: float = Field(1e-12, gt=0, description="stop when the scaled step falls below this")
    paper_joint_offsets: int = Field(
        0, ge=0, description="how many last joints' offsets the paper's iteration estimates"
    )

    # verdict
    misfit_chi2: float = Field(1.5, gt=1, description="χ² per degree of freedom above this is a misfit of the model")
    min_rotation_deg: float = Field(3.0, gt=0, description="rotation between frames of a location that is too small")
    weak_condition: float = Field(1e3, gt=1, description="scaled condition number above which the answer is weak")
