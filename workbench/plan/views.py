"""Robot configurations that see a jig: sampled views, kept where all strings can be measured, spread apart."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from calib.mount import Mount
from geometry import Arm, NoAnswerError, Pose, Sensor, Workspace, inverse_kinematics, stack_poses
from geometry.ties import first_least, first_most
from jig_cad import Jig
from workbench.cell import SeesAll
from workbench.plan.clearance import (
    Clearance,
    carrying,
    room_at_target_mm,
    room_before_fixed,
    room_in_workspace_mm,
    standing,
)
from workbench.plan.view_space import Tally, ViewLimits, ViewSpace

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

BATCH = 96  # views drawn at a time
MAX_BATCHES = 40  # then the place gives no more: some 4,000 views
GIVE_UP = 60  # measurable views out of reach, not one within: the place is out of reach
POSTURE_RAD = np.deg2rad(70.0)  # an arm that swings its elbow over between two views would need a path planned
SAME_DISTANCE, SAME_MOTION_RAD2 = 1e-6, 1e-6  # views, and postures, that are equally far: the first is taken
OUT_OF_REACH = "out of the robot's reach or joint limits"
POOL_FACTOR = 4  # feasible views gathered for each one wanted, from which the best spread are taken


@dataclass(frozen=True, eq=False)
class Views:
    """Configurations at one place of the jig: joint readings (N, n) [rad] and the jig's poses in {P} (N).

    parameters: (N, 6), of the ViewSpace that they were drawn from.
    """

    joints_rad: Array
    T_sensor_jig: Pose
    parameters: Array

    @staticmethod
    def none(robot: Arm) -> Views:
        """No views."""
        return Views(np.zeros((0, robot.n_joints)), Pose(np.zeros((0, 3, 3)), np.zeros((0, 3))), np.zeros((0, 6)))

    def __getitem__(self, index: NDArray[np.intp]) -> Views:
        """The views of ``index``."""
        return Views(self.joints_rad[index], self.T_sensor_jig[index], self.parameters[index])

    def followed_by(self, other: Views) -> Views:
        """These views and then the ``other`` ones."""
        R = np.concatenate([self.T_sensor_jig.R, other.T_sensor_jig.R])
        t = np.concatenate([self.T_sensor_jig.t, other.T_sensor_jig.t])
        joints = np.concatenate([self.joints_rad, other.joints_rad])
        return Views(joints, Pose(R, t), np.concatenate([self.parameters, other.parameters]))


@dataclass(frozen=True, eq=False)
class ViewProblem:
    """One place of the jig: what the user knows, and what a view must fulfil.

    sees_all: tells whether the strings are free of occlusion at poses T_sensor_jig (N); None takes it for granted.
    workspace: what arm and sensor must keep off beside the jig. mount: "fixed" where T_hand_sensor is T_base_sensor and
    T_base_jig is T_hand_jig.
    """

    robot: Arm
    sensor: Sensor
    jig: Jig
    T_base_jig: Pose
    T_hand_sensor: Pose
    limits: ViewLimits = field(default_factory=ViewLimits)
    sees_all: SeesAll | None = None
    workspace: Workspace = field(default_factory=Workspace)
    mount: Mount = "hand"

    def room_mm(self, joints_rad: Array) -> Clearance:
        """What room is left at the readings (N, n)."""
        how = self.workspace
        if self.mount == "fixed":
            arm = carrying(self.robot, joints_rad, self.T_base_jig, self.jig, how.link_radius_mm)
            return room_before_fixed(arm, self.T_hand_sensor, self.sensor, how)
        arm = standing(self.robot, joints_rad, self.T_hand_sensor, self.sensor, how.link_radius_mm)
        around, where = room_in_workspace_mm(arm, how)
        return Clearance(room_at_target_mm(arm, self.jig, self.T_base_jig), around, where)

    def hand_goals(self, T_sensor_jig: Pose) -> Pose:
        """T_base_hand (N) that bring the sensor to the poses, or the target where the sensor is fixed."""
        if self.mount == "fixed":
            return self.T_hand_sensor @ T_sensor_jig @ self.T_base_jig.inverse()
        return self.T_base_jig @ T_sensor_jig.inverse() @ self.T_hand_sensor.inverse()


def plan_views(problem: ViewProblem, count: int, rng: np.random.Generator) -> Views:
    """``count`` configurations that see all strings, within the joints' limits, with well-spread tilts and rolls.

    Parameters
    ----------
    problem
        Robot, sensor, jig, where they stand by what is known, and what a view must fulfil.
    count
        How many are wanted.
    rng
        The same state gives the same configurations.

    Returns
    -------
    Views
        ``count`` of them, the farthest from each other first.

    Raises
    ------
    NoAnswerError
        Where not enough can be found, saying what stood in the way.

    """
    tally = Tally()
    pool = feasible_views(problem, count * POOL_FACTOR, rng, tally)
    if len(pool.joints_rad) < count:
        raise NoAnswerError(
            f"only {len(pool.joints_rad)} of {count} configurations found that see all strings ({tally.text()}); "
            "move the jig, widen the limits of the view, or ask for fewer"
        )
    chosen = spread(pool.T_sensor_jig, problem.jig, count)
    return pool[chosen]


def spread(Ts_sensor_jig: Pose, jig: Jig, count: int) -> NDArray[np.intp]:
    """Indices of ``count`` views that lie far from each other: each next one is the farthest from those taken.

    The distance is that of the rotations [rad] and of the jig's centre in {P} over its size.
    """
    centre = jig.anchors_mm.mean(axis=0)
    place = (Ts_sensor_jig @ centre) / (2 * max(jig.side_mm, jig.height_mm))
    features = np.concatenate([Ts_sensor_jig.R.reshape(-1, 9) / np.sqrt(2), place], axis=1)
    first = first_most(np.linalg.norm(features - features.mean(axis=0), axis=1), SAME_DISTANCE)
    chosen = [first]
    distance = np.linalg.norm(features - features[first], axis=1)
    while len(chosen) < count:
        chosen.append(first_most(distance, SAME_DISTANCE))
        distance = np.minimum(distance, np.linalg.norm(features - features[chosen[-1]], axis=1))
    return np.array(chosen, dtype=np.intp)


def feasible_views(
    problem: ViewProblem,
    wanted: int,
    rng: np.random.Generator,
    tally: Tally | None = None,
    batch: int = BATCH,
    space: ViewSpace | None = None,
) -> Views:
    """Up to ``wanted`` views that fulfil everything, in the order in which they were drawn.

    batch: how many are drawn at a time, MAX_BATCHES times at most. space: where known already.
    """
    tally = Tally() if tally is None else tally
    space = space or ViewSpace.of(problem.sensor, problem.jig, problem.limits)
    found = Views.none(problem.robot)
    seed: Array | None = None
    for _ in range(MAX_BATCHES):
        parameters = space.draw(batch, rng)
        tally.tried += batch
        kept = space.measurable(space.poses(parameters), tally)
        if len(kept) == 0:
            continue
        candidates = space.poses(parameters[kept])
        goals = problem.hand_goals(candidates)
        seed = _posture(problem, goals, rng) if seed is None else seed
        if seed is None:
            tally.refuse(OUT_OF_REACH, np.ones(len(goals), dtype=bool))
            if tally.refused[OUT_OF_REACH] > GIVE_UP:
                break
            continue
        q, reached = _reach(problem, goals, seed, rng, tally)
        found = found.followed_by(_unhidden(problem, space, Views(q, candidates, parameters[kept]), reached, tally))
        if len(found.joints_rad) >= wanted:
            return found[np.arange(wanted)]
    return found


def near_views(
    problem: ViewProblem, space: ViewSpace, parameters: Array, seeds: Array
) -> tuple[Views, NDArray[np.intp]]:
    """The views of ``parameters`` (N, 6) that can be measured and reached from the readings (N, n), and which they are.

    Occlusion is not looked at.
    """
    kept = space.measurable(space.poses(parameters), Tally())
    if len(kept) == 0:
        return Views.none(problem.robot), kept
    poses = space.poses(parameters[kept])
    rng = np.random.default_rng(0)  # not drawn from: no starts beside the seeds
    found = inverse_kinematics(problem.robot, problem.hand_goals(poses), rng, seeds=seeds[kept], max_starts=0)
    ok = found.converged & _same_posture(found.joints, seeds[kept])
    ok &= problem.room_mm(found.joints).least > 0
    return Views(found.joints[ok], poses[np.flatnonzero(ok)], parameters[kept[ok]]), kept[ok]


def free_views(sensor: Sensor, jig: Jig, limits: ViewLimits, count: int, rng: np.random.Generator) -> Pose:
    """Views without a robot, in which every string crosses the field of view.

    Parameters
    ----------
    sensor, jig, limits
        What sees what, and which views are asked for.
    count
        How many are wanted.
    rng
        The same state gives the same views.

    Returns
    -------
    Pose
        T_sensor_jig (count).

    Raises
    ------
    NoAnswerError
        Where the sensor sees no jig of this size.

    """
    tally = Tally()
    space = ViewSpace.of(sensor, jig, replace(limits, mounting_deg=0.0))
    poses: list[Pose] = []
    for _ in range(10 * MAX_BATCHES):
        T_sensor_jig = space.poses(space.draw(BATCH, rng))
        tally.tried += BATCH
        poses += [T_sensor_jig[i] for i in space.measurable(T_sensor_jig, tally)]
        if len(poses) >= count:
            return stack_poses(poses[:count])
    raise NoAnswerError(f"only {len(poses)} of {count} views found that show all strings ({tally.text()})")


def _posture(problem: ViewProblem, goals: Pose, rng: np.random.Generator) -> Array | None:
    """The readings that reach one of the goals with the joints turned least; the other views keep near them.

    Of those that touch nothing, where there are any.
    """
    reached = inverse_kinematics(problem.robot, goals, rng)
    joints = reached.joints[reached.converged]
    if len(joints):
        free = problem.room_mm(joints).least > 0
        joints = joints[free] if np.any(free) else joints
    return joints[first_least(np.sum(joints**2, axis=1), SAME_MOTION_RAD2)] if len(joints) else None


def _reach(
    problem: ViewProblem, goals: Pose, seed: Array, rng: np.random.Generator, tally: Tally
) -> tuple[Array, Mask]:
    """Readings (N, n), and which goals (N) they reach without swinging the arm over or touching anything."""
    found = inverse_kinematics(problem.robot, goals, rng, seeds=seed)
    good = found.converged
    tally.refuse(OUT_OF_REACH, ~good)
    room = problem.room_mm(found.joints)
    low = (room.around <= 0) & (room.where < 0)
    tests = {
        "reached in another posture of the arm only": _same_posture(found.joints, seed),
        "with the hand or the arm too near the jig": room.at_target > 0,
        "with the arm or the sensor in the floor": ~low,
        "with the arm or the sensor in a box of [workspace]": low | (room.around > 0),
    }
    for why, test in tests.items():
        tally.refuse(why, good & ~test)
        good = good & test
    return found.joints, np.asarray(good)


def _same_posture(joints: Array, seeds: Array) -> Mask:
    return np.asarray(np.all(np.abs(joints[:, :3] - seeds[..., :3]) <= POSTURE_RAD, axis=1))


def _unhidden(problem: ViewProblem, space: ViewSpace, views: Views, reached: Mask, tally: Tally) -> Views:
    """The reached views in which nothing hides a string, however the sensor is mounted."""
    views = views[np.flatnonzero(reached)]
    seen = unhidden(problem, space, views.T_sensor_jig)
    tally.refuse("hidden by strings, posts or plates", ~seen)
    return views[np.flatnonzero(seen)]


def unhidden(problem: ViewProblem, space: ViewSpace, T_sensor_jig: Pose) -> Mask:
    """Whether nothing hides a string at the poses (N), however the sensor is mounted."""
    if problem.sees_all is None or len(T_sensor_jig) == 0:
        return np.ones(len(T_sensor_jig), dtype=bool)
    turned = [turn @ T_sensor_jig for turn in space.turns]
    every = Pose(np.concatenate([p.R for p in turned]), np.concatenate([p.t for p in turned]))
    return np.asarray(np.all(problem.sees_all(every).reshape(len(turned), -1), axis=0))
