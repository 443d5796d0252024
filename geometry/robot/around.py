"""What a robot that is another one with something to it has in common with the one inside."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from geometry.robot.model import Robot


@dataclass(frozen=True, eq=False)
class AroundRobot:
    """A Robot around ``robot``: its name, its joints and its limits; limits are of the readings."""

    robot: Robot

    @property
    def name(self) -> str:
        """That of the robot inside."""
        return self.robot.name

    @property
    def n_joints(self) -> int:
        """That of the robot inside."""
        return self.robot.n_joints

    def within_limits(self, joints_rad: ArrayLike) -> NDArray[np.bool_]:
        """See Robot."""
        return self.robot.within_limits(joints_rad)
