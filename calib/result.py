"""What calibration answers: everything that the result file names, as arrays and small records."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from calib.as_json import result_object
from calib.compliance import JointCompliance, joint_compliances
from calib.mount import Mount
from calib.prediction import prediction_jacobian
from calib.printed import printed_sigmas
from calib.sensor_errors import SensorErrors
from calib.summary import summary
from geometry import Frame, InputError, Pose, Robot, Role, Target, json_text

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]
Code = Literal[
    "ok",
    "model_misfit",
    "priors_contradict",
    "sensor_suspect",
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
TRUSTWORTHY: frozenset[Code] = frozenset({"ok", "model_misfit", "priors_contradict", "sensor_suspect", "weak"})
SIGMA_HOLDS: frozenset[Code] = TRUSTWORTHY | {
    "not_observable"
}  # verdicts whose covariance says how wrong the answer is


@dataclass(frozen=True)
class Verdict:
    """The judgement on a calibration: a code, and words with advice.

    withheld: a fault is seen that no σ can be given for, whatever the code.
    """

    code: Code
    text: str
    withheld: bool = False

    @property
    def trustworthy(self) -> bool:
        """Whether the answer may be used (exit code 0), with care where the code is not "ok"."""
        return self.code in TRUSTWORTHY and not self.withheld


@dataclass(frozen=True)
class Pull:
    """How far a number of the files is pulled from where its file has it.

    block: "robot", "jig" or "sensor". parameter, row: the number, and the joint whose row it stands in. size: what
    the data would have added to it, in ``unit``. pull_sigma: that over what is expected by chance.
    """

    block: str
    parameter: str
    row: int | None
    size: float
    unit: str
    pull_sigma: float


@dataclass(frozen=True)
class Culprit(Pull):
    """The number that is most likely wrong; same_as: those that the data can not tell from it, best first."""

    same_as: tuple[str, ...] = ()


@dataclass(frozen=True, eq=False)
class Nominal:
    """The SCP that goes with the robot's table as given, and its covariance (6, 6) with the table's errors."""

    T_hand_sensor: Pose
    covariance: Array


@dataclass(frozen=True)
class DesignSolved:
    """One figure with the design SCP and nominal robot, and with what was solved; None where it can not be formed.

    nominal: with the solved SCP that goes with the nominal robot.
    """

    design: float | None
    solved: float | None
    nominal: float | None = None


@dataclass(frozen=True, eq=False)
class Distances:
    """The paper's Fig. 7 for one location: frames with all strings, the jig origin's distance from the base [mm]."""

    frame: tuple[int, ...]
    design_mm: Array
    solved_mm: Array


@dataclass(frozen=True, eq=False)
class LocationResult:
    """One place of the target.

    surface: what is said of a surface there, None for strings. n_points, n_found: of the profiles, and on the target.
    centres_left_out: frames whose section is too nearly the whole ball to tell a centre.
    """

    role: Role
    T_base_target: Pose | None
    max_deviation_mm: DesignSolved
    spread_3d_mm: DesignSolved
    point_rms_mm: DesignSolved
    distances: Distances
    surface: Mapping[str, object] | None = None
    n_points: int = 0
    n_found: int = 0
    centres_left_out: int = 0


@dataclass(frozen=True, eq=False)
class LeftOutPart:
    """One location or frame (its number), solved from the others: rms of its points, and how the SCP moves.

    shift (6,): ξ of T̂·Exp(ξ), sensor axes [mm, rad].
    """

    name: str
    point_rms_mm: float
    shift: Array

    @property
    def shift_mm(self) -> float:
        """How far the SCP is shifted."""
        return float(np.linalg.norm(self.shift[:3]))

    @property
    def shift_deg(self) -> float:
        """How far it is turned."""
        return float(np.rad2deg(np.linalg.norm(self.shift[3:])))


@dataclass(frozen=True, eq=False)
class LeftOut:
    """Parts left out in turn, by "location" or by "frame", and the rms of all of their points."""

    by: str
    point_rms_mm: float
    parts: tuple[LeftOutPart, ...]


@dataclass(frozen=True, eq=False)
class EqualWeights:
    """The answer with all points weighted alike: what others quote, and σ that hang on no model of noise.

    covariance (6, 6): of ξ, sensor axes, by the delete-one jackknife. point_rms_mm: of all points in the solution;
    left_out_rms_mm: of each frame's points by a solution without it.
    """

    T_hand_sensor: Pose
    covariance: Array
    point_rms_mm: float
    left_out_rms_mm: float


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
    targets : mapping of str to Target
        Surfaces by location, their shape as it was solved.
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
    nominal : Nominal or None
        What goes with the nominal robot.
    joint_covariance : ndarray (6 + P + K, 6 + P + K) or None
        Of SCP, ``whole_robot`` and the sensor's ``errors`` together, for predictions: it covers what is wrong with a
        small probability and hardly seen, too.
    whole_robot : Robot or None
        ``robot`` with what its file takes for exact among its parameters (P); None where they are the same.
    errors : SensorErrors or None
        The sensor's own errors (K,).
    sensor_delta : dict of str to float
        What was estimated of the sensor, to be added to its file's numbers.
    pulls : tuple of Pull
        The largest, first.
    culprit : tuple of Culprit
        What contradicts the data.
    prior_cost, prior_expected : float
        Squared departures from all priors in σ, and their expectation.
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
    targets: Mapping[str, Target] = field(default_factory=dict)
    shape_delta: Array = field(default_factory=lambda: np.zeros(0))
    shape_sigma: Array = field(default_factory=lambda: np.zeros(0))
    reasons: dict[int, str] = field(default_factory=dict)
    outliers: dict[int, Mask] = field(default_factory=dict)
    weak_directions: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()
    nominal: Nominal | None = None
    joint_covariance: Array | None = None
    whole_robot: Robot | None = None
    errors: SensorErrors | None = None
    sensor_delta: dict[str, float] = field(default_factory=dict)
    pulls: tuple[Pull, ...] = ()
    culprit: tuple[Culprit, ...] = ()
    prior_cost: float = 0.0
    prior_expected: float = 0.0

    def predicted_covariance(self, joints_rad: Array, yz_mm: Array) -> Array:
        """Covariance (F, M, 3, 3) [mm²] of where points (F, M, 2), measured at readings (F, n), are in the base."""
        J = self.prediction_jacobian(joints_rad, yz_mm)
        joint = np.zeros((0, 0)) if self.joint_covariance is None else self.joint_covariance
        return np.asarray(J @ joint @ np.swapaxes(J, -1, -2))

    def prediction_jacobian(self, joints_rad: Array, yz_mm: Array) -> Array:
        """Motions (F, M, 3, 6 + P + K) [mm] of these by SCP, robot and sensor, as ``joint_covariance`` has them."""
        if self.robot is None or self.joint_covariance is None:
            raise InputError("what is predicted of points elsewhere needs joint readings and a robot's table")
        return prediction_jacobian(self.T_hand_sensor, self.whole_robot or self.robot, self.errors, joints_rad, yz_mm)


@dataclass(frozen=True, eq=False)
class CalibrationResult:
    """The answer of calibrate.

    Parameters
    ----------
    method, model : str
        As solved.
    model_asked : str
        As asked for.
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
    left_out : LeftOut or None
        How well points are predicted by a solution that they had no part in.
    left_out_rms_mm : dict of str to float
        Rms distance of points at locations left out, by model.
    equal_weights : EqualWeights or None
        Of hand poses to one surface: the answer with all points weighted alike.
    """

    method: str
    model: str
    verdict: Verdict
    T_hand_sensor_design: Pose | None
    locations: dict[str, LocationResult]
    frames: tuple[Frame, ...]
    nominal_robot: Robot | None
    estimate: Estimate | None = None
    left_out: LeftOut | None = None
    left_out_rms_mm: dict[str, float] = field(default_factory=dict)
    equal_weights: EqualWeights | None = None
    remarks: tuple[str, ...] = ()
    model_asked: str = ""
    mount: Mount = "hand"

    def __str__(self) -> str:
        """The answer on a screen: what `print` shows."""
        return summary(self)

    def to_json(self, indent: int | None = 1) -> str:
        """The answer as JSON text, with the keys of ``calibrate --json`` (docs/formats.md)."""
        return json_text(result_object(self), indent)

    @property
    def trusted(self) -> Estimate | None:
        """The estimate, unless its covariance would not say how wrong it is."""
        return self.estimate if self.verdict.code in SIGMA_HOLDS and not self.verdict.withheld else None

    @property
    def nominal(self) -> Nominal | None:
        """The SCP that goes with the robot's table as given; None where none is to be trusted."""
        return None if self.trusted is None else self.trusted.nominal

    @property
    def pulls(self) -> tuple[Pull, ...]:
        """The largest pulls of numbers of the files, largest first; also where nothing else is to be trusted."""
        return () if self.estimate is None else self.estimate.pulls

    @property
    def culprit(self) -> tuple[Culprit, ...]:
        """The numbers of the files that contradict the data."""
        return () if self.estimate is None else self.estimate.culprit

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
    def nominal_apart(self) -> Nominal | None:
        """The SCP that goes with the robot's nominal table, where the solved one goes with another table; None else."""
        return self.nominal if np.any(self.robot_delta) else None

    @property
    def robot_delta(self) -> Array:
        """Corrections (P,) of the robot's parameters, zero where none belong to the answer."""
        if self.trusted is not None:
            return self.trusted.robot_delta
        return np.zeros(0 if self.nominal_robot is None else len(self.nominal_robot.parameters))

    @property
    def joint_compliances(self) -> tuple[JointCompliance, ...]:
        """How the joints give way under gravity, where the model estimates it; empty otherwise."""
        if self.trusted is None or "compliance" not in self.model.split("+"):
            return ()
        return joint_compliances(self.trusted.robot, self.trusted.robot_sigma)

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
