"""Inverse kinematics: back through the forward chain, within limits, for arms of any kind, near singularities too."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings

from geometry import DhRobot, InputError, Pose, all_solutions, inverse_kinematics, stack_poses
from tests.geometry.strategies import SEEDS, six_axis_arm
from tests.pinned import pinned

ATOL_MM = 1e-9
ATOL_RAD = 1e-12


def collaborative_arm() -> DhRobot:
    """Three parallel axes, whole turns everywhere (a UR5's table)."""
    d, a = [89.159, 0, 0, 109.15, 94.65, 82.3], [0, -425, -392.25, 0, 0, 0]
    return DhRobot.from_dh(np.zeros(6), d, a, np.deg2rad([90, 0, 0, 90, -90, 0]))


def seven_axis_arm() -> DhRobot:
    """A redundant arm by the modified convention (a Panda's table)."""
    return DhRobot.from_dh(
        np.zeros(7),
        [333, 0, 316, 0, 384, 0, 0],
        [0, 0, 0, 82.5, -82.5, 0, 88],
        np.deg2rad([0, -90, 90, 90, -90, 90, 90]),
        convention="modified",
        T_last_hand=Pose(np.eye(3), np.array([0, 0, 107.0])),
        min_rad=[-2.8973, -1.7628, -2.8973, -3.0718, -2.8973, -0.0175, -2.8973],
        max_rad=[2.8973, 1.7628, 2.8973, -0.0698, 2.8973, 3.7525, 2.8973],
    )


def coupled_arm() -> DhRobot:
    """J2 moves J3 along, and two joints turn the other way."""
    coupling = np.eye(6)
    coupling[2, 1] = 1.0
    return replace(six_axis_arm(), coupling=coupling, sign=np.array([1.0, 1, -1, 1, -1, 1]))


def shared_drive_arm() -> DhRobot:
    """A gear ratio that is no whole number: a whole turn of that reading moves another joint."""
    coupling = np.eye(6)
    coupling[5, 4] = 0.37
    return replace(six_axis_arm(), coupling=coupling)


ARMS = {
    "six axes": six_axis_arm,
    "collaborative": collaborative_arm,
    "seven axes": seven_axis_arm,
    "coupled": coupled_arm,
    "shared drive": shared_drive_arm,
}


def assert_reaches(robot: DhRobot, joints: np.ndarray, goals: Pose) -> None:
    """An own measure of the error: no logarithm in it."""
    hand = robot.pose(joints)
    assert np.all(robot.within_limits(joints))
    np.testing.assert_allclose(hand.t, goals.t, rtol=0, atol=2 * ATOL_MM)
    np.testing.assert_allclose(hand.R, goals.R, rtol=0, atol=2 * ATOL_RAD)


@pytest.mark.parametrize("arm", ARMS)
def test_reachable_goals_are_reached(arm: str) -> None:
    """200 poses taken on by random readings within the limits: every one is found again."""
    robot, rng = ARMS[arm](), np.random.default_rng(7)
    goals = robot.pose(rng.uniform(robot.min_rad, robot.max_rad, (200, robot.n_joints)))
    found = inverse_kinematics(robot, goals, rng)
    pinned(found)
    assert found.converged.mean() >= 0.995
    ok = found.converged
    assert_reaches(robot, found.joints[ok], goals[ok])
    assert np.all(found.position_error_mm[ok] < ATOL_MM)


@pytest.mark.parametrize("arm", ["six axes", "collaborative", "seven axes"])
def test_singular_wrists_are_solved(arm: str) -> None:
    robot, rng = ARMS[arm](), np.random.default_rng(8)
    q = rng.uniform(robot.min_rad, robot.max_rad, (60, robot.n_joints))
    q[:, 4] = 0.0
    goals = robot.pose(q)
    found = inverse_kinematics(robot, goals, rng)
    pinned(found)
    assert np.all(found.converged)
    assert_reaches(robot, found.joints, goals)


@given(SEEDS)
@settings(max_examples=25)
def test_a_seed_is_kept_near(seed: int) -> None:
    """From readings that already reach the goal nothing moves; the branch of a near seed is kept."""
    robot, rng = six_axis_arm(), np.random.default_rng(seed)
    q = rng.uniform(robot.min_rad, robot.max_rad) * 0.9
    q[4] = 0.7  # away from the singular wrist
    goal = robot.pose(q)
    np.testing.assert_allclose(inverse_kinematics(robot, goal, rng, seeds=q).joints, q, rtol=0, atol=1e-9)
    near = inverse_kinematics(robot, goal, rng, seeds=q + rng.normal(size=6) * 1e-3)
    assert near.converged
    np.testing.assert_allclose(near.joints, q, rtol=0, atol=1e-2)


def test_whole_turns_follow_the_seed() -> None:
    robot, rng = collaborative_arm(), np.random.default_rng(3)
    q = np.array([0.3, -1.2, 1.4, -0.4, 1.0, -5.9])
    found = inverse_kinematics(robot, robot.pose(q), rng, seeds=q + 0.01)
    pinned(found)
    np.testing.assert_allclose(found.joints, q, rtol=0, atol=1e-8)


def test_unreachable_goals_are_a_mask_not_an_error() -> None:
    robot, rng = six_axis_arm(), np.random.default_rng(2)
    near = robot.pose(np.array([0.2, 0.3, -0.4, 0.5, 0.6, 0.7]))
    goals = stack_poses([Pose(near.R, np.array([9000.0, 0, 0])), near])
    found = inverse_kinematics(robot, goals, rng)
    pinned(found)
    assert found.converged.tolist() == [False, True]
    assert found.position_error_mm[0] > 1000
    assert np.all(robot.within_limits(found.joints))


def test_a_goal_beyond_the_limits_is_not_reached() -> None:
    robot, rng = six_axis_arm(), np.random.default_rng(2)
    goal = robot.pose(np.array([0.2, 0.3, -0.4, 0.5, 0.6, 0.7]))
    behind = replace(robot, min_rad=robot.min_rad.copy(), max_rad=robot.max_rad.copy())
    behind.min_rad[0], behind.max_rad[0] = 1.0, 2.0
    assert inverse_kinematics(robot, goal, rng).converged
    assert not inverse_kinematics(behind, goal, rng).converged


def test_all_eight_postures_of_a_collaborative_arm_are_found() -> None:
    """Shoulder left or right, elbow up or down, wrist flipped or not: eight distinct ways to one pose."""
    robot, rng = collaborative_arm(), np.random.default_rng(5)
    goal = robot.pose(np.array([0.3, -1.2, 1.4, -0.4, 1.0, 0.2]))
    solutions = all_solutions(robot, goal, rng)
    assert len(solutions) == 8
    many = Pose(np.tile(goal.R, (8, 1, 1)), np.tile(goal.t, (8, 1)))
    assert_reaches(robot, solutions, many)
    apart = np.abs(np.exp(1j * solutions[:, None]) - np.exp(1j * solutions[None])).max(-1)
    assert apart[~np.eye(8, dtype=bool)].min() > 1e-2


def test_all_solutions_hold_the_posture_that_made_the_goal() -> None:
    robot, rng = six_axis_arm(), np.random.default_rng(6)
    for q in rng.uniform(robot.min_rad, robot.max_rad, (10, 6)):
        solutions = all_solutions(robot, robot.pose(q), rng)
        assert np.min(np.abs(np.exp(1j * solutions) - np.exp(1j * q)).max(-1)) < 1e-6


def test_the_same_generator_gives_the_same_answer() -> None:
    robot = six_axis_arm()
    goals = robot.pose(np.random.default_rng(1).uniform(robot.min_rad, robot.max_rad, (5, 6)))
    first, second = (inverse_kinematics(robot, goals, np.random.default_rng(4)).joints for _ in range(2))
    np.testing.assert_array_equal(first, second)


def test_empty_and_broken_goals() -> None:
    robot, rng = six_axis_arm(), np.random.default_rng(1)
    assert inverse_kinematics(robot, Pose(np.zeros((0, 3, 3)), np.zeros((0, 3))), rng).joints.shape == (0, 6)
    with pytest.raises(InputError, match="not finite") as refused:
        inverse_kinematics(robot, Pose(np.eye(3), np.array([np.nan, 0, 0])), rng)
    pinned(str(refused.value))
    with pytest.raises(InputError, match="seeds") as refused:
        inverse_kinematics(robot, Pose.identity(), rng, seeds=np.zeros(5))
    pinned(str(refused.value))
