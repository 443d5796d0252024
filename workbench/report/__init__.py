"""Results for people and programs: JSON, tables in the terminal, pictures."""

from importlib import import_module
from typing import TYPE_CHECKING

from workbench.report.as_json import calibration_object, inputs_of
from workbench.report.as_text import AXES, arrow, number, print_calibration, print_verdict
from workbench.report.calibration import ReportInput, report_page, scp_rows, write_report
from workbench.report.comparison import Difference, difference, difference_object, print_difference
from workbench.report.fig7 import draw_fig7
from workbench.report.folder import write_results
from workbench.report.gapflush_picture import draw_gap_flush
from workbench.report.overlays import overlay, save_overlays
from workbench.report.page import Origin, jpeg, new_figure, origin_of, png, render_page, svg
from workbench.report.scene import scene_object, scene_script
from workbench.report.stage_pictures import save_stages

if TYPE_CHECKING:
    from workbench.report.cell_picture import cell_image
    from workbench.report.plan_picture import draw_plan, save_plan_picture, write_plan_report
    from workbench.report.rounds import print_round, round_object

__all__ = [
    "AXES",
    "Difference",
    "Origin",
    "ReportInput",
    "arrow",
    "calibration_object",
    "cell_image",
    "difference",
    "difference_object",
    "draw_fig7",
    "draw_gap_flush",
    "draw_plan",
    "frame_object",
    "inputs_of",
    "jpeg",
    "new_figure",
    "number",
    "origin_of",
    "overlay",
    "png",
    "print_calibration",
    "print_difference",
    "print_round",
    "print_verdict",
    "render_page",
    "report_page",
    "round_object",
    "save_overlays",
    "save_plan_picture",
    "save_stages",
    "scene_object",
    "scene_script",
    "scp_rows",
    "svg",
    "write_plan_report",
    "write_report",
    "write_results",
]

# they load the emulator's kernels and the planner, and an answer without pictures needs neither
_LAZY = {
    "cell_image": "workbench.report.cell_picture",
    "draw_plan": "workbench.report.plan_picture",
    "print_round": "workbench.report.rounds",
    "round_object": "workbench.report.rounds",
    "save_plan_picture": "workbench.report.plan_picture",
    "write_plan_report": "workbench.report.plan_picture",
}


def __getattr__(name: str) -> object:
    """The names that need emulator or planner, imported when first used."""
    if name in _LAZY:
        return getattr(import_module(_LAZY[name]), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
