"""Robots: arms by their Denavit-Hartenberg table, what their parameters do to the hand, and the way back to readings."""

from geometry.robot.dh import PARAMETERS, RobotModel, RobotUncertainty
from geometry.robot.inverse_kinematics import InverseKinematics, all_solutions, inverse_kinematics

__all__ = [
    "PARAMETERS",
    "InverseKinematics",
    "RobotModel",
    "RobotUncertainty",
    "all_solutions",
    "inverse_kinematics",
]
