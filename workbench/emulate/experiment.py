"""The experiment of the paper's section 5 as an emulated cell: what is true, and what the user knows of it."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

import assets
from geometry import Pose, RobotModel, Sensor
from jig_cad import Jig, sample_tolerance
from perceptron_emu import EmulatorConfig, Solid
from workbench.cell.starter import PLACES, place_of_jig
from workbench.cell.surroundings import jig_bodies, sees_all_strings, wall_behind
from workbench.emulate.record import Configuration, TrueCell, with_joint_noise
from workbench.emulate.truth import with_errors
from workbench.files import Cell, read_emulator, read_jig_file, read_robot, read_sensor
from workbench.plan.views import ViewProblem, plan_views

# Table 1 of the paper
DESIGN = ((0.0, 0.0, 20.0), (-17.0, -76.0, 117.0))
CALIBRATED = ((-1.5241, 1.5871, 22.5287), (-16.8786, -75.5423, 116.5369))
# Fig. 7: maximum deviation of the base distance [mm]
PAPER_DEVIATION_MM = {"design": 5.0, "solved": 1.4}

PER_LOCATION = 7
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
    robot, sensor, jig = demo_robot(), demo_sensor(), read_jig_file(assets.path("jigs", "paper"))
    design = Pose.from_fixed_xyz_deg(*DESIGN)
    places = {name: place_of_jig(*place[1:]) for name, place in PLACES.items()}
    true_jig = sample_tolerance(jig, rng)
    solids = {name: (*jig_bodies(true_jig), *_wall(true_jig, name)) for name in PLACES}
    true = TrueCell(
        robot=with_errors(robot, rng),
        jig=true_jig,
        T_hand_sensor=Pose.from_fixed_xyz_deg(*CALIBRATED),
        T_base_jig=places,
        solids=solids,
    )
    views = []
    for name, place in PLACES.items():
        # planned with what the user knows: the design SCP is a little wrong, the views' margins hold for the true one
        sees_all = sees_all_strings(sensor, jig, solids[name])
        problem = ViewProblem(robot, sensor, jig, places[name], design, sees_all=sees_all)
        planned = plan_views(problem, PER_LOCATION, rng)
        views += [(name, place[0], joints) for joints in planned.joints_rad]
    cell = Cell(
        folder=Path(),
        sensor=sensor,
        jig=jig,
        robot=robot,
        frames=(),
        T_hand_sensor_design=design,
        name=f"the paper's experiment in emulation, seed {seed}",
        emulator=demo_emulator(),
    )
    return Experiment(cell, true, with_joint_noise(views, true.robot, rng))


def demo_robot() -> RobotModel:
    """A six-axis arm of 2.55 m reach, whose table ships with the package."""
    return read_robot(assets.path("robots", "abb_irb6640_180_255"))


def demo_sensor() -> Sensor:
    """The nominal laser-line sensor that ships with the package."""
    return read_sensor(assets.path("sensors", "nominal"))


def demo_emulator() -> EmulatorConfig:
    """How that sensor is emulated."""
    return read_emulator(assets.path("sensors", "nominal"))


def _wall(jig: Jig, place: str) -> tuple[Solid, ...]:
    return (wall_behind(jig, 160.0, turn_deg=8.0),) if place in WITH_WALL else ()
