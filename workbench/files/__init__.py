"""The files of a cell dataset: strict models that say in one sentence what is wrong, where, and what is right."""

from workbench.files.cell import Cell, read_cell, read_jig_file
from workbench.files.frames_csv import frames_text, read_frames
from workbench.files.images import read_image, write_png
from workbench.files.points_csv import GivenPoints, points_text, read_points
from workbench.files.robot_file import read_robot, robot_text
from workbench.files.sensor_file import read_emulator, read_sensor, sensor_text
from workbench.files.truth_file import Truth, TruthFrame, TruthPoint, read_truth, write_truth
from workbench.files.write_cell import cell_text, write_cell

__all__ = [
    "Cell",
    "GivenPoints",
    "Truth",
    "TruthFrame",
    "TruthPoint",
    "cell_text",
    "frames_text",
    "points_text",
    "read_cell",
    "read_emulator",
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
