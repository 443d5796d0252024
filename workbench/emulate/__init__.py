"""Cells recorded in emulation: what is true of them, what is rendered, and the truth beside it."""

from workbench.emulate.check import all_hidden, check_views, never_met
from workbench.emulate.experiment import PAPER_DEVIATION_MM, paper_experiment
from workbench.emulate.extras import Extras
from workbench.emulate.recording import Configuration, TrueCell, frame_scene, record, with_joint_noise
from workbench.emulate.scene_frame import render_scene_file
from workbench.emulate.truth import NOTHING, Errors, configurations, draw_truth, given_views, planned_views

__all__ = [
    "NOTHING",
    "PAPER_DEVIATION_MM",
    "Configuration",
    "Errors",
    "Extras",
    "TrueCell",
    "all_hidden",
    "check_views",
    "configurations",
    "draw_truth",
    "frame_scene",
    "given_views",
    "never_met",
    "paper_experiment",
    "planned_views",
    "record",
    "render_scene_file",
    "with_joint_noise",
]
