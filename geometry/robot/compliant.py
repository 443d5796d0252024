"""Gravity bends an arm's joints: how far, from their torsional stiffness and the masses that they carry."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from geometry.errors import InputError
from geometry.pose import cross
from geometry.robot.corrected import Corrected
from geometry.robot.joint_deviation import JointDeviation
from geometry.robot.model import Arm, Robot, require_arm
from geometry.robot.parameter import Parameter

Array = NDArray[np.float64]

GRAVITY = 9.81  # m/s²
GROUP = "compliance"  # of the parameters
_LINKS_MM = 3460.0  # all links in a row of the arm that the defaults below are assumed of


@dataclass(frozen=True)
class Compliance:
    """Torsional stiffness (n) [N·m/rad] of the joints and the masses (n) [kg] in the middle of the links, last to hand.

    payload_kg: at the hand's frame. balanced (n): share of each joint's torque that a weight compensator carries. up:
    the unit vector against gravity in the base, of an arm that stands; one that hangs has (0, 0, -1).
    The defaults are assumed, of a heavy six-axis arm: stiffness of the order that Dumas et al. (Robotics and
    Computer-Integrated Manufacturing 27, 2011) are concerned with, not taken from their table; masses guessed for an
    arm of some 1,300 kg with a compensator at its second joint; no correction in the controller.
    """

    stiffness: tuple[float, ...] = (1.4e6, 4e5, 9e5, 4e5, 4e5, 4e5)
    mass_kg: tuple[float, ...] = (0.0, 250.0, 120.0, 180.0, 40.0, 20.0)
    payload_kg: float = 25.0
    balanced: tuple[float, ...] = (0.0, 0.8, 0.0, 0.0, 0.0, 0.0)
    up: tuple[float, float, float] = (0.0, 0.0, 1.0)


@dataclass(frozen=True, eq=False)
class Compliant(JointDeviation):
    """An arm whose joints give way under its weight: a Robot with the compliance of its joints as parameters.

    Joint i turns by (1/k_i + c_i) · τ_i, its stiffness k from ``load``, its torque τ from the masses there by the
    nominal table at the readings; the parameters "compliance1", "compliance2", … are the c_i [rad/(N·m)].

    Parameters
    ----------
    robot
        The arm without load.
    load
        Stiffness, infinite for a rigid joint, and masses.
    sigma
        Prior σ of every joint's compliance [rad/(N·m)], one number or (n,); 0 where it is known.
    """

    load: Compliance = field(default_factory=Compliance)
    sigma: float | tuple[float, ...] = 0.0

    @property
    def own_parameters(self) -> tuple[Parameter, ...]:
        """The compliance of the joints that are uncertain."""
        sigma = self._sigmas
        return tuple(
            Parameter(f"compliance{i + 1}", "rad/Nm", float(sigma[i]), GROUP) for i in np.flatnonzero(sigma > 0)
        )

    def deviation(self, joints_rad: Array, values: Array) -> Array:
        """How far gravity turns the joints."""
        return np.asarray(torque(require_arm(self.robot), joints_rad, self.load) * self.compliance(values))

    def deviation_by_joints(self, joints_rad: Array, values: Array) -> Array:
        """How the torque of every joint changes with every reading, times its compliance."""
        change = torque_by_joints(require_arm(self.robot), joints_rad, self.load)
        return np.asarray(change * self.compliance(values)[:, None])

    def deviation_by_values(self, joints_rad: Array, values: Array) -> Array:
        """The torque of each joint [N·m], on its own parameter."""
        by_all = torque(require_arm(self.robot), joints_rad, self.load)[..., None] * np.eye(self.n_joints)
        return np.asarray(by_all[..., self._sigmas > 0])

    def compliance(self, values: Array) -> Array:
        """1/k + c (n,) [rad/(N·m)]."""
        total = 1 / np.array(self.load.stiffness)
        total[self._sigmas > 0] += values
        return total

    @property
    def _sigmas(self) -> Array:
        return np.array(np.broadcast_to(np.asarray(self.sigma, dtype=float), self.n_joints))


def deflection(robot: Arm, joints_rad: ArrayLike, compliance: Compliance) -> Array:
    """How far gravity turns every joint of an arm, as far as it is not balanced: torque over stiffness.

    Parameters
    ----------
    robot
        The arm.
    joints_rad
        Readings (..., n).
    compliance
        Stiffness and masses of n joints.

    Returns
    -------
    ndarray
        (..., n) [rad], to be added to the readings.

    Raises
    ------
    InputError
        Where stiffness and masses are of another number of joints.
    """
    return np.asarray(torque(robot, joints_rad, compliance) / np.array(compliance.stiffness))


def torque(robot: Arm, joints_rad: ArrayLike, compliance: Compliance) -> Array:
    """The torque (..., n) [N·m] that the joints must give way to: τ = -∂U/∂q of the masses' potential energy U."""
    levers = _levers(robot, joints_rad, compliance)
    by_angles = GRAVITY * (levers.moment @ np.array(compliance.up)) / 1000
    unbalanced = 1 - np.array(compliance.balanced)
    return np.asarray(-(by_angles @ robot.dh_part().readings_to_angles) * unbalanced)


