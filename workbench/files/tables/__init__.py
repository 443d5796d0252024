"""Tables of a dataset: CSV files as people have them, rows by column names, poses in a controller's numbers."""

from workbench.files.tables.anchors_csv import lay_onto
from workbench.files.tables.controller import CONTROLLERS, controller_text
from workbench.files.tables.evidence_csv import EvidenceSection, read_evidence
from workbench.files.tables.frames_csv import LONGEST_NAME, frames_text, names_profiles, read_frames
from workbench.files.tables.points_csv import GivenPoints, points_text, read_points
from workbench.files.tables.poses_section import ControllerPoses, PosesSection, controller_poses
from workbench.files.tables.sockets_csv import read_sockets
from workbench.files.tables.table import Row, Table, read_table, read_table_text

__all__ = [
    "CONTROLLERS",
    "LONGEST_NAME",
    "ControllerPoses",
    "EvidenceSection",
    "GivenPoints",
    "PosesSection",
    "Row",
    "Table",
    "controller_poses",
    "controller_text",
    "frames_text",
    "lay_onto",
    "names_profiles",
    "points_text",
    "read_evidence",
    "read_frames",
    "read_points",
    "read_sockets",
    "read_table",
    "read_table_text",
]
