"""Propose configurations."""

from __future__ import annotations

from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from rich.markup import escape
from rich.table import Table

from workbench.cli.console import progress_bar, say_on_stdout, standard_error, standard_output

if TYPE_CHECKING:
    from workbench.plan import Proposal


class Criterion(StrEnum):
    """What the plan makes small."""

    D = "D"
    E = "E"
    A = "A"


class PlanModel(StrEnum):
    """What will be estimated."""

    SCP = "scp"
    FULL = "full"


def command(
    cell: Annotated[Path, typer.Argument(metavar="CELL.toml", help="The cell, with its \\[locations]; frames count.")],
    per_location: Annotated[int, typer.Option(min=1, max=200, help="Configurations proposed at each location.")] = 7,
    criterion: Annotated[
        Criterion,
        typer.Option(help="D: small volume of the SCP's error ellipsoid; E: short longest axis; A: small rms error."),
    ] = Criterion.D,
    model: Annotated[PlanModel, typer.Option(help="What calibrate will estimate.")] = PlanModel.SCP,
    tilt_deg: Annotated[float, typer.Option(min=0, max=60, help="Largest tilt of a view.")] = 45.0,
    roll_deg: Annotated[float, typer.Option(min=0, max=180, help="Largest roll about the depth axis.")] = 180.0,
    mounting_deg: Annotated[float, typer.Option(min=0, max=10, help="How far off the mounting may be.")] = 3.0,
    seed: Annotated[int, typer.Option(min=0, help="Same seed, same plan.")] = 0,
    out: Annotated[Path | None, typer.Option(help="Write the plan as a frames.csv.")] = None,
    picture: Annotated[
        Path | None, typer.Option(help="Draw the arm at every configuration: a .png, .svg or .pdf.")
    ] = None,
    report: Annotated[Path | None, typer.Option(help="Write the plan as one HTML page.")] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON object on standard output.")] = False,
) -> None:
    r"""Propose the most telling next configurations, and predict the SCP's σ before anyone moves the robot.

    Frames that the cell has already count as taken; where they were recorded without T_base_jig, they are solved first.
    Locations with role "verify" get spread views to check with. Arm, hand and sensor keep off the jig, the floor and
    the boxes of \[workspace] in cell.toml.
    """
    from geometry import Surface, json_text
    from workbench.cell import located
    from workbench.files import frames_text, read_cell, write_text
    from workbench.plan import plan_limits, propose, propose_on_surface
    from workbench.report import save_plan_picture, write_plan_report

    limits = plan_limits(tilt_deg, roll_deg, mounting_deg)
    given = read_cell(cell, recorded=False)
    with progress_bar("extracting", max(1, len(given.frames))) as progress:
        given = located(given, progress)
    with progress_bar("planning", 1) as progress:
        if all(isinstance(t, Surface) for t in given.targets):
            proposal = propose_on_surface(given, per_location, criterion.value, model.value, limits, seed)
        else:
            proposal = propose(given, per_location, criterion.value, model.value, limits, seed, progress)
    if out is not None:
        write_text(out, frames_text(proposal.rows, decimals=4))
        standard_error().print(f"{out} written", markup=False)
    for path, write in ((picture, save_plan_picture), (report, write_plan_report)):
        if path is not None:
            write(path, given, proposal)
            standard_error().print(f"{path} written", markup=False)
    if as_json:
        say_on_stdout(json_text(proposal.as_object()))
    else:
        _show(proposal)


def _show(proposal: Proposal) -> None:
    from workbench.plan import RANDOM_PLANS

    console = standard_output()
    table = Table(title="proposed configurations", title_justify="left")
    n = len(proposal.joints_deg[0])
    for heading in ("frame", "location", "role", *(f"j{i + 1}" for i in range(n)), "tilt \\[°]", "roll \\[°]"):
        table.add_column(heading, justify="right")
    columns = (proposal.joints_deg, proposal.tilt_deg, proposal.roll_deg)
    for row, joints, *rest in zip(proposal.rows, *columns, strict=True):
        numbers = (*(f"{v:.2f}" for v in joints), *(f"{v:.0f}" for v in rest))
        table.add_row(str(row.number), escape(row.location), row.role, *numbers)
    console.print(table)
    sigma_t, sigma_r = proposal.sigma_mm, proposal.sigma_deg
    console.print(
        f"predicted σ of the SCP, hand axes: rotation {_three(sigma_r, 4)} °, translation {_three(sigma_t, 3)} mm"
    )
    console.print(
        f"{proposal.ratio_to_random:.2f} × the median of {RANDOM_PLANS} random plans within the same bounds "
        f"({proposal.ratio_of_noise:.2f} × without the robot's own errors)"
    )
    console.print("observability " + ", ".join(f"{k} {v:.4g}" for k, v in proposal.indices.items()))
    for warning in proposal.warnings:
        console.print(f"warning: {warning}", markup=False, soft_wrap=True)


def _three(values: tuple[float, ...], digits: int) -> str:
    return ", ".join(f"{v:.{digits}f}" for v in values)
