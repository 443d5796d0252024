"""The experiment of the paper's section 5 as an emulated cell: what is true, and what the user knows of it."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from calib.synthetic import TRUTH
from geometry import Role, draw_errors
from jig_cad import Jig, sample_tolerance
from perceptron_emu import Solid
from workbench import defaults
from workbench.cell import (
    DESIGN_SCP,
    PLACES,
    find_emulator,
    find_jig,
    find_robot,
    find_sensor,
    jig_bodies,
    place_of_jig,
    sees_all_strings,
    wall_behind,
)
from workbench.emulate.recording import Configuration, TrueCell, with_joint_noise
from workbench.files import Cell
from workbench.plan import ViewProblem, plan_views

# Fig. 7: maximum deviation of the base distance [mm]
PAPER_DEVIATION_MM = {"design": 5.0, "solved": 1.4}

PER_LOCATION = 7  # as in the paper
WITH_WALL = ("B", "D")  # places with a wall behind the jig


@dataclass(frozen=True, eq=False)
class Experiment:
    """What is recorded, from what."""

    cell: Cell
    true: TrueCell
    configurations: tuple[Configuration, ...]


def paper_experiment(seed: int) -> Experiment:
    """The whole experiment of one seed: an arm with errors, a jig with tolerance, planned views at four places."""
    rng = np.random.default_rng([seed, 2**31])
    robot, sensor, jig = find_robot(defaults.ROBOT), find_sensor(defaults.SENSOR), find_jig(defaults.JIG)
    places = {name: place_of_jig(*place[1:]) for name, place in PLACES.items()}
    true_jig = sample_tolerance(jig, rng)
    solids = {name: (*jig_bodies(true_jig), *_wall(true_jig, name)) for name in PLACES}
    true = TrueCell(
        robot=robot.corrected(draw_errors(robot, rng)),
        jig=true_jig,
        T_hand_sensor=TRUTH,
        T_base_jig=places,
        solids=solids,
    )
    views: list[tuple[str, Role, NDArray[np.float64]]] = []
    for name, place in PLACES.items():
        # planned with what the user knows: the design SCP is a little wrong, the views' margins hold for the true one
        sees_all = sees_all_strings(sensor, jig, solids[name])
        problem = ViewProblem(robot, sensor, jig, places[name], DESIGN_SCP, sees_all=sees_all)
        planned = plan_views(problem, PER_LOCATION, rng)
        views += [(name, place[0], joints) for joints in planned.joints_rad]
    cell = Cell(
        folder=Path(),
        sensor=sensor,
        target=jig,
        robot=robot,
        frames=(),
        T_hand_sensor_design=DESIGN_SCP,
        name=f"the paper's experiment in emulation, seed {seed}",
        emulator=find_emulator(defaults.SENSOR),
    )
    return Experiment(cell, true, with_joint_noise(views, true.robot, rng))


def _wall(jig: Jig, place: str) -> tuple[Solid, ...]:
    return (wall_behind(jig, 160.0, turn_deg=8.0),) if place in WITH_WALL else ()
