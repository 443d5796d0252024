"""The files of a cell dataset: strict models that say in one sentence what is wrong, where, and what is right."""

from workbench.files.anchors_csv import lay_onto
from workbench.files.atomic import sha256_of, write_bytes, write_text
from workbench.files.board_file import board_text, read_board
from workbench.files.board_views import ViewFiles, find_views, picture_sensor
from workbench.files.cell import Cell, read_cell, read_jig_file
from workbench.files.cell_writer import cell_text, write_cell
from workbench.files.controller import CONTROLLERS, controller_text
from workbench.files.controller_poses import ControllerPoses, PosesSection, controller_poses
from workbench.files.examined import FileFinding, examine_cell
from workbench.files.frames_csv import frames_text, read_frames
from workbench.files.images import LOSSY_SUFFIXES, SUFFIXES, Image, is_whole, read_image, sensor_of_picture, write_png
from workbench.files.points_csv import GivenPoints, points_text, read_points
from workbench.files.result_file import SavedResult, SavedScp, read_result, saved_result
from workbench.files.robot_file import read_robot, robot_text, urdf_of
from workbench.files.sensor_file import read_emulator, read_sensor, sensor_text, stated_optics
from workbench.files.settings_file import (
    MeasureConfig,
    Recipe,
    Settings,
    Tolerance,
    ToleranceConfig,
    What,
    parse_settings,
    read_settings,
    settings_text,
    settings_toml,
)
from workbench.files.sockets_csv import read_sockets
from workbench.files.strict import FileSection, NotNegative, Positive, Real, Text, Whole, sentence, suggestion, validate
from workbench.files.table import Row, Table, read_table, read_table_text
from workbench.files.target_file import read_target, target_text
from workbench.files.toml_text import TomlSource, read_toml
from workbench.files.truth_file import Truth, TruthFrame, TruthPoint, read_truth, write_truth
from workbench.files.urdf import read_urdf, urdf_ends
from workbench.files.urdf_write import write_urdf

__all__ = [
    "CONTROLLERS",
    "LOSSY_SUFFIXES",
    "SUFFIXES",
    "Cell",
    "ControllerPoses",
    "FileFinding",
    "FileSection",
    "GivenPoints",
    "Image",
    "MeasureConfig",
    "NotNegative",
    "PosesSection",
    "Positive",
    "Real",
    "Recipe",
    "Row",
    "SavedResult",
    "SavedScp",
    "Settings",
    "Table",
    "Text",
    "Tolerance",
    "ToleranceConfig",
    "TomlSource",
    "Truth",
    "TruthFrame",
    "TruthPoint",
    "ViewFiles",
    "What",
    "Whole",
    "board_text",
    "cell_text",
    "controller_poses",
    "controller_text",
    "examine_cell",
    "find_views",
    "frames_text",
    "is_whole",
    "lay_onto",
    "parse_settings",
    "picture_sensor",
    "points_text",
    "read_board",
    "read_cell",
    "read_emulator",
    "read_frames",
    "read_image",
    "read_jig_file",
    "read_points",
    "read_result",
    "read_robot",
    "read_sensor",
    "read_settings",
    "read_sockets",
    "read_table",
    "read_table_text",
    "read_target",
    "read_toml",
    "read_truth",
    "read_urdf",
    "robot_text",
    "saved_result",
    "sensor_of_picture",
    "sensor_text",
    "sentence",
    "settings_text",
    "settings_toml",
    "sha256_of",
    "stated_optics",
    "suggestion",
    "target_text",
    "urdf_ends",
    "urdf_of",
    "validate",
    "write_bytes",
    "write_cell",
    "write_png",
    "write_text",
    "write_truth",
    "write_urdf",
]
