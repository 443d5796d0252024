"""Inverse kinematics within joint limits: damped least squares from many starts, all goals at once."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from geometry.errors import InputError
from geometry.pose import Pose
from geometry.robot.model import Arm
from geometry.ties import ascending, first_least

Array = NDArray[np.float64]

POSITION_TOLERANCE_MM = 1e-9
ROTATION_TOLERANCE_RAD = 1e-12
MAX_ITERATIONS = 60
POOL = 1024  # random configurations from which a goal's starts are drawn
STARTS_PER_ROUND = 6
DISTINCT_RAD = 1e-4  # two solutions are one where no joint differs by more, whole turns apart
SAME_MOTION_RAD2 = 1e-6  # solutions whose joints move alike, by the sum of squares: the earlier start's is taken
SAME_BADNESS = 1e-6  # relative, of what is left to the goal where no solution is exact
SAME_START = 1e-9  # of the distance by which starts are ranked, dimensionless


@dataclass(frozen=True, eq=False)
class InverseKinematics:
    """Readings that reach the goals, as far as they can be reached within the limits.

    joints: (..., n) [rad], the best found where not converged. converged: (...) whether both errors are at rounding.
    position_error_mm, rotation_error_rad: (...) what is left between the goal and the hand.
    """

    joints: Array
    converged: NDArray[np.bool_]
    position_error_mm: Array
    rotation_error_rad: Array


def inverse_kinematics(
    robot: Arm,
    goals: Pose,
    rng: np.random.Generator,
    seeds: ArrayLike | None = None,
    max_starts: int = 24,
) -> InverseKinematics:
    """Joint readings within the limits at which the hand takes each goal.

    Parameters
    ----------
    robot : Arm
        A robot whose links are known.
    goals : Pose
        T_base_hand (...).
    rng : numpy.random.Generator
        Draws the configurations to start from.
    seeds : (n,) or (..., n), optional
        Readings [rad] to start from; the answer is then the solution reached from there, turned by whole turns to be
        near it.
    max_starts : int
        Where that fails, and without seeds, up to as many random configurations nearest to the goal are tried, in
        rounds. Of a round's exact solutions the one with the least joint motion from the seed (without one, from the
        limits' middle) is taken, of equals that of the nearer start: never by what rounding left.

    Returns
    -------
    InverseKinematics
        An unreachable goal is no error: ``converged`` is False there.

    References
    ----------
    T. Sugihara, Solvability-unconcerned inverse kinematics by the Levenberg-Marquardt method, IEEE T-RO 2011 (damping
    by the square of the error); limits by an active set.
    """
    batch = goals.t.shape[:-1]
    flat = Pose(goals.R.reshape(-1, 3, 3), goals.t.reshape(-1, 3))
    _check_goals(flat)
    if seeds is None:
        best = _Search.begin(robot, np.tile(sum(_limits(robot)) / 2, (len(flat), 1)))
    else:
        start = np.broadcast_to(_checked_seeds(robot, seeds), (*batch, robot.n_joints)).reshape(-1, robot.n_joints)
        best = _Search.begin(robot, start)
        best.offer(np.arange(len(flat)), *_solve(robot, flat, start, near=start))
    if not np.all(best.converged):
        _from_pool(robot, flat, rng, max_starts, best)
    return InverseKinematics(
        best.joints.reshape(*batch, robot.n_joints),
        best.converged.reshape(batch),
        best.position.reshape(batch),
        best.rotation.reshape(batch),
    )


def all_solutions(robot: Arm, goal: Pose, rng: np.random.Generator, starts: int = 160) -> Array:
    """Distinct solutions within the limits for one goal.

    Parameters
    ----------
    robot : Arm
        A robot whose links are known; a redundant one has infinitely many, of which samples are found.
    goal : Pose
        One T_base_hand.
    rng : numpy.random.Generator
        Draws the starts.
    starts : int
        How many are tried.

    Returns
    -------
    (S, n) array
        Readings [rad]; those that differ by whole turns are one.
    """
    goals = Pose(np.broadcast_to(goal.R, (starts, 3, 3)), np.broadcast_to(goal.t, (starts, 3)))
    _check_goals(goals)
    start = rng.uniform(*_limits(robot), (starts, robot.n_joints))
    joints, position, rotation = _solve(robot, goals, start, near=None)
    found = joints[_is_solved(position, rotation)]
    distinct: list[Array] = []
    for q in found:
        if not any(np.max(np.abs(_whole_turns_off(robot, q - other))) < DISTINCT_RAD for other in distinct):
            distinct.append(q)
    return np.array(distinct).reshape(-1, robot.n_joints)


@dataclass(eq=False)
class _Search:
    """The best answer so far for every goal. near: the readings (G, n) from which a joint's motion is counted."""

    near: Array
    joints: Array
    position: Array
    rotation: Array

    @staticmethod
    def begin(robot: Arm, near: Array) -> _Search:
        joints = np.clip(near, *_limits(robot))
        return _Search(near, joints, np.full(len(near), np.inf), np.full(len(near), np.inf))

    @property
    def converged(self) -> NDArray[np.bool_]:
        return _is_solved(self.position, self.rotation)

    def offer(self, index: NDArray[np.intp], joints: Array, position: Array, rotation: Array) -> None:
        """Keep what is better than before. index: the goals, their offers (goals · offers, …) stand together.

        An exact solution is better than none, and of exact ones the least motion is best; of others the least error,
        by steps of a millionth.
        """
        many = len(joints) // max(len(index), 1)
        for row, g in enumerate(np.ravel(index)):
            mine = np.arange(row * many, (row + 1) * many)
            exact = mine[_is_solved(position[mine], rotation[mine])]
            if len(exact):
                motion = np.sum((joints[exact] - self.near[g]) ** 2, axis=1)
                best = exact[first_least(motion, SAME_MOTION_RAD2)]
            else:
                badness = np.log(_badness(position[mine], rotation[mine]))
                best = mine[first_least(badness, SAME_BADNESS)]
                before = np.log(_badness(self.position[g], self.rotation[g]))
                if not badness[best - mine[0]] < before - SAME_BADNESS:
                    continue
            self.joints[g] = joints[best]
            self.position[g], self.rotation[g] = position[best], rotation[best]


