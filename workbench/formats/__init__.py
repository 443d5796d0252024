"""The files of a cell dataset: strict models that say in one sentence what is wrong, where, and what is right."""

from workbench.formats.cell import Cell, read_cell, read_jig_file
from workbench.formats.frames_csv import FrameRow, frames_text, read_frames
from workbench.formats.images import read_image, write_png
from workbench.formats.points_csv import FramePoints, points_text, read_points
from workbench.formats.robot_file import read_robot, robot_text
from workbench.formats.sensor_file import SensorDescription, read_sensor, sensor_text
from workbench.formats.truth_file import Truth, TruthFrame, TruthPoint, read_truth, write_truth
from workbench.formats.write_cell import cell_text, write_cell

__all__ = [
    "Cell",
    "FramePoints",
    "FrameRow",
    "SensorDescription",
    "Truth",
    "TruthFrame",
    "TruthPoint",
    "cell_text",
    "frames_text",
    "points_text",
    "read_cell",
    "read_frames",
    "read_image",
    "read_jig_file",
    "read_points",
    "read_robot",
    "read_sensor",
    "read_truth",
    "robot_text",
    "sensor_text",
    "write_cell",
    "write_png",
    "write_truth",
]
