"""A robot seen from its hand: the chain of a sensor that stands still and a target that the hand carries."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from geometry.pose import Pose
from geometry.robot.around import AroundRobot
from geometry.robot.model import Arm, Robot, with_beta_prior
from geometry.robot.parameter import Parameter

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Inverted(AroundRobot):
    """The Robot whose pose is T_hand_base of ``robot``: the hand's things stand still, those of the base move.

    A point p of a fixed sensor lies at T_hand_base · T_base_sensor · p in the hand, where the target stands still: the
    same problem as with the sensor on the hand, with the two frames exchanged. T⁻¹ follows a twist ξ of the hand as
    T⁻¹ · Exp(-Ad_T ξ).
    """

    @property
    def arm(self) -> Robot:
        """The robot itself."""
        return self.robot

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        """The robot's."""
        return self.robot.parameters

    def pose(self, joints_rad: ArrayLike, values: ArrayLike | None = None) -> Pose:
        """T_hand_base (...)."""
        return self.robot.pose(joints_rad, values).inverse()

    def joint_jacobian(self, joints_rad: ArrayLike, values: ArrayLike | None = None) -> Array:
        """See Robot; twists in the base's axes."""
        adjoint = self.robot.pose(joints_rad, values).adjoint
        return np.asarray(-adjoint @ self.robot.joint_jacobian(joints_rad, values))

    def parameter_jacobian(self, joints_rad: ArrayLike, values: ArrayLike | None = None) -> Array:
        """See Robot; twists in the base's axes."""
        adjoint = self.robot.pose(joints_rad, values).adjoint
        return np.asarray(-adjoint @ self.robot.parameter_jacobian(joints_rad, values))

    def corrected(self, values: ArrayLike) -> Inverted:
        """See Robot."""
        return Inverted(self.robot.corrected(values))

    def joint_noise(self, joints_rad: ArrayLike, values: ArrayLike | None = None) -> Array:
        """See Robot; of twists in the base's axes."""
        adjoint = self.robot.pose(joints_rad, values).adjoint
        return np.asarray(adjoint @ self.robot.joint_noise(joints_rad, values) @ np.swapaxes(adjoint, -1, -2))

    def with_beta_prior(self, sigma_rad: float) -> Inverted:
        """See Arm."""
        return Inverted(with_beta_prior(self.robot, sigma_rad))


def arm_of(robot: Robot) -> Robot:
    """The robot itself, whichever way it is seen."""
    return robot.arm if isinstance(robot, Inverted) else robot


def is_arm(robot: Robot | None) -> bool:
    """Whether links are known, whichever way the robot is seen."""
    return robot is not None and isinstance(arm_of(robot), Arm)
