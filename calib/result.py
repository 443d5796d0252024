"""What calibration answers: everything that the result file names, as arrays and small records."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from calib.printed import printed_sigmas
from geometry import Frame, Pose, Robot, Role

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]
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
    "frames_contradict",
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
    T_base_target: Pose | None
    max_deviation_mm: DesignSolved
    spread_3d_mm: DesignSolved
    point_rms_mm: DesignSolved
    distances: Distances


@dataclass(frozen=True, eq=False)
class Estimate:
    """What a method says of SCP, robot and shape, and which frames and points it left out.

    Parameters
    ----------
    T_hand_sensor : Pose
    covariance : ndarray (6, 6)
        Of ξ in T = T̂·Exp(ξ), sensor axes [mm, rad].
    robot : Robot or None
        With its corrections; None where only hand poses are known.
    robot_delta, robot_sigma : ndarray (P,)
        Corrections of ``robot.parameters`` and their σ, after the data or the prior's where considered.
    shape_delta, shape_sigma : ndarray (S,)
        Of the target's shape unknowns.
    chi2_per_dof, degrees_of_freedom, converged, iterations, initial_cost, final_cost
        Of the fit.
    condition : float
        Scaled condition number of the SCP, nuisances marginalised.
    noise : dict
        The σ that made the weights, by name.
    reasons : dict of int to str
        Why a frame that was tried was left out after all, by its number.
    outliers : dict of int to ndarray (N,) of bool
        Its outlying points, by its number.
    weak_directions, notes : tuple of str
        In words.
    """

    T_hand_sensor: Pose
    covariance: Array
    robot: Robot | None
    robot_delta: Array
    robot_sigma: Array
    chi2_per_dof: float
    degrees_of_freedom: int
    converged: bool
    iterations: int
    initial_cost: float
    final_cost: float
    condition: float
    noise: dict[str, float]
    shape_delta: Array = field(default_factory=lambda: np.zeros(0))
    shape_sigma: Array = field(default_factory=lambda: np.zeros(0))
    reasons: dict[int, str] = field(default_factory=dict)
    outliers: dict[int, Mask] = field(default_factory=dict)
    weak_directions: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()


@dataclass(frozen=True, eq=False)
class CalibrationResult:
    """The answer of calibrate.

    Parameters
    ----------
    method, model : str
        As solved.
    verdict : Verdict
    T_hand_sensor_design : Pose
        The SCP that was given.
    locations : dict of str to LocationResult
    frames : tuple of Frame
        As used: labelled, with residuals, own poses and the reason why not.
    nominal_robot : Robot or None
        As given.
    estimate : Estimate or None
        What the method says; None where the data were refused before solving. Where the verdict says that its σ would
        not be true, T_hand_sensor and covariance below withhold it, and the figures of ``locations`` show the fit for
        diagnosis alone.
    left_out_rms_mm : dict of str to float
        Rms distance of points at locations left out, by model.
    """

    method: str
    model: str
    verdict: Verdict
    T_hand_sensor_design: Pose
    locations: dict[str, LocationResult]
    frames: tuple[Frame, ...]
    nominal_robot: Robot | None
    estimate: Estimate | None = None
    left_out_rms_mm: dict[str, float] = field(default_factory=dict)
    remarks: tuple[str, ...] = ()

    @property
    def trusted(self) -> Estimate | None:
        """The estimate, unless its covariance would not say how wrong it is."""
        return self.estimate if self.verdict.code in SIGMA_HOLDS else None

    @property
    def T_hand_sensor(self) -> Pose | None:
        """The SCP, None where the data give none or none whose σ would be true."""
        return None if self.trusted is None else self.trusted.T_hand_sensor

    @property
    def covariance(self) -> Array | None:
        """Of ξ in T = T̂·Exp(ξ), sensor axes (6, 6) [mm, rad]; None where withheld."""
        return None if self.trusted is None else self.trusted.covariance

    @property
    def sigma_rotation_deg(self) -> Array | None:
        """σ of the three printed angles, hand axes (3,)."""
        return None if self.trusted is None else self._printed[0]

    @property
    def sigma_translation_mm(self) -> Array | None:
        """σ of the three printed lengths, hand axes (3,)."""
        return None if self.trusted is None else self._printed[1]

    @cached_property
    def _printed(self) -> tuple[Array, Array]:
        e = self.trusted
        return printed_sigmas(e.T_hand_sensor, e.covariance) if e is not None else (np.zeros(3), np.zeros(3))

    @property
    def robot(self) -> Robot | None:
        """The robot with its corrections where the model estimates any, else as given."""
        return self.nominal_robot if self.trusted is None else self.trusted.robot

    @property
    def robot_delta(self) -> Array:
        """Corrections (P,) of the robot's parameters, zero where none belong to the answer."""
        if self.trusted is not None:
            return self.trusted.robot_delta
        return np.zeros(0 if self.nominal_robot is None else len(self.nominal_robot.parameters))

    @property
    def weak_directions(self) -> tuple[str, ...]:
        """What the data can not tell apart, in words."""
        return () if self.trusted is None else self.trusted.weak_directions

    @property
    def chi2_per_dof(self) -> float | None:
        """χ² per degree of freedom of the fit; None where nothing was solved."""
        return None if self.estimate is None else self.estimate.chi2_per_dof

    @property
    def notes(self) -> tuple[str, ...]:
        """Remarks on the data and on the answer."""
        return (*(() if self.estimate is None else self.estimate.notes), *self.remarks)
