"""Choices stay what they are when the values move by rounding noise."""

import numpy as np

from geometry import inverse_kinematics
from geometry.pose import Pose
from geometry.ties import ascending, first_least, first_least_of_each, first_most
from tests.geometry.strategies import six_axis_arm
from tests.pinned import pinned

NOISE = 1e-12


def test_the_first_of_equals_is_chosen_whatever_the_last_bits() -> None:
    rng = np.random.default_rng(1)
    values = np.array([3.0, 1.0, 2.0, 1.0, 5.0, np.nan, 5.0])
    for _ in range(50):
        near = values + rng.uniform(-NOISE, NOISE, len(values))
        assert first_least(near, 1e-9) == 1
        assert first_most(near, 1e-9) == 4
        assert ascending(near, 1e-9).tolist() == [1, 3, 2, 0, 4, 6, 5]


def test_rows_choose_on_their_own() -> None:
    values = np.array([[2.0, 1.0, 1.0], [np.inf, np.inf, np.inf], [np.nan, 4.0, 3.0]])
    assert first_least_of_each(values, 1e-9).tolist() == [1, 0, 2]


def test_inverse_kinematics_does_not_hang_on_the_last_bits_of_a_goal() -> None:
    """Goals moved by rounding noise: the same one of an arm's up to eight solutions, not merely one as exact."""
    robot, rng = six_axis_arm(), np.random.default_rng(11)
    goals = robot.pose(rng.uniform(robot.min_rad, robot.max_rad, (60, robot.n_joints)))
    moved = Pose(goals.R, goals.t + rng.uniform(-1e-10, 1e-10, goals.t.shape))
    seed = rng.uniform(robot.min_rad, robot.max_rad, robot.n_joints) / 2
    for seeds in (None, seed):
        one = inverse_kinematics(robot, goals, np.random.default_rng(5), seeds)
        pinned(one)
        other = inverse_kinematics(robot, moved, np.random.default_rng(5), seeds)
        pinned(other)
        both = one.converged & other.converged
        assert both.mean() > 0.9
        np.testing.assert_allclose(one.joints[both], other.joints[both], rtol=0, atol=1e-6)
