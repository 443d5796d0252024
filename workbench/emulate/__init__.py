"""Cells recorded in emulation: what is true of them, what is rendered, and the truth beside it."""

from workbench.emulate.board import BoardRecording, board_solids, planned_boards, record_boards
from workbench.emulate.check import all_hidden, check_views, never_met
from workbench.emulate.experiment import PAPER_DEVIATION_MM, paper_experiment
from workbench.emulate.extras import Extras
from workbench.emulate.looking import surface_views
from workbench.emulate.profile_recording import record_profiles
from workbench.emulate.recording import Configuration, TrueCell, frame_scene, record, with_joint_noise
from workbench.emulate.scene_frame import render_scene_file
from workbench.emulate.truth import (
    NOTHING,
    Errors,
    built_arm,
    configurations,
    draw_truth,
    given_views,
    mounting,
    planned_views,
)

__all__ = [
    "NOTHING",
    "PAPER_DEVIATION_MM",
    "BoardRecording",
    "Configuration",
    "Errors",
    "Extras",
    "TrueCell",
    "all_hidden",
    "board_solids",
    "built_arm",
    "check_views",
    "configurations",
    "draw_truth",
    "frame_scene",
    "given_views",
    "mounting",
    "never_met",
    "paper_experiment",
    "planned_boards",
    "planned_views",
    "record",
    "record_boards",
    "record_profiles",
    "render_scene_file",
    "surface_views",
    "with_joint_noise",
]
