"""Record a cell in emulation."""

from __future__ import annotations

from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from workbench.cli.console import progress_bar, standard_error

if TYPE_CHECKING:
    from workbench.emulate import Extras


class Renderer(StrEnum):
    """Who finds what is lit and seen."""

    OWN = "own"
    PYRENDER = "pyrender"


def command(
    out: Annotated[Path, typer.Option(help="Folder for the dataset; a broken-off recording there is resumed.")],
    cell: Annotated[
        Path | None,
        typer.Argument(
            metavar="CELL.toml", help="The cell to record, with its \\[locations]; or with --sensor a scene."
        ),
    ] = None,
    seed: Annotated[int, typer.Option(min=0, help="Same seed, same bytes.")] = 0,
    per_location: Annotated[int, typer.Option(min=1, max=1000, help="Views planned at each location.")] = 7,
    joints: Annotated[
        Path | None, typer.Option(help="A frames.csv of views to take; default: the cell's own, else planned ones.")
    ] = None,
    renderer: Annotated[Renderer, typer.Option(help="Our own ray casting, or OpenGL's depth buffers.")] = Renderer.OWN,
    exact: Annotated[bool, typer.Option("--exact", help="No errors of robot, joints, jig and mounting.")] = False,
    mounting_deg: Annotated[float, typer.Option(min=0, max=10, help="σ of the mounting's rotation.")] = 1.0,
    mounting_mm: Annotated[float, typer.Option(min=0, max=50, help="σ of the mounting's position.")] = 0.5,
    scene: Annotated[
        Path | None, typer.Option(help="A scene.toml: meshes and panels around the cell, by default in the base.")
    ] = None,
    sensor: Annotated[
        str | None, typer.Option(help="File or preset: render one image of the scene.toml given in place of a cell.")
    ] = None,
    full_truth: Annotated[bool, typer.Option("--full-truth", help="Pixel labels and the sheet's curve too.")] = False,
    ambient_frames: Annotated[
        bool, typer.Option("--ambient-frames", help="The same views with the laser off too, in images_off/.")
    ] = False,
    profiles: Annotated[
        str | None,
        typer.Option(metavar="FORMAT", help="Profiles in a maker's format in place of images: csv, gocator, ply …"),
    ] = None,
    board: Annotated[
        Path | None,
        typer.Option(help="board.toml: pairs of pictures of a board before --sensor, laser off and on."),
    ] = None,
    views: Annotated[int, typer.Option(min=1, max=1000, help="Pairs that --board makes.")] = 14,
    trial: Annotated[
        int | None, typer.Option(help="Remake this trial of a campaign; CELL.toml is its plan or the run's folder.")
    ] = None,
) -> None:
    r"""Record a cell in emulation: plan views or take given joints, render the images, write a dataset with truth.

    With --sensor, render one image of a scene.toml; with --board too, pairs of pictures for calibrate-sensor.

    The true robot, jig and mounting are drawn from \[uncertainty], tolerance_mm and the mounting's σ.
    """
    if board is not None:
        _boards(board, sensor, out, views, seed)
        return
    if cell is None:
        from geometry import InputError

        raise InputError("nothing to record: give a CELL.toml, or --board board.toml with --sensor")
    if trial is not None:
        from workbench.campaign import remake_trial

        count = remake_trial(cell, trial, out)
        standard_error().print(f"{out}: {count} images of trial {trial}", markup=False)
        return
    from workbench.emulate import Extras

    extras = Extras(full_truth, ambient_frames)
    if sensor is not None:
        _one_image(cell, sensor, scene, out, seed, renderer, extras)
        return
    errors = (0.0, 0.0, False) if exact else (mounting_deg, mounting_mm, True)
    if _gives_profiles(cell, profiles):
        _record_profiles(cell, out, seed, per_location, joints, errors, profiles or "auto")
        return
    _record(cell, out, seed, per_location, joints, renderer, errors, scene, extras)


