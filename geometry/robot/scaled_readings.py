"""An arm whose joints turn in proportion to what they read, not by it: gears of another ratio than stated."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from geometry.robot.inverted import Inverted
from geometry.robot.joint_deviation import JointDeviation
from geometry.robot.model import Robot
from geometry.robot.parameter import Parameter

Array = NDArray[np.float64]

READING_SCALE = "reading_scale"  # the group of the parameters


@dataclass(frozen=True, eq=False)
class ScaledReadings(JointDeviation):
    """A robot whose joint i turns by (1 + s_i) of its reading, the parameters "reading_scale1", … being the s_i.

    Parameters
    ----------
    robot
        The robot with true readings.
    sigma
        Prior σ of every joint's scale; 0 where it is taken for exact, as files take it.
    """

    sigma: float = 0.0

    @property
    def own_parameters(self) -> tuple[Parameter, ...]:
        """One scale a joint."""
        return tuple(Parameter(f"{READING_SCALE}{i + 1}", "", self.sigma, READING_SCALE) for i in range(self.n_joints))

    def deviation(self, joints_rad: Array, values: Array) -> Array:
        """In proportion to the readings."""
        return np.asarray(joints_rad * values)

    def deviation_by_joints(self, joints_rad: Array, values: Array) -> Array:
        """Each joint's scale on its own reading."""
        return np.broadcast_to(np.diag(values), (*joints_rad.shape, self.n_joints))

    def deviation_by_values(self, joints_rad: Array, values: Array) -> Array:
        """Each reading on its own joint's scale."""
        return np.asarray(joints_rad[..., None] * np.eye(self.n_joints))


def with_reading_scales(robot: Robot) -> Robot:
    """The robot with the scale of each joint's readings among its parameters, taken for exact.

    Parameters
    ----------
    robot
        One that has them is returned as it is; of one that is seen from its hand the arm gets them.

    Returns
    -------
    Robot
        Its parameters are those of the robot, then one scale a joint.
    """
    if any(p.group == READING_SCALE for p in robot.parameters):
        return robot
    return Inverted(ScaledReadings(robot.arm)) if isinstance(robot, Inverted) else ScaledReadings(robot)


def without_reading_scales(robot: Robot) -> Robot:
    """The robot that ``with_reading_scales`` was given.

    Parameters
    ----------
    robot
        Any; one without scales is returned as it is.

    Returns
    -------
    Robot
        Whose readings are taken as they are.
    """
    if isinstance(robot, Inverted):
        plain = without_reading_scales(robot.arm)
        return robot if plain is robot.arm else Inverted(plain)
    return robot.robot if isinstance(robot, ScaledReadings) else robot
