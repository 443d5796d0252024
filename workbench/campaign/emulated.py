"""An emulated cell of a trial's settings: what is known of it, what is true, and where the robot goes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from geometry import NoAnswerError, Pose, RobotModel, RobotUncertainty
from jig_cad import DEFAULT_STRINGS, STRINGS, Jig, sample_tolerance
from perceptron_emu import EmulatorConfig, Solid
from workbench.campaign.settings import JigPart, PosesPart, RobotPart, SensorPart, TrialSettings
from workbench.demo.experiment import DESIGN
from workbench.emulated_cell import with_errors
from workbench.formats import Cell, Sensor
from workbench.planning import ViewLimits, ViewProblem, Views, plan_views
from workbench.presets import find_robot, find_sensor
from workbench.recording import Configuration, TrueCell, with_joint_noise
from workbench.surroundings import jig_bodies, sees_all_strings, wall_behind

Array = NDArray[np.float64]

VERIFY = "verify"
_UPRIGHT = np.array([[0.0, 0.0, 1.0], [0.0, -1.0, 0.0], [1.0, 0.0, 0.0]])  # pillar up, its back away from the robot
_PLACE_TRIES = 12


@dataclass(frozen=True, eq=False)
class EmulatedCell:
    """One trial's cell: ``cell`` is what a user knows, ``true`` what is behind it."""

    cell: Cell
    true: TrueCell
    configurations: tuple[Configuration, ...]


def emulated_cell(settings: TrialSettings, rng: np.random.Generator) -> EmulatedCell:
    """Draw a cell: arm and jig with errors, a mounting off its design, configurations of one of the shared plans."""
    robot, sensor, jig = nominal_robot(settings.robot), nominal_sensor(settings), nominal_jig(settings.jig)
    plan = int(rng.integers(settings.poses.plans))
    places = planned(settings.jig, settings.robot, settings.sensor, settings.poses, settings.clutter, plan)
    true_jig = sample_tolerance(jig, rng)
    design = Pose.from_fixed_xyz_deg(*DESIGN)
    solids = surroundings(true_jig, clutter=settings.clutter)
    true = TrueCell(
        robot=with_errors(robot, rng),
        jig=true_jig,
        T_hand_sensor=mounted(design, settings.sensor, rng),
        T_base_jig={p.location: p.T_base_jig for p in places},
        solids={p.location: solids for p in places},
    )
    views = [(p.location, p.role, joints) for p in places for joints in p.views.joints_rad]
    cell = Cell(Path(), sensor, jig, robot, (), design)
    return EmulatedCell(cell, true, with_joint_noise(views, true.robot, rng))


@dataclass(frozen=True, eq=False)
class Place:
    """One location of the jig with its planned views."""

    location: str
    role: str
    T_base_jig: Pose
    views: Views


@lru_cache(maxsize=64)
def planned(
    jig_part: JigPart, robot_part: RobotPart, sensor_part: SensorPart, poses: PosesPart, clutter: bool, plan: int
) -> tuple[Place, ...]:
    """The places and views of plan number ``plan``: a function of its arguments alone, shared by trials and workers."""
    geometry_only = TrialSettings(jig=jig_part, robot=robot_part, sensor=sensor_part)
    jig, robot, sensor = nominal_jig(jig_part), nominal_robot(robot_part), nominal_sensor(geometry_only)
    rng = np.random.default_rng(np.random.SeedSequence(plan, spawn_key=(77,)))
    sees_all = sees_all_strings(sensor.model, jig, surroundings(jig, clutter=clutter))
    limits = ViewLimits(tilt_deg=poses.tilt_max_deg, roll_deg=poses.roll_max_deg)
    design = Pose.from_fixed_xyz_deg(*DESIGN)
    problem = ViewProblem(robot, sensor.model, jig, Pose.identity(), design, limits, sees_all)
    wanted = [(_name(i), "calibrate", poses.per_location) for i in range(poses.locations)]
    wanted += [(VERIFY, "verify", poses.verify)] if poses.verify else []
    out = []
    for name, role, count in wanted:
        T_base_jig, views = _place(problem, count, rng)
        out.append(Place(name, role, T_base_jig, views))
    return tuple(out)


