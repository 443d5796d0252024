"""Ground floor: poses, lines, the sensor, the robot, measured points and errors (numpy and scipy only)."""

from geometry.errors import InputError, MissingDependencyError, NoAnswerError, PerceptronEmuError, did_you_mean
from geometry.field_of_view import field_of_view, inside_polygon
from geometry.lines import cross_plane_x0, distance_to_line
from geometry.points import AxisPoints, SurfacePoints
from geometry.pose import Pose, cross, exp_so3, log_so3, nearest_rotation, quaternion_wxyz, skew, stack_poses
from geometry.robot import (
    PARAMETERS,
    Arm,
    Compliance,
    Compliant,
    Corrected,
    DhRobot,
    GivenPoses,
    InverseKinematics,
    JointDeviation,
    Parameter,
    Robot,
    RobotModel,
    RobotUncertainty,
    all_solutions,
    draw_errors,
    inverse_kinematics,
    require_arm,
    table,
    with_beta_prior,
)
from geometry.sensor import SensorModel
from geometry.target import Symmetry

__all__ = [
    "PARAMETERS",
    "Arm",
    "AxisPoints",
    "Compliance",
    "Compliant",
    "Corrected",
    "DhRobot",
    "GivenPoses",
    "InputError",
    "InverseKinematics",
    "JointDeviation",
    "MissingDependencyError",
    "NoAnswerError",
    "Parameter",
    "PerceptronEmuError",
    "Pose",
    "Robot",
    "RobotModel",
    "RobotUncertainty",
    "SensorModel",
    "SurfacePoints",
    "Symmetry",
    "all_solutions",
    "cross",
    "cross_plane_x0",
    "did_you_mean",
    "distance_to_line",
    "draw_errors",
    "exp_so3",
    "field_of_view",
    "inside_polygon",
    "inverse_kinematics",
    "log_so3",
    "nearest_rotation",
    "quaternion_wxyz",
    "require_arm",
    "skew",
    "stack_poses",
    "table",
    "with_beta_prior",
]
