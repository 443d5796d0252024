"""A robot with corrections of its parameters built in, whatever kind of robot it is."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from geometry.errors import InputError
from geometry.pose import Pose
from geometry.robot.around import AroundRobot
from geometry.robot.dh import DhRobot
from geometry.robot.model import require_arm
from geometry.robot.parameter import Parameter

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Corrected(AroundRobot):
    """``robot`` with ``values`` (P,) added to its parameters; further corrections count from there."""

    values: Array

    def __post_init__(self) -> None:
        """InputError where the corrections are not those of the robot."""
        if np.shape(self.values) != (len(self.parameters),):
            raise InputError(
                f"{np.size(self.values)} corrections for a robot of {len(self.parameters)} uncertain parameters"
            )

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        """The robot's, counted from the corrections here."""
        return self.robot.parameters

    def pose(self, joints_rad: ArrayLike, values: ArrayLike | None = None) -> Pose:
        """See Robot."""
        return self.robot.pose(joints_rad, self.with_more(values))

    def joint_jacobian(self, joints_rad: ArrayLike, values: ArrayLike | None = None) -> Array:
        """See Robot."""
        return self.robot.joint_jacobian(joints_rad, self.with_more(values))

    def parameter_jacobian(self, joints_rad: ArrayLike, values: ArrayLike | None = None) -> Array:
        """See Robot."""
        return self.robot.parameter_jacobian(joints_rad, self.with_more(values))

    def corrected(self, values: ArrayLike) -> Corrected:
        """See Robot."""
        return Corrected(self.robot, self.with_more(values))

    def joint_noise(self, joints_rad: ArrayLike, values: ArrayLike | None = None) -> Array:
        """See Robot."""
        return self.robot.joint_noise(joints_rad, self.with_more(values))

    def link_poses(self, joints_rad: ArrayLike, values: ArrayLike | None = None) -> Pose:
        """See Arm."""
        return require_arm(self.robot).link_poses(joints_rad, self.with_more(values))

    def pose_and_jacobian(self, joints_rad: ArrayLike, values: ArrayLike | None = None) -> tuple[Pose, Array]:
        """See Arm."""
        return require_arm(self.robot).pose_and_jacobian(joints_rad, self.with_more(values))

    def dh_part(self, values: ArrayLike | None = None) -> DhRobot:
        """See Arm."""
        return require_arm(self.robot).dh_part(self.with_more(values))

    def with_beta_prior(self, sigma_rad: float) -> Corrected:
        """See Arm; corrections of parameters that are no longer there are built into none: they must be 0."""
        robot = require_arm(self.robot).with_beta_prior(sigma_rad)
        mine = {p.name: float(v) for p, v in zip(self.parameters, self.values, strict=True)}
        values = np.array([mine.pop(p.name, 0.0) for p in robot.parameters])
        if any(mine.values()):
            raise InputError(f"{', '.join(mine)} are corrected already and can not be made exact")
        return Corrected(robot, values)

    def with_more(self, values: ArrayLike | None) -> Array:
        """The corrections here and further ones."""
        if values is None:
            return self.values
        if np.shape(values) != self.values.shape:
            raise InputError(f"{np.size(values)} corrections for a robot of {self.values.size} uncertain parameters")
        return np.asarray(self.values + np.asarray(values, dtype=float))
