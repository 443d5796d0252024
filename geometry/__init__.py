"""Ground floor: poses, lines, the sensor, the robot, measured points and errors (numpy and scipy only)."""

from geometry.errors import InputError, MissingDependencyError, NoAnswerError, PerceptronEmuError, did_you_mean
from geometry.field_of_view import field_of_view, inside_polygon
from geometry.inverse_kinematics import InverseKinematics, all_solutions, inverse_kinematics
from geometry.lines import cross_plane_x0, distance_to_line
from geometry.points import AxisPoints, SurfacePoints
from geometry.pose import Pose, cross, exp_so3, log_so3, nearest_rotation, quaternion_wxyz, skew, stack_poses
from geometry.robot import PARAMETERS, RobotModel, RobotUncertainty
from geometry.sensor import SensorModel
from geometry.unknowns import Block, Linearised, State, Step, Term, Unknowns

__all__ = [
    "PARAMETERS",
    "AxisPoints",
    "Block",
    "InputError",
    "InverseKinematics",
    "Linearised",
    "MissingDependencyError",
    "NoAnswerError",
    "PerceptronEmuError",
    "Pose",
    "RobotModel",
    "RobotUncertainty",
    "SensorModel",
    "State",
    "Step",
    "SurfacePoints",
    "Term",
    "Unknowns",
    "all_solutions",
    "cross",
    "cross_plane_x0",
    "did_you_mean",
    "distance_to_line",
    "exp_so3",
    "field_of_view",
    "inside_polygon",
    "inverse_kinematics",
    "log_so3",
    "nearest_rotation",
    "quaternion_wxyz",
    "skew",
    "stack_poses",
]