def torque_by_joints(robot: Arm, joints_rad: ArrayLike, compliance: Compliance) -> Array:
    """∂τ/∂q (..., n, n) [N·m/rad]: rows by the joint that gives way, columns by the reading."""
    levers = _levers(robot, joints_rad, compliance)
    # turning joint i moves what hangs on a joint k beyond it as a whole: ∂²p/∂θ_i∂θ_k = z_i × (z_k × (p - o_k))
    second = cross(levers.axis[..., :, None, :], levers.moment[..., None, :, :]) @ np.array(compliance.up)
    outer = np.triu(second)
    by_angles = GRAVITY * (outer + np.swapaxes(np.triu(second, 1), -1, -2)) / 1000
    m = robot.dh_part().readings_to_angles
    return np.asarray(-(m.T @ by_angles @ m) * (1 - np.array(compliance.balanced))[:, None])


def assumed_compliance(robot: Arm) -> Compliance:
    """The assumed compliance of an arm of another size or number of joints, whose joints give way by like angles.

    Parameters
    ----------
    robot : Arm
        Its links tell its size.

    Returns
    -------
    Compliance
        Masses grow with the cube of the links' length and stiffness with its fourth power.
    """
    plain, table = Compliance(), robot.dh_part()
    share = float(np.sum(np.hypot(table.a, table.d))) / _LINKS_MM
    like = np.round(np.linspace(0, len(plain.stiffness) - 1, robot.n_joints)).astype(int)
    return Compliance(
        stiffness=tuple(plain.stiffness[i] * share**4 for i in like),
        mass_kg=tuple(plain.mass_kg[i] * share**3 for i in like),
        payload_kg=plain.payload_kg * share**3,
        balanced=tuple(plain.balanced[i] for i in like),
    )


def with_compliance_prior(robot: Robot) -> Robot:
    """The robot with the compliance of its joints uncertain.

    Parameters
    ----------
    robot
        One that has compliance among its parameters is returned as it is.

    Returns
    -------
    Robot
        Else an arm that is rigid as far as is known, by assumed masses, every joint's compliance as uncertain as it is
        assumed to be large.

    Raises
    ------
    InputError
        Where the robot's links are not known, or its compliance is said to be exact.
    """
    if any(p.group == GROUP for p in robot.parameters):
        return robot
    if compliant_part(robot) is not None:
        raise InputError("[compliance] sigma_urad_nm of robot.toml is 0: its compliance is exact, nothing is estimated")
    assumed = assumed_compliance(require_arm(robot))
    rigid = replace(assumed, stiffness=(np.inf,) * robot.n_joints)
    return Compliant(robot, rigid, tuple(1 / k for k in assumed.stiffness))


def compliant_part(robot: Robot, values: ArrayLike | None = None) -> Compliant | None:
    """The table with its compliance, both with corrections built in.

    Parameters
    ----------
    robot : Robot
        Any; a decorated one is looked into.
    values : (P,), optional
        Corrections of its parameters; None: none.

    Returns
    -------
    Compliance or None
        None for an arm without compliance.
    """
    robot = getattr(robot, "arm", robot)  # of one that is seen from its hand
    if isinstance(robot, Corrected):
        return compliant_part(robot.robot, robot.with_more(values))
    if not isinstance(robot, JointDeviation):
        return None
    inner, own = (None, np.zeros(len(robot.own_parameters))) if values is None else robot.split(values)
    if not isinstance(robot, Compliant):
        return compliant_part(robot.robot, inner)
    with np.errstate(divide="ignore"):
        load = replace(robot.load, stiffness=tuple(float(k) for k in 1 / robot.compliance(own)))
    return Compliant(require_arm(robot.robot).dh_part(inner), load, robot.sigma)


@dataclass(frozen=True, eq=False)
class _Levers:
    """Every joint's axis (..., n, 3) in the base, and how the masses beyond it move with its angle [kg·mm/rad]."""

    axis: Array
    moment: Array


def _levers(robot: Arm, joints_rad: ArrayLike, compliance: Compliance) -> _Levers:
    """By the nominal table at the readings: what bends or turns the arm further changes the levers by parts of 1e-3."""
    table, n = robot.dh_part(), robot.n_joints
    for name in ("stiffness", "mass_kg", "balanced"):
        if len(values := getattr(compliance, name)) != n:
            raise InputError(f"compliance: {name} has {len(values)} values for a robot of {n} joints")
    frames, link = table.link_poses(joints_rad), np.array(compliance.mass_kg)
    hand = frames[..., -1] @ table.T_last_hand
    mass = np.concatenate([link / 2, [compliance.payload_kg]])  # at the end of each link, and at the hand
    mass[:-2] += link[1:] / 2
    points = np.concatenate([frames.t[..., 1:, :], hand.t[..., None, :]], -2)
    beyond = np.cumsum((mass[:, None] * points)[..., ::-1, :], axis=-2)[..., ::-1, :][..., :n, :]
    carried = np.cumsum(mass[::-1])[::-1][:n]
    joint = frames[..., :-1] if table.convention == "standard" else frames[..., 1:]
    axis = joint.R[..., 2]
    return _Levers(axis, cross(axis, beyond - carried[:, None] * joint.t))