def _place(problem: ViewProblem, count: int, rng: np.random.Generator) -> tuple[Pose, Views]:
    """A place in front of the arm where enough views can be had."""
    error: NoAnswerError | None = None
    for _ in range(_PLACE_TRIES):
        here = replace(problem, T_base_jig=_random_place(problem.robot, rng))
        try:
            return here.T_base_jig, _upright_first(plan_views(here, count, rng))
        except NoAnswerError as caught:
            error = caught
    raise NoAnswerError(f"no place of the jig with {count} configurations was found in {_PLACE_TRIES} tries: {error}")


def _upright_first(views: Views) -> Views:
    """The views with one first that shows the jig upright: it decides between the two poses of the half turn."""
    first = int(np.argmax(views.T_sensor_jig.R[:, 0, 0]))
    order = np.r_[first, np.delete(np.arange(len(views.joints_rad)), first)]
    return Views(views.joints_rad[order], views.T_sensor_jig[order])


def _random_place(robot: RobotModel, rng: np.random.Generator) -> Pose:
    """The jig upright before the arm: bearing ± 35°, 0.6 to 0.75 of the reach away, 0.25 to 0.4 of it high."""
    reach = float(np.sum(np.hypot(robot.a, robot.d)[1:]))
    bearing = np.deg2rad(rng.uniform(-35, 35))
    radius, height = reach * rng.uniform(0.6, 0.75), reach * rng.uniform(0.25, 0.4)
    turn = Pose.from_fixed_xyz_deg((0.0, 0.0, np.rad2deg(bearing) + rng.uniform(-8, 8)), (0.0, 0.0, 0.0))
    origin = np.array([radius * np.cos(bearing), radius * np.sin(bearing), height])
    return Pose(turn.R @ _UPRIGHT, origin)


def nominal_jig(part: JigPart) -> Jig:
    """The jig of the drawing."""
    strings: Sequence[str] = tuple(STRINGS) if part.six_strings else DEFAULT_STRINGS
    return Jig.nominal(part.side_mm, part.height_mm, part.string_diameter_mm, part.tolerance_mm, tuple(strings))


def nominal_robot(part: RobotPart) -> RobotModel:
    """The preset's table with the uncertainty that the settings give."""
    uncertainty = RobotUncertainty(
        joint_sigma_rad=float(np.deg2rad(part.joint_sigma_deg)),
        theta_sigma_rad=float(np.deg2rad(part.theta_sigma_deg)),
        d_sigma_mm=part.d_sigma_mm,
        a_sigma_mm=part.a_sigma_mm,
        alpha_sigma_rad=float(np.deg2rad(part.alpha_sigma_deg)),
    )
    return replace(_robot_preset(part.preset), uncertainty=uncertainty)


def nominal_sensor(settings: TrialSettings) -> Sensor:
    """The preset's sensor; emulator settings that the plan gives stand over the preset's."""
    found = _sensor_preset(settings.sensor.preset)
    own = found.emulator.model_dump()
    for table, values in settings.emulator.model_dump(exclude_unset=True).items():
        own[table].update(values)
    return replace(found, emulator=EmulatorConfig.model_validate(own))


def mounted(design: Pose, part: SensorPart, rng: np.random.Generator) -> Pose:
    """The true mounting: the design's, off by the settings' σ in every axis."""
    sigma = np.repeat([part.mount_error_mm, np.deg2rad(part.mount_error_deg)], 3)
    return design @ Pose.exp(sigma * rng.standard_normal(6))


def surroundings(jig: Jig, *, clutter: bool) -> tuple[Solid, ...]:
    """Plates, and with clutter the posts and a wall as well, in jig axes."""
    bodies = jig_bodies(jig)
    return (*bodies, wall_behind(jig, 160.0, turn_deg=8.0)) if clutter else bodies


@lru_cache(maxsize=16)
def _robot_preset(name: str) -> RobotModel:
    return find_robot(name)


@lru_cache(maxsize=16)
def _sensor_preset(name: str) -> Sensor:
    return find_sensor(name)


def _name(index: int) -> str:
    """A, B, … Z, A1, B1, …"""
    letter = chr(ord("A") + index % 26)
    return letter if index < 26 else f"{letter}{index // 26}"
