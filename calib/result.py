"""What calibration answers: everything that the result file names, as arrays and small records."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from calib.observation import Role
from geometry import Pose, RobotModel

Array = NDArray[np.float64]
Code = Literal[
    "ok",
    "model_misfit",
    "weak",
    "too_few_poses",
    "rotation_too_small",
    "lever_constant",
    "poses_not_distinct",
    "ambiguous_pose",
    "outliers",
    "not_observable",
    "not_converged",
]
TRUSTWORTHY: frozenset[Code] = frozenset({"ok", "model_misfit", "weak"})
SIGMA_HOLDS: frozenset[Code] = TRUSTWORTHY | {
    "not_observable"
}  # verdicts whose covariance says how wrong the answer is


@dataclass(frozen=True)
class Verdict:
    """The judgement on a calibration: a code, and words with advice."""

    code: Code
    text: str

    @property
    def trustworthy(self) -> bool:
        """Whether the answer may be used (exit code 0), with care where the code is not "ok"."""
        return self.code in TRUSTWORTHY


@dataclass(frozen=True, eq=False)
class FramePoints:
    """The labelled points of one frame as used; ``residual_mm`` is the perpendicular distance from the string."""

    label: tuple[str, ...] = ()
    uv_px: Array = field(default_factory=lambda: np.zeros((0, 2)))  # NaN where only (y, z) was given
    yz_mm: Array = field(default_factory=lambda: np.zeros((0, 2)))
    sigma_yz_mm: Array = field(default_factory=lambda: np.zeros((0, 2)))
    residual_mm: Array = field(default_factory=lambda: np.zeros(0))  # NaN where the location has no pose
    flag: tuple[str, ...] = ()


@dataclass(frozen=True, eq=False)
class FrameResult:
    """One frame: whether its points entered (calibrate: the solution, verify: the figures), else why not."""

    frame: int
    location: str
    role: Role
    used: bool
    reason: str | None
    points: FramePoints
    image: str = ""
    T_sensor_jig: Pose | None = None  # this frame's own pose, from its points alone


@dataclass(frozen=True)
class DesignSolved:
    """One figure with the design SCP and nominal robot, and with what was solved; None where it can not be formed."""

    design: float | None
    solved: float | None


@dataclass(frozen=True, eq=False)
class Distances:
    """The paper's Fig. 7 for one location: frames with all strings, the jig origin's distance from the base [mm]."""

    frame: tuple[int, ...]
    design_mm: Array
    solved_mm: Array


@dataclass(frozen=True, eq=False)
class LocationResult:
    """One place of the jig."""

    role: Role
    T_base_jig: Pose | None
    max_deviation_mm: DesignSolved
    spread_3d_mm: DesignSolved
    point_rms_mm: DesignSolved
    distances: Distances


@dataclass(frozen=True, eq=False)
class CalibrationResult:
    """The answer of calibrate.

    T_hand_sensor: the SCP, None where the data give none or none whose σ would be true (the figures of ``locations``
    then show the fit for diagnosis alone). covariance: of ξ in T = T̂·Exp(ξ), sensor axes (6, 6)
    [mm, rad]. sigma_rotation_deg, sigma_translation_mm: of the six printed numbers, hand axes (3,).
    robot: the nominal robot, with its corrections where the model estimates any. robot_sigma: (5, n) in the order of
    geometry.PARAMETERS, after the data (the prior's where considered). weak_directions: in words.
    """

    method: str
    model: str
    verdict: Verdict
    T_hand_sensor_design: Pose
    locations: dict[str, LocationResult]
    frames: tuple[FrameResult, ...]
    robot: RobotModel | None
    robot_delta: Array
    robot_sigma: Array
    chi2_per_dof: float | None = None
    T_hand_sensor: Pose | None = None
    covariance: Array | None = None
    sigma_rotation_deg: Array | None = None
    sigma_translation_mm: Array | None = None
    anchors_delta_mm: Array = field(default_factory=lambda: np.zeros((6, 3)))
    anchors_sigma_mm: Array = field(default_factory=lambda: np.zeros((6, 3)))
    converged: bool = False
    iterations: int = 0
    initial_cost: float | None = None
    final_cost: float | None = None
    degrees_of_freedom: int = 0
    condition: float | None = None  # scaled condition number of the SCP, nuisances marginalised
    noise: dict[str, float] = field(default_factory=dict)  # σ that made the weights
    weak_directions: tuple[str, ...] = ()
    left_out_rms_mm: dict[str, float] = field(default_factory=dict)  # leave-one-location-out, by model
    notes: tuple[str, ...] = ()
