"""Results for people and programs: JSON, tables in the terminal, pictures."""

from typing import TYPE_CHECKING

from geometry.lazy import lazy_names

if TYPE_CHECKING:
    from workbench.report.as_json import calibration_object, inputs_of
    from workbench.report.as_text import AXES, arrow, number, print_calibration, print_verdict
    from workbench.report.calibration import ReportInput, report_page, scp_rows, write_report
    from workbench.report.cell_picture import cell_image
    from workbench.report.comparison import Difference, difference, difference_object, print_difference
    from workbench.report.fig7 import draw_fig7
    from workbench.report.folder import write_results
    from workbench.report.gapflush_picture import draw_gap_flush
    from workbench.report.overlays import overlay, save_overlays
    from workbench.report.page import Origin, jpeg, new_figure, origin_of, png, render_page, svg
    from workbench.report.plan_picture import draw_plan, save_plan_picture, write_plan_report
    from workbench.report.rounds import print_round, round_object
    from workbench.report.scene import scene_object, scene_script
    from workbench.report.stage_pictures import save_stages

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

# pictures, pages, the emulator's kernels and the planner: an answer in words needs none of them
__getattr__ = lazy_names(
    __name__,
    {
        "workbench.report.as_json": (
            "calibration_object",
            "inputs_of",
        ),
        "workbench.report.as_text": (
            "AXES",
            "arrow",
            "number",
            "print_calibration",
            "print_verdict",
        ),
        "workbench.report.calibration": (
            "ReportInput",
            "report_page",
            "scp_rows",
            "write_report",
        ),
        "workbench.report.comparison": (
            "Difference",
            "difference",
            "difference_object",
            "print_difference",
        ),
        "workbench.report.fig7": ("draw_fig7",),
        "workbench.report.folder": ("write_results",),
        "workbench.report.gapflush_picture": ("draw_gap_flush",),
        "workbench.report.overlays": (
            "overlay",
            "save_overlays",
        ),
        "workbench.report.page": (
            "Origin",
            "jpeg",
            "new_figure",
            "origin_of",
            "png",
            "render_page",
            "svg",
        ),
        "workbench.report.scene": (
            "scene_object",
            "scene_script",
        ),
        "workbench.report.stage_pictures": ("save_stages",),
        "workbench.report.cell_picture": ("cell_image",),
        "workbench.report.plan_picture": (
            "draw_plan",
            "save_plan_picture",
            "write_plan_report",
        ),
        "workbench.report.rounds": (
            "print_round",
            "round_object",
        ),
    },
)
