"""Gravity bends an arm's joints: how far, from their torsional stiffness and the masses that they carry."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from geometry.errors import InputError
from geometry.robot.dh import RobotModel

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


def deflection(robot: RobotModel, joints_rad: Array, compliance: Compliance) -> Array:
    """How far gravity turns every joint (..., n) [rad] at the readings (..., n); the base's z points up.

    A joint turns by the torque τ = -∂U/∂q of the masses' potential energy U, as far as it is not balanced, over its
    stiffness.
    """
    n = robot.n_joints
    for name in ("stiffness", "mass_kg", "balanced"):
        if len(values := getattr(compliance, name)) != n:
            raise InputError(f"compliance: {name} has {len(values)} values for a robot of {n} joints")
    steps = np.eye(n) * _STEP_RAD
    ahead, behind = (_energy(robot, joints_rad[..., None, :] + sign * steps, compliance) for sign in (1, -1))
    torque = -(ahead - behind) / (2 * _STEP_RAD)
    return np.asarray(torque * (1 - np.array(compliance.balanced)) / np.array(compliance.stiffness))


def _energy(robot: RobotModel, joints_rad: Array, compliance: Compliance) -> Array:
    """Potential energy (...) [J]."""
    z = robot.link_poses(joints_rad).t[..., 2]
    hand = robot.hand_pose(joints_rad).t[..., 2]
    middles = (z[..., :-1] + z[..., 1:]) / 2
    height = middles @ np.array(compliance.mass_kg) + hand * compliance.payload_kg
    return np.asarray(GRAVITY * height / 1000)
