"""An emulated cell of a trial's settings: what is known of it, what is true, and where the robot goes."""

from __future__ import annotations

import json
import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from geometry import TYPICAL_SIGMA, Arm, DhRobot, NoAnswerError, Pose, RobotUncertainty, Role, Sensor
from geometry.ties import first_most
from jig_cad import DEFAULT_STRINGS, STRINGS, Jig
from perceptron_emu import EmulatorConfig, Surroundings
from workbench.campaign.asked.settings import JigPart, PosesPart, RobotPart, TrialSettings
from workbench.cell import DESIGN_SCP, find_emulator, find_robot, find_sensor, jig_bodies, sees_all_strings, wall_behind
from workbench.emulate import NOTHING, Configuration, Errors, TrueCell, draw_truth, with_joint_noise
from workbench.files import Cell, stated_optics
from workbench.plan import ViewLimits, ViewProblem, Views, plan_views

Array = NDArray[np.float64]

VERIFY = "verify"
_UPRIGHT = np.array([[0.0, 0.0, 1.0], [0.0, -1.0, 0.0], [1.0, 0.0, 0.0]])  # pillar up, its back away from the robot
_PLACE_TRIES = 12  # places drawn until one gives enough views; most arms reach the first or second
PLANNED_DIAMETER_MM = 0.3  # the usual thread: see planned_diameter_mm
SAME_COSINE = 1e-6  # views that are equally upright: the first is taken
_SHARED = 4096  # plans of configurations that a worker remembers, a few kilobytes each


@dataclass(frozen=True, eq=False)
class EmulatedCell:
    """One trial's cell: ``cell`` is what a user knows, ``true`` what is behind it."""

    cell: Cell
    true: TrueCell
    configurations: tuple[Configuration, ...]


def emulated_cell(settings: TrialSettings, rng: np.random.Generator, *, one_view: bool = False) -> EmulatedCell:
    """Draw a cell: arm and jig with errors, a mounting off its design, configurations of one of the shared plans.

    one_view: a single configuration, drawn from those of the plan.
    """
    places = shared_plan(settings, int(rng.integers(settings.poses.plans)))
    jig, robot, sensor = nominal_jig(settings.jig), nominal_robot(settings.robot), nominal_sensor(settings)
    where = {p.location: p.T_base_jig for p in places}
    cell = Cell(Path(), sensor, jig, robot, (), DESIGN_SCP, T_base_jig=where)
    cell = replace(cell, emulator=nominal_emulator(settings))
    errors = Errors(settings.sensor.mount_error_deg, settings.sensor.mount_error_mm)
    true = draw_truth(cell, errors, rng, _around(jig, clutter=settings.clutter))
    views = [(p.location, p.role, joints) for p in places for joints in p.views.joints_rad]
    if one_view:
        views = [views[int(rng.integers(len(views)))]]
    return EmulatedCell(cell, true, with_joint_noise(views, true.robot, rng))


@dataclass(frozen=True, eq=False)
class Place:
    """One location of the jig with its planned views."""

    location: str
    role: Role
    T_base_jig: Pose
    views: Views


Asked = tuple[JigPart, str, str, PosesPart, bool, int]
Plans = dict[Asked, tuple[Place, ...] | NoAnswerError]
_known: Plans = {}


def shared_plan(settings: TrialSettings, plan: int) -> tuple[Place, ...]:
    """The places and views of plan number ``plan``, shared by trials and workers: of the drawing's geometry alone.

    Raises NoAnswerError where the plan can not be made.
    """
    asked = _asked(settings, plan)
    found = _known[asked] if asked in _known else _planned(*asked)
    if isinstance(found, NoAnswerError):
        raise NoAnswerError(str(found))
    return found


def all_plans(settings: TrialSettings) -> Plans:
    """Every plan that trials of these settings share, made here, to be sent to the workers."""
    return {asked: _planned(*asked) for asked in (_asked(settings, n) for n in range(settings.poses.plans))}


def know_plans(plans: Plans) -> None:
    """Take what another process has planned: no worker plans it anew."""
    _known.update(plans)


def _asked(settings: TrialSettings, plan: int) -> Asked:
    """What a plan hangs on."""
    thickness = planned_diameter_mm(settings.jig.string_diameter_mm)
    jig = settings.jig.model_copy(update={"string_diameter_mm": thickness, "tolerance_mm": 0.0})
    poses = settings.poses.model_copy(update={"plans": 1})
    return jig, settings.robot.preset, settings.sensor.preset, poses, settings.clutter, plan


def planned_diameter_mm(diameter_mm: float) -> float:
    """Strings are planned for as if 0.3 mm thick, thinner ones as half of it, a quarter, …: not thicker than they are,
    and few plans do for all. What stands in a ray's way is judged with a margin far wider than a string.
    """
    halvings = max(0, math.ceil(math.log2(PLANNED_DIAMETER_MM / diameter_mm)))
    return float(PLANNED_DIAMETER_MM / 2**halvings)