def _boards(path: Path, sensor: str | None, out: Path, views: int, seed: int) -> None:
    from geometry import InputError
    from workbench.cell import find_emulator, find_sensor
    from workbench.emulate import record_boards
    from workbench.files import read_board

    if sensor is None:
        raise InputError("--board needs the sensor that looks at it: give --sensor FILE or a preset")
    with progress_bar("rendering", views) as progress:
        record_boards(out, find_sensor(sensor), find_emulator(sensor), read_board(path), views, seed, progress)
    standard_error().print(f"{out}: {views} pairs of pictures", markup=False)


def _one_image(
    path: Path, sensor: str, scene: Path | None, out: Path, seed: int, renderer: Renderer, extras: Extras
) -> None:
    from geometry import InputError
    from workbench.cell import find_emulator, find_sensor
    from workbench.emulate import render_scene_file

    if scene is not None:
        raise InputError("--scene places parts around a cell, --sensor renders the scene given in its place: drop one")
    image = render_scene_file(path, find_sensor(sensor), find_emulator(sensor), out, seed, renderer.value, extras)
    standard_error().print(f"{image}", markup=False, soft_wrap=True)


def _record(
    path: Path,
    out: Path,
    seed: int,
    per_location: int,
    joints: Path | None,
    renderer: Renderer,
    errors_of: tuple[float, float, bool],
    scene: Path | None,
    extras: Extras,
) -> None:
    import numpy as np

    from perceptron_emu import read_surroundings
    from workbench.emulate import (
        NOTHING,
        Errors,
        all_hidden,
        check_views,
        configurations,
        draw_truth,
        given_views,
        never_met,
        planned_views,
        record,
    )
    from workbench.files import read_cell, read_frames

    given = read_cell(path, recorded=False)
    around = read_surroundings(scene) if scene else NOTHING
    errors = Errors(*errors_of)
    rng = np.random.default_rng([seed, 2**31])
    true = draw_truth(given, errors, rng, around)
    rows = read_frames(joints, given.arm.n_joints) if joints else given.frames
    with progress_bar("planning", 1):
        views = given_views(given, rows) if rows else planned_views(given, per_location, rng, around)
    taken = configurations(views, true.robot, errors, rng)
    met = check_views(given, true, taken)
    with progress_bar("rendering", len(taken)) as progress:
        done = record(out, given, true, taken, seed, progress, renderer.value, extras)
    for remark in (never_met((s.name for _, s in around.parts), met), all_hidden(done.truth)):
        if remark:
            standard_error().print(remark, markup=False, soft_wrap=True)
    standard_error().print(f"{out}: {len(taken)} images at {len(given.T_base_jig)} locations", markup=False)


def _gives_profiles(path: Path, profiles: str | None) -> bool:
    """Whether profiles are asked for, or the cell's sensor gives nothing else."""
    from workbench.files import read_cell

    return profiles is not None or read_cell(path, recorded=False).sensor.profile is not None


def _record_profiles(
    path: Path,
    out: Path,
    seed: int,
    per_location: int,
    joints: Path | None,
    errors_of: tuple[float, float, bool],
    form: str,
) -> None:
    import numpy as np

    from geometry import InputError
    from workbench.emulate import (
        Errors,
        built_arm,
        configurations,
        given_views,
        mounting,
        planned_views,
        record_profiles,
    )
    from workbench.files import read_cell, read_frames

    given = read_cell(path, recorded=False)
    if not given.T_base_jig:
        raise InputError(f"{path}: [locations.NAME] T_base_jig is missing: where does the target stand?")
    errors = Errors(*errors_of)
    rng = np.random.default_rng([seed, 2**31])
    arm, T_hand_sensor = built_arm(given, errors, rng), mounting(given, errors, rng)
    rows = read_frames(joints, given.arm.n_joints) if joints else given.frames
    with progress_bar("planning", 1):
        views = given_views(given, rows) if rows else planned_views(given, per_location, rng)
    taken = configurations(views, arm, errors, rng)
    with progress_bar("measuring", len(taken)) as progress:
        record_profiles(out, given, arm, T_hand_sensor, taken, form, seed, errors.built, progress)
    standard_error().print(f"{out}: {len(taken)} profiles at {len(given.T_base_jig)} locations", markup=False)
