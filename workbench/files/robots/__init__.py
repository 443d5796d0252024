"""Arms as files: robot.toml, and URDF read and written back."""

from workbench.files.robots.robot_file import read_robot, robot_text, urdf_of
from workbench.files.robots.urdf import read_urdf, urdf_ends
from workbench.files.robots.urdf_write import write_urdf

__all__ = ["read_robot", "read_urdf", "robot_text", "urdf_ends", "urdf_of", "write_urdf"]
