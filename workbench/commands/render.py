"""Record a cell in emulation."""

from __future__ import annotations

from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer

from workbench.console import progress_bar, standard_error


class Renderer(StrEnum):
    """Who finds what is lit and seen."""

    OWN = "own"
    PYRENDER = "pyrender"


def command(
    cell: Annotated[Path, typer.Argument(metavar="CELL.toml", help="The cell to record, with its \\[locations].")],
    out: Annotated[Path, typer.Option(help="Folder for the dataset; a broken-off recording there is resumed.")],
    seed: Annotated[int, typer.Option(min=0, help="Same seed, same bytes.")] = 0,
    per_location: Annotated[int, typer.Option(min=1, max=1000, help="Views planned at each location.")] = 7,
    joints: Annotated[
        Path | None, typer.Option(help="A frames.csv of views to take; default: the cell's own, else planned ones.")
    ] = None,
    renderer: Annotated[Renderer, typer.Option(help="Our own ray casting, or OpenGL's depth buffers.")] = Renderer.OWN,
    exact: Annotated[bool, typer.Option("--exact", help="No errors of robot, joints, jig and mounting.")] = False,
    mounting_deg: Annotated[float, typer.Option(min=0, max=10, help="σ of the mounting's rotation.")] = 1.0,
    mounting_mm: Annotated[float, typer.Option(min=0, max=50, help="σ of the mounting's position.")] = 0.5,
    trial: Annotated[
        int | None, typer.Option(help="Remake this trial of a campaign; CELL.toml is its plan or the run's folder.")
    ] = None,
) -> None:
    r"""Record a cell in emulation: plan views or take given joints, render the images, write a dataset with truth.

    The true robot, jig and mounting are drawn from \[uncertainty], tolerance_mm and the mounting's σ.
    """
    if trial is not None:
        from workbench.campaign.remake import remake_trial

        count = remake_trial(cell, trial, out)
        standard_error().print(f"{out}: {count} images of trial {trial}", markup=False)
        return
    import numpy as np

    from workbench.emulated_cell import Errors, configurations, draw_truth, given_views, planned_views
    from workbench.formats import read_cell, read_frames
    from workbench.recording import record

    given = read_cell(cell, recorded=False)
    errors = Errors(0.0, 0.0, built=False) if exact else Errors(mounting_deg, mounting_mm)
    rng = np.random.default_rng([seed, 2**31])
    true = draw_truth(given, errors, rng)
    rows = read_frames(joints, given.robot.n_joints) if joints else given.frames
    with progress_bar("planning", 1):
        views = given_views(given, rows) if rows else planned_views(given, per_location, rng)
    taken = configurations(views, true, errors, rng)
    with progress_bar("rendering", len(taken)) as progress:
        record(out, given, true, taken, seed, progress, renderer.value)
    standard_error().print(f"{out}: {len(taken)} images at {len(given.T_base_jig)} locations", markup=False)