def _from_pool(robot: Arm, goals: Pose, rng: np.random.Generator, max_starts: int, best: _Search) -> None:
    """Rounds of starts from random configurations, nearest to the goal first."""
    pool = rng.uniform(*_limits(robot), (POOL, robot.n_joints))
    poses = robot.pose(pool)
    scale = _length(robot)
    for first in range(0, max_starts, STARTS_PER_ROUND):
        open_goals = np.flatnonzero(~best.converged)
        if len(open_goals) == 0:
            return
        count = min(STARTS_PER_ROUND, max_starts - first)
        chosen = np.empty((len(open_goals), count), dtype=np.intp)
        for row, g in enumerate(open_goals):
            far = np.sum((poses.t - goals.t[g]) ** 2, -1) / scale**2 - np.einsum("kij,ij->k", poses.R, goals.R[g])
            chosen[row] = ascending(far, SAME_START)[first : first + count]
        index = np.repeat(open_goals, count)
        best.offer(open_goals, *_solve(robot, goals[index], pool[chosen.ravel()], near=best.near[index]))


def _solve(robot: Arm, goals: Pose, start: Array, near: Array | None) -> tuple[Array, Array, Array]:
    """Levenberg-Marquardt from each start (B, n) to its goal (B): readings, position and rotation errors."""
    weight = np.array([1.0, 1.0, 1.0, *[_length(robot)] * 3])  # the twist's error in mm throughout
    joints = _into_limits(robot, np.array(start), near)
    damping = np.full(len(joints), 1e-3)
    error, jacobian = _error(robot, goals, joints)
    active = np.flatnonzero(~_is_solved(*_norms(error)))
    for _ in range(MAX_ITERATIONS):
        if len(active) == 0:
            break
        here, e, j = joints[active], error[active], jacobian[active]
        step = _step(robot, here, e * weight, j * weight[:, None], damping[active])
        trial = _into_limits(robot, here + step, None if near is None else near[active])
        trial_error, trial_jacobian = _error(robot, goals[active], trial)
        better = np.sum((trial_error * weight) ** 2, -1) < np.sum((e * weight) ** 2, -1)
        won = active[better]
        joints[won], error[won], jacobian[won] = trial[better], trial_error[better], trial_jacobian[better]
        damping[active] = np.clip(damping[active] * np.where(better, 0.2, 8.0), 1e-8, 1e8)
        stuck = damping[active] >= 1e8
        active = active[~stuck & ~_is_solved(*_norms(error[active]))]
    return joints, *_norms(error)


