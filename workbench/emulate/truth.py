"""A cell to be recorded in emulation: what is drawn as true, which views are taken, from a cell.toml alone."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from geometry import Arm, Frame, InputError, NoAnswerError, Pose, Role, draw_errors, target_at
from jig_cad import sample_tolerance
from perceptron_emu import Surroundings
from workbench.cell import around_jig, jig_bodies, sees_all_strings, target_bodies
from workbench.emulate.looking import surface_views
from workbench.emulate.recording import Configuration, TrueCell, with_joint_noise
from workbench.files import Cell
from workbench.plan import ViewProblem, Views, plan_views, seen_whole

Array = NDArray[np.float64]

NOTHING = Surroundings()


@dataclass(frozen=True)
class Errors:
    """How far the emulated cell is from what its files say: σ of the sensor's mounting, and whether the rest is drawn.

    built: the robot's table and joints by [uncertainty], the jig's anchors by its tolerance.
    """

    mounting_deg: float = 1.0
    mounting_mm: float = 0.5
    built: bool = True


def draw_truth(cell: Cell, errors: Errors, rng: np.random.Generator, around: Surroundings = NOTHING) -> TrueCell:
    """The true cell of one draw.

    Parameters
    ----------
    cell
        What the files say, with T_base_jig of every place.
    errors
        How far the truth is from it.
    rng
        The same state gives the same cell.
    around
        What stands around the jig, as its own file says.

    Returns
    -------
    TrueCell
        Robot, jig and mounting off by their errors; the places are those of the file.

    Raises
    ------
    InputError
        Where no place is known.

    """
    if not cell.T_base_jig:
        raise InputError(
            f"{cell.folder / 'cell.toml'}: [locations.NAME] T_base_jig is missing: where does the jig stand?"
        )
    robot = built_arm(cell, errors, rng)
    jig = None if cell.has_surfaces else cell.jig
    if jig and errors.built and not jig.measured:
        jig = sample_tolerance(jig, rng)
    mounted = mounting(cell, errors, rng)
    # a jig's as drawn: the strings have room in the holes
    solids = {
        k: (*target_bodies(target_at(cell.target, k)), *around_jig(around, T)) for k, T in cell.T_base_jig.items()
    }
    carried = around.standing_in("sensor")
    return TrueCell(robot, jig, mounted, cell.T_base_jig, solids, carried, around.string_material, cell.mount)


def built_arm(cell: Cell, errors: Errors, rng: np.random.Generator) -> Arm:
    """The arm as built: its table off by [uncertainty]."""
    return cell.arm.corrected(draw_errors(cell.arm, rng)) if errors.built else cell.arm


def mounting(cell: Cell, errors: Errors, rng: np.random.Generator) -> Pose:
    """T_hand_sensor as mounted: the design off by the mounting's σ."""
    turn = np.deg2rad(errors.mounting_deg) * rng.standard_normal(3)
    shift = errors.mounting_mm * rng.standard_normal(3)
    return cell.design @ Pose.exp(np.concatenate([shift, turn]))


def planned_views(
    cell: Cell, per_location: int, rng: np.random.Generator, around: Surroundings = NOTHING
) -> list[tuple[str, Role, Array]]:
    """Views (location, role, joints) planned at every location, with what the files say.

    Of a jig the most telling ones, of a surface tilted, rolled and shifted at random.
    """
    if cell.has_surfaces:
        return surface_views(cell, per_location, rng)
    views = []
    for name, place in cell.T_base_jig.items():
        bodies = (*jig_bodies(cell.jig), *around_jig(around, place))
        sees_all = sees_all_strings(cell.sensor, cell.jig, bodies, around.standing_in("sensor"))
        problem = ViewProblem(
            cell.arm,
            cell.sensor,
            cell.jig,
            place,
            cell.design,
            sees_all=sees_all,
            workspace=cell.workspace,
            mount=cell.mount,
        )
        planned = _planned(problem, per_location, rng)
        views += [(name, cell.roles.get(name, "calibrate"), joints) for joints in planned.joints_rad]
    return views


def _planned(problem: ViewProblem, count: int, rng: np.random.Generator) -> Views:
    """The views; where there are too few because the sensor can not see the jig whole, the size that it would see."""
    try:
        return plan_views(problem, count, rng)
    except NoAnswerError as error:
        whole = seen_whole(problem.sensor, problem.jig, problem.limits)
        if whole.fits:
            raise
        raise NoAnswerError(whole.sentence(problem.sensor, problem.jig)) from error


def given_views(cell: Cell, rows: Sequence[Frame]) -> list[tuple[str, Role, Array]]:
    """Views of the rows of a frames.csv."""
    views = []
    for row in rows:
        if row.joints_rad is None:
            raise InputError(f"frames.csv, line {row.line}: images are made from joint readings, not from hand poses")
        if row.location not in cell.T_base_jig:
            raise InputError(f"frames.csv, line {row.line}: cell.toml has no [locations.{row.location}] T_base_jig")
        views.append((row.location, row.role, row.joints_rad))
    return views


def configurations(
    views: Sequence[tuple[str, Role, Array]], robot: Arm, errors: Errors, rng: np.random.Generator
) -> tuple[Configuration, ...]:
    """What is recorded: readings as the controller shows them, true angles off by the joints' σ."""
    drawn = with_joint_noise(views, robot, rng)
    if errors.built:
        return drawn
    return tuple(Configuration(c.frame, c.location, c.role, c.reading_rad, c.reading_rad) for c in drawn)
