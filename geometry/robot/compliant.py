"""Gravity bends an arm's joints: how far, from their torsional stiffness and the masses that they carry."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike, NDArray

from geometry.errors import InputError
from geometry.robot.joint_deviation import JointDeviation
from geometry.robot.model import Arm, require_arm
from geometry.robot.parameter import Parameter

Array = NDArray[np.float64]

GRAVITY = 9.81  # m/s²
_STEP_RAD = 1e-4


@dataclass(frozen=True)
class Compliance:
    """Torsional stiffness (n) [N·m/rad] of the joints and the masses (n) [kg] in the middle of the links, last to hand.

    payload_kg: at the hand's frame. balanced (n): share of each joint's torque that a weight compensator carries.
    The defaults are assumed, of a heavy six-axis arm: stiffness of the order that Dumas et al. (Robotics and
    Computer-Integrated Manufacturing 27, 2011) are concerned with, not taken from their table; masses guessed for an
    arm of some 1,300 kg with a compensator at its second joint; no correction in the controller.
    """

    stiffness: tuple[float, ...] = (1.4e6, 4e5, 9e5, 4e5, 4e5, 4e5)
    mass_kg: tuple[float, ...] = (0.0, 250.0, 120.0, 180.0, 40.0, 20.0)
    payload_kg: float = 25.0
    balanced: tuple[float, ...] = (0.0, 0.8, 0.0, 0.0, 0.0, 0.0)


@dataclass(frozen=True, eq=False)
class Compliant(JointDeviation):
    """An arm whose joints give way under its weight: a Robot with the compliance of its joints as parameters.

    Joint i turns by (1/k_i + c_i) · τ_i, its stiffness k from ``load``, its torque τ from the masses there at the
    readings, by the arm's nominal table; the parameters "stiffness1", "stiffness2", … are the c_i [rad/(N·m)].

    Parameters
    ----------
    robot
        The arm without load, its base's z axis up.
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
            Parameter(f"stiffness{i + 1}", "rad/Nm", float(sigma[i]), "compliance") for i in np.flatnonzero(sigma > 0)
        )

    def deviation(self, joints_rad: Array, values: Array) -> Array:
        """How far gravity turns the joints."""
        arm = require_arm(self.robot)
        nominal = deflection(arm, joints_rad, self.load)
        if not np.any(values):
            return nominal
        more = np.zeros(self.n_joints)
        more[self._sigmas > 0] = values
        return np.asarray(nominal + torque(arm, joints_rad, self.load) * more)

    def deviation_by_values(self, joints_rad: Array, values: Array) -> Array:
        """The torque of each joint [N·m], on its own parameter."""
        by_all = torque(require_arm(self.robot), joints_rad, self.load)[..., None] * np.eye(self.n_joints)
        return np.asarray(by_all[..., self._sigmas > 0])

    @property
    def _sigmas(self) -> Array:
        return np.array(np.broadcast_to(np.asarray(self.sigma, dtype=float), self.n_joints))


def deflection(robot: Arm, joints_rad: ArrayLike, compliance: Compliance) -> Array:
    """How far gravity turns every joint of an arm, as far as it is not balanced: torque over stiffness.

    Parameters
    ----------
    robot
        The arm; the base's z points up.
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
    n = robot.n_joints
    for name in ("stiffness", "mass_kg", "balanced"):
        if len(values := getattr(compliance, name)) != n:
            raise InputError(f"compliance: {name} has {len(values)} values for a robot of {n} joints")
    q, steps = np.asarray(joints_rad, dtype=float), np.eye(n) * _STEP_RAD
    ahead, behind = (_energy(robot, q[..., None, :] + sign * steps, compliance) for sign in (1, -1))
    return np.asarray(-(ahead - behind) / (2 * _STEP_RAD) * (1 - np.array(compliance.balanced)))


def _energy(robot: Arm, joints_rad: Array, compliance: Compliance) -> Array:
    """Potential energy (...) [J]."""
    z = robot.link_poses(joints_rad).t[..., 2]
    hand = robot.pose(joints_rad).t[..., 2]
    middles = (z[..., :-1] + z[..., 1:]) / 2
    height = middles @ np.array(compliance.mass_kg) + hand * compliance.payload_kg
    return np.asarray(GRAVITY * height / 1000)
