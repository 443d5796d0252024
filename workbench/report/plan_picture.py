"""What a plan proposes, drawn: the arm at every configuration from the side and from above, with floor and boxes."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import shapely
from numpy.typing import NDArray

from geometry import InputError, Pose, Target, box_corners, target_at
from geometry.sensor import housing_box
from jig_cad import Jig
from workbench.files import Cell, write_bytes, write_text
from workbench.plan import HAND_MM, RANDOM_PLANS, SAFE_MM, Proposal, Standing, carrying, standing, target_boxes
from workbench.report.page import origin_of, picture_bytes, render_page, svg

if TYPE_CHECKING:
    from matplotlib.figure import Figure

Array = NDArray[np.float64]

KINDS = ("png", "svg", "pdf")
ARM, HOUSING, TARGET, KEEP_OUT = "#d9822b", "#2a4b7c", "#222222", "#b3261e"
SHEET = "#d11141"
PANEL_IN = (6.2, 4.4)


def draw_plan(cell: Cell, proposal: Proposal) -> Figure:
    """A row for each location: seen level, along the target's side, and from above; all configurations in one.

    Thickness is what planning takes the arm's links, the hand and the housing to be.
    """
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure  # a third of a second, and most commands draw nothing

    names = list(dict.fromkeys(row.location for row in proposal.rows))
    figure = Figure(figsize=(2 * PANEL_IN[0], PANEL_IN[1] * len(names)), layout="constrained")
    FigureCanvasAgg(figure)
    axes = figure.subplots(len(names), 2, squeeze=False)
    for row, name in zip(axes, names, strict=True):
        mine = np.array([r.location == name for r in proposal.rows])
        joints, radius = np.deg2rad(proposal.joints_deg[mine]), cell.workspace.link_radius_mm
        place, target = cell.T_base_jig[name], target_at(cell.target, name)
        fixed = cell.mount == "fixed"
        if fixed:
            arm, still = carrying(cell.arm, joints, place, target, radius), cell.design
        else:
            arm, still = standing(cell.arm, joints, cell.design, cell.sensor, radius), place
        bearing = float(np.arctan2(still.t[1], still.t[0]))
        outwards = np.array([np.cos(bearing), np.sin(bearing), 0.0])
        numbers = [r.number for r in proposal.rows if r.location == name]
        _panel(row[0], cell, target, arm, still, np.stack([outwards, [0, 0, 1.0]]), numbers)
        what, title = "sensor" if fixed else "target", f"{name} from the side: {len(numbers)} frames"
        row[0].set(xlabel=f"towards the {what} / mm", ylabel="z / mm", title=title)
        _panel(row[1], cell, target, arm, still, np.array([[1.0, 0, 0], [0, 1.0, 0]]), numbers)
        row[1].set(xlabel="x / mm", ylabel="y / mm", title=f"{name} from above")
    return figure


def save_plan_picture(path: Path, cell: Cell, proposal: Proposal) -> None:
    """The picture as PNG, SVG or PDF, by the file's ending."""
    kind = path.suffix.lower().lstrip(".")
    if kind not in KINDS:
        raise InputError(f'{path}: unknown ending "{path.suffix}"; a picture is written as .{", .".join(KINDS)}')
    write_bytes(path, picture_bytes(draw_plan(cell, proposal), kind, dpi=90))


def write_plan_report(path: Path, cell: Cell, proposal: Proposal) -> None:
    """One HTML page: what is proposed, what it predicts, the room that every configuration and move leaves."""
    frames = proposal.as_object()["frames"]
    content = {
        "title": cell.name or cell.folder.resolve().name,
        "proposal": proposal,
        "frames": frames,
        "joints": [f"j{k + 1}" for k in range(proposal.joints_deg.shape[1])],
        "random_plans": RANDOM_PLANS,
        "picture": svg(draw_plan(cell, proposal)),
        "workspace": cell.workspace,
        "boxes": zip(cell.workspace.names, cell.workspace.boxes_mm.tolist(), strict=True),
        "safe_mm": SAFE_MM,
    }
    write_text(path, render_page("workbench.report", "plan.html.j2", content, origin_of(cell.files, cell.folder)))


def _panel(
    axis: Any, cell: Cell, target: Target, arm: Standing, still: Pose, across: Array, numbers: list[int]
) -> None:
    """One view; ``across`` (2, 3) are the paper's axes in the base, ``still`` where what stands still is: the target,
    or a fixed sensor.
    """
    _workspace(axis, cell, across)
    for joints, hand in zip(arm.joints_mm @ across.T, arm.hand_mm @ across.T, strict=True):
        _filled(axis, shapely.LineString(joints).buffer(arm.link_mm), ARM, 0.12)
        _filled(axis, shapely.LineString(hand).buffer(HAND_MM), ARM, 0.12)
        axis.plot(*joints.T, color=ARM, linewidth=0.8)
    fixed = cell.mount == "fixed"
    standing_boxes = [housing_box(cell.sensor)] if fixed else list(target_boxes(target))
    for b in standing_boxes:
        hull = shapely.MultiPoint((still @ box_corners(b)) @ across.T).convex_hull
        _filled(axis, hull, HOUSING if fixed else TARGET, 0.5)
    corners = (arm.T_base_sensor @ box_corners(arm.housing_mm)[None]) @ across.T
    emitter = cell.sensor.sheet.origin_mm
    middle = target.anchors_mm.mean(axis=0) if isinstance(target, Jig) else target_boxes(target).mean(axis=(0, 1))
    moving, there = (middle, emitter) if fixed else (emitter, middle)
    for number, box, end in zip(numbers, corners, arm.T_base_sensor @ moving, strict=True):
        _filled(axis, shapely.MultiPoint(box).convex_hull, TARGET if fixed else HOUSING, 0.45)
        axis.plot(*np.stack([end, still @ there]).dot(across.T).T, color=SHEET, linewidth=0.4, alpha=0.6)
        axis.annotate(str(number), box.mean(axis=0), fontsize=7, ha="center", va="center", color="white")
    axis.set_aspect("equal", adjustable="datalim")


def _workspace(axis: Any, cell: Cell, across: Array) -> None:
    floor = cell.workspace.floor_z_mm
    if floor is not None and across[1, 2] == 1.0:
        axis.axhspan(floor - 60, floor, color=KEEP_OUT, alpha=0.2, linewidth=0)
        axis.axhline(floor, color=KEEP_OUT, linewidth=1)
    for name, box in zip(cell.workspace.names, cell.workspace.boxes_mm, strict=True):
        hull = shapely.MultiPoint(box_corners(box) @ across.T).convex_hull
        _filled(axis, hull, KEEP_OUT, 0.2)
        axis.annotate(name, np.array(hull.centroid.coords)[0], fontsize=8, ha="center", color=KEEP_OUT)


def _filled(axis: Any, shape: Any, colour: str, alpha: float) -> None:
    if shape.geom_type == "Polygon":
        axis.fill(*np.asarray(shape.exterior.coords).T, color=colour, alpha=alpha, linewidth=0)
