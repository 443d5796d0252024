"""Robots: parameters with priors, the hand's pose and its derivatives, decorators, and the way back to readings."""

from geometry.robot.axes_to_dh import robot_from_axes
from geometry.robot.compliant import (
    GRAVITY,
    GROUP,
    Compliance,
    Compliant,
    assumed_compliance,
    compliant_part,
    deflection,
    torque,
    torque_by_joints,
    with_compliance_prior,
)
from geometry.robot.conventions import CONVENTIONS, Convention, express, interpret
from geometry.robot.corrected import Corrected
from geometry.robot.dh import (
    DH_CONVENTIONS,
    DH_ROWS,
    TYPICAL_SIGMA,
    DhRobot,
    DhRow,
    RobotUncertainty,
)
from geometry.robot.given_poses import GivenPoses
from geometry.robot.inverse_kinematics import InverseKinematics, all_solutions, inverse_kinematics
from geometry.robot.inverted import Inverted, arm_of, is_arm
from geometry.robot.joint_deviation import JointDeviation
from geometry.robot.model import Arm, Robot, require_arm, with_beta_prior
from geometry.robot.parameter import Parameter
from geometry.robot.scaled_readings import READING_SCALE, ScaledReadings, with_reading_scales, without_reading_scales
from geometry.robot.table import draw_errors, table
from geometry.robot.urdf_chain import ChainJoint, corrected_origins, robot_from_chain

__all__ = [
    "CONVENTIONS",
    "DH_CONVENTIONS",
    "DH_ROWS",
    "GRAVITY",
    "GROUP",
    "READING_SCALE",
    "TYPICAL_SIGMA",
    "Arm",
    "ChainJoint",
    "Compliance",
    "Compliant",
    "Convention",
    "Corrected",
    "DhRobot",
    "DhRow",
    "GivenPoses",
    "InverseKinematics",
    "Inverted",
    "JointDeviation",
    "Parameter",
    "Robot",
    "RobotUncertainty",
    "ScaledReadings",
    "all_solutions",
    "arm_of",
    "assumed_compliance",
    "compliant_part",
    "corrected_origins",
    "deflection",
    "draw_errors",
    "express",
    "interpret",
    "inverse_kinematics",
    "is_arm",
    "require_arm",
    "robot_from_axes",
    "robot_from_chain",
    "table",
    "torque",
    "torque_by_joints",
    "with_beta_prior",
    "with_compliance_prior",
    "with_reading_scales",
    "without_reading_scales",
]