def _step(robot: Arm, joints: Array, error: Array, jacobian: Array, damping: Array) -> Array:
    """Damped step (B, n); a joint at its limit that would be pushed out stays."""
    low, high = _limits(robot)
    gradient = (jacobian * error[:, :, None]).sum(1)
    blocked = ((joints <= low) & (gradient < 0)) | ((joints >= high) & (gradient > 0))
    free = np.where(blocked, 0.0, 1.0)
    j = jacobian * free[:, None, :]
    squared = np.sum(error**2, -1)
    normal = np.swapaxes(j, -1, -2) @ j
    n = normal.shape[-1]
    # a damping in proportion to the squared error keeps the quadratic end; the floor keeps singular arms solvable
    normal[:, range(n), range(n)] += (damping * squared + 1e-9)[:, None] + (1 - free)
    return np.asarray(np.linalg.solve(normal, (gradient * free)[..., None])[..., 0])


def _error(robot: Arm, goals: Pose, joints: Array) -> tuple[Array, Array]:
    """The twists (B, 6) [mm, rad] from the hand to the goals, in the hand's axes, and the Jacobian (B, 6, n)."""
    hand, jacobian = robot.pose_and_jacobian(joints)
    return (hand.inverse() @ goals).log(), jacobian


def _into_limits(robot: Arm, joints: Array, near: Array | None) -> Array:
    """The readings turned by whole turns towards ``near`` (or the limits' middle), then clipped."""
    low, high = _limits(robot)
    middle = (low + high) / 2
    turned = joints - np.where(_turns_freely(robot), 2 * np.pi * np.round((joints - middle) / (2 * np.pi)), 0.0)
    if near is not None:
        closer = turned - np.where(_turns_freely(robot), 2 * np.pi * np.round((turned - near) / (2 * np.pi)), 0.0)
        turned = np.where((closer >= low) & (closer <= high), closer, turned)
    return np.clip(turned, low, high)


def _whole_turns_off(robot: Arm, difference: Array) -> Array:
    turns = 2 * np.pi * np.round(difference / (2 * np.pi))
    return np.where(_turns_freely(robot), difference - turns, difference)


def _turns_freely(robot: Arm) -> NDArray[np.bool_]:
    """Whether a whole turn of a joint's reading leaves the arm as it was (n,): its coupling is in whole numbers."""
    m = robot.dh_part().readings_to_angles
    return np.asarray(np.all(m == np.round(m), axis=0))


def _limits(robot: Arm) -> tuple[Array, Array]:
    """Lower and upper limits (n,) of the readings [rad]."""
    table = robot.dh_part()
    return table.min_rad, table.max_rad


def _length(robot: Arm) -> float:
    """A length [mm] that makes angles comparable to distances: a third of the arm's links in a row."""
    table = robot.dh_part()
    return float(max(np.sum(np.hypot(table.a, table.d)) / 3, 1.0))


def _norms(error: Array) -> tuple[Array, Array]:
    return np.linalg.norm(error[..., :3], axis=-1), np.linalg.norm(error[..., 3:], axis=-1)


def _is_solved(position: Array, rotation: Array) -> NDArray[np.bool_]:
    return np.asarray((position < POSITION_TOLERANCE_MM) & (rotation < ROTATION_TOLERANCE_RAD))


def _badness(position: Array, rotation: Array) -> Array:
    return np.asarray(position / POSITION_TOLERANCE_MM + rotation / ROTATION_TOLERANCE_RAD)


def _check_goals(goals: Pose) -> None:
    if not (np.all(np.isfinite(goals.t)) and np.all(np.isfinite(goals.R))):
        raise InputError("a goal of the inverse kinematics holds a number that is not finite")


def _checked_seeds(robot: Arm, seeds: ArrayLike) -> Array:
    q = np.asarray(seeds, dtype=float)
    if q.shape[-1:] != (robot.n_joints,) or not np.all(np.isfinite(q)):
        raise InputError(f"seeds must be finite readings of {robot.n_joints} joints, not of shape {q.shape}")
    return q