@lru_cache(maxsize=_SHARED)
def _planned(
    jig_part: JigPart, robot: str, sensor: str, poses: PosesPart, clutter: bool, plan: int
) -> tuple[Place, ...] | NoAnswerError:
    """The places, or why there are none: that is remembered as well."""
    jig, model = nominal_jig(jig_part), _sensor_preset(sensor)
    rng = np.random.default_rng(np.random.SeedSequence(plan, spawn_key=(77,)))
    solids = (*jig_bodies(jig), *_around(jig, clutter=clutter).standing_in("jig"))
    limits = ViewLimits(tilt_deg=poses.tilt_max_deg, roll_deg=poses.roll_max_deg)
    sees_all = sees_all_strings(model, jig, solids)
    problem = ViewProblem(_robot_preset(robot), model, jig, Pose.identity(), DESIGN_SCP, limits, sees_all)
    wanted: list[tuple[str, Role, int]] = [(_name(i), "calibrate", poses.per_location) for i in range(poses.locations)]
    wanted += [(VERIFY, "verify", poses.verify)] if poses.verify else []
    try:
        return tuple(Place(name, role, *_place(problem, count, rng)) for name, role, count in wanted)
    except NoAnswerError as error:
        return error


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
    first = first_most(views.T_sensor_jig.R[:, 0, 0], SAME_COSINE)
    order = np.r_[first, np.delete(np.arange(len(views.joints_rad)), first)]
    return views[order]


def _random_place(robot: Arm, rng: np.random.Generator) -> Pose:
    """The jig upright before the arm: bearing ± 35°, 0.6 to 0.75 of the reach away, 0.25 to 0.4 of it high."""
    table = robot.dh_part()
    reach = float(np.sum(np.hypot(table.a, table.d)[1:]))
    bearing = np.deg2rad(rng.uniform(-35, 35))
    radius, height = reach * rng.uniform(0.6, 0.75), reach * rng.uniform(0.25, 0.4)
    turn = Pose.from_fixed_xyz_deg((0.0, 0.0, np.rad2deg(bearing) + rng.uniform(-8, 8)), (0.0, 0.0, 0.0))
    origin = np.array([radius * np.cos(bearing), radius * np.sin(bearing), height])
    return Pose(turn.R @ _UPRIGHT, origin)


@lru_cache(maxsize=64)
def nominal_jig(part: JigPart) -> Jig:
    """The jig of the drawing; the same object for the same part, whose solids are made ready for light once."""
    strings: Sequence[str] = tuple(STRINGS) if part.six_strings else DEFAULT_STRINGS
    return Jig.nominal(part.side_mm, part.height_mm, part.string_diameter_mm, part.tolerance_mm, tuple(strings))


@lru_cache(maxsize=64)
def nominal_robot(part: RobotPart) -> DhRobot:
    """The preset's table with the uncertainty that the settings give."""
    uncertainty = RobotUncertainty.from_file({key: getattr(part, key) for key in TYPICAL_SIGMA}, part.error_scale)
    return replace(_robot_preset(part.preset), uncertainty=uncertainty)


def nominal_emulator(settings: TrialSettings) -> EmulatorConfig:
    """The preset's emulation; settings that the plan gives stand over the preset's."""
    return _emulator(settings.sensor.preset, settings.emulator.model_dump_json(exclude_unset=True))


@lru_cache(maxsize=64)
def _emulator(preset: str, emulator_json: str) -> EmulatorConfig:
    own = find_emulator(preset).model_dump(exclude_unset=True)
    for table, values in json.loads(emulator_json).items():
        own.setdefault(table, {}).update(values)
    return EmulatorConfig.model_validate(own)


def nominal_sensor(settings: TrialSettings) -> Sensor:
    """The preset's sensor, with the optics of its emulation."""
    return _sensor(settings.sensor.preset, settings.emulator.model_dump_json(exclude_unset=True))


@lru_cache(maxsize=64)
def _sensor(preset: str, emulator_json: str) -> Sensor:
    return replace(_sensor_preset(preset), optics=stated_optics(_emulator(preset, emulator_json)))


@lru_cache(maxsize=64)
def _around(jig: Jig, *, clutter: bool) -> Surroundings:
    """What stands around the jig beside its own plates and posts: with clutter a wall behind it."""
    return Surroundings((("jig", wall_behind(jig, 160.0, turn_deg=8.0)),)) if clutter else NOTHING


@lru_cache(maxsize=16)
def _robot_preset(name: str) -> DhRobot:
    return find_robot(name).dh_part()


@lru_cache(maxsize=16)
def _sensor_preset(name: str) -> Sensor:
    return find_sensor(name)


def _name(index: int) -> str:
    """A, B, … Z, A1, B1, …"""
    letter = chr(ord("A") + index % 26)
    return letter if index < 26 else f"{letter}{index // 26}"
