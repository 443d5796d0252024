"""Forward kinematics and Jacobians against an independent library and finite differences."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pytransform3d import transformations as pt

from geometry import DH_ROWS, DhRobot, InputError, Pose
from tests.geometry.strategies import SEEDS, random_robot, six_axis_arm
from tests.pinned import pinned

ATOL_MM = 1e-9
CONVENTIONS = st.sampled_from(["standard", "modified"])


def chain_by_pytransform3d(robot: DhRobot, q: np.ndarray) -> np.ndarray:
    """The hand's pose as a product of elementary transforms, each built by pytransform3d."""

    def turn(axis: int, angle: float) -> np.ndarray:
        return pt.transform_from_exponential_coordinates(np.concatenate([np.eye(3)[axis] * angle, np.zeros(3)]))

    def slide(axis: int, length: float) -> np.ndarray:
        return pt.transform_from_exponential_coordinates(np.concatenate([np.zeros(3), np.eye(3)[axis] * length]))

    coupling = np.eye(robot.n_joints) if robot.coupling is None else robot.coupling
    out = robot.T_base_first.matrix
    for i in range(robot.n_joints):
        theta = robot.sign[i] * sum(coupling[i, k] * q[k] for k in range(robot.n_joints)) + robot.theta_offset[i]
        rz, tz = turn(2, theta), slide(2, robot.d[i])
        rx, tx, ry = turn(0, robot.alpha[i]), slide(0, robot.a[i]), turn(1, robot.beta[i])
        link = rz @ tz @ tx @ rx @ ry if robot.convention == "standard" else rx @ tx @ ry @ rz @ tz
        out = out @ link
    return np.asarray(out @ robot.T_last_hand.matrix)


@given(SEEDS, st.integers(1, 8), CONVENTIONS)
def test_hand_pose_agrees_with_an_independent_library(seed: int, joints: int, convention: str) -> None:
    rng = np.random.default_rng(seed)
    robot = random_robot(rng, joints, convention)
    q = rng.uniform(-np.pi, np.pi, joints)
    np.testing.assert_allclose(robot.pose(q).matrix, chain_by_pytransform3d(robot, q), rtol=0, atol=ATOL_MM)


@given(SEEDS, CONVENTIONS)
@settings(max_examples=25)
def test_parameter_jacobian_is_the_derivative(seed: int, convention: str) -> None:
    """Every column against central differences of the model with that parameter moved."""
    rng = np.random.default_rng(seed)
    robot = random_robot(rng, 6, convention)
    q = rng.uniform(-np.pi, np.pi, 6)
    back = robot.pose(q).inverse()
    jacobian = robot.table_jacobian(q)
    step = 1e-5
    assert list(jacobian) == [row.group for row in DH_ROWS]
    for row in jacobian:
        for i in range(6):
            ahead, behind = (robot.with_changes(**{row: s * step * np.eye(6)[i]}).pose(q) for s in (1, -1))
            numeric = ((back @ ahead).log() - (back @ behind).log()) / (2 * step)
            np.testing.assert_allclose(jacobian[row][:, i], numeric, rtol=0, atol=1e-5, err_msg=row)


@given(SEEDS, CONVENTIONS)
@settings(max_examples=40)
def test_joint_jacobian_is_the_derivative(seed: int, convention: str) -> None:
    rng = np.random.default_rng(seed)
    robot = random_robot(rng, 6, convention)
    q, step = rng.uniform(-np.pi, np.pi, 6), 1e-5
    back = robot.pose(q).inverse()
    moved = [[(back @ robot.pose(q + s * step * e)).log() for s in (1, -1)] for e in np.eye(6)]
    numeric = np.stack([(ahead - behind) / (2 * step) for ahead, behind in moved], -1)
    np.testing.assert_allclose(robot.joint_jacobian(q), numeric, rtol=0, atol=1e-5)


@given(SEEDS, CONVENTIONS)
@settings(max_examples=20)
def test_batches_are_rows_of_single_readings(seed: int, convention: str) -> None:
    rng = np.random.default_rng(seed)
    robot = random_robot(rng, 6, convention)
    q = rng.uniform(-np.pi, np.pi, (2, 3, 6))
    batch = robot.pose(q)
    links = robot.link_poses(q)
    for i in np.ndindex(2, 3):
        np.testing.assert_allclose(batch.matrix[i], robot.pose(q[i]).matrix, rtol=0, atol=1e-11)
        np.testing.assert_allclose(links.matrix[i], robot.link_poses(q[i]).matrix, rtol=0, atol=1e-11)
        for method in ("parameter_jacobian", "joint_jacobian"):
            one, many = getattr(robot, method)(q[i]), getattr(robot, method)(q)[i]
            np.testing.assert_allclose(many, one, rtol=0, atol=1e-10)


@given(SEEDS)
@settings(max_examples=20)
def test_both_conventions_describe_one_arm(seed: int) -> None:
    """A standard table is the modified one with a and α shifted by a joint: the same product, cut elsewhere."""
    rng = np.random.default_rng(seed)
    theta, d, a, alpha = rng.uniform(-1, 1, (4, 5)) * np.array([[3.0], [400], [400], [3.0]])
    standard = DhRobot.from_dh(theta, d, a, alpha)
    shifted_a, shifted_alpha = np.concatenate([[0], a[:-1]]), np.concatenate([[0], alpha[:-1]])
    last = Pose.exp([a[-1], 0, 0, 0, 0, 0]) @ Pose.exp([0, 0, 0, alpha[-1], 0, 0])
    modified = DhRobot.from_dh(theta, d, shifted_a, shifted_alpha, convention="modified", T_last_hand=last)
    q = rng.uniform(-3, 3, (4, 5))
    np.testing.assert_allclose(standard.pose(q).matrix, modified.pose(q).matrix, rtol=0, atol=1e-9)


def test_a_stretched_arm_reaches_the_sum_of_its_links() -> None:
    """Upright at zero: x = a1 + d4 + d6, z = d1 + a2 + a3 by the maker's dimensions."""
    hand = six_axis_arm().pose(np.zeros(6))
    np.testing.assert_allclose(hand.t, [320 + 1142 + 200, 0, 780 + 1075 + 200], rtol=0, atol=1e-9)


def test_limits_are_inclusive() -> None:
    robot = six_axis_arm()
    assert robot.within_limits(robot.max_rad)
    assert robot.within_limits(np.stack([robot.min_rad, robot.max_rad + 1e-9])).tolist() == [True, False]


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"a": np.zeros(5)}, "a has 5 values for 6 joints"),
        ({"d": np.zeros(0)}, "no joints"),
        ({"alpha": np.array([0, 0, np.nan, 0, 0, 0])}, "joint 3: alpha is not a finite"),
        ({"sign": np.array([1.0, 1, 1, 1, 1, 0])}, "joint 6: sign = 0"),
        ({"max_rad": np.full(6, -10.0)}, "joint 1: the lower limit"),
        ({"convention": "Denavit"}, 'must be "standard" or "modified"'),
        ({"coupling": np.eye(5)}, "6 × 6"),
        ({"coupling": np.ones((6, 6))}, "singular"),
    ],
)
def test_tables_that_are_no_arm_are_refused(change: dict[str, object], message: str) -> None:
    with pytest.raises(InputError, match=message) as refused:
        replace(six_axis_arm(), **change)  # type: ignore[arg-type]
    pinned(str(refused.value))


@pytest.mark.parametrize("readings", [np.zeros(5), np.zeros((2, 7)), 0.0])
def test_a_wrong_number_of_readings_is_refused(readings: object) -> None:
    with pytest.raises(InputError, match="for a robot of 6 joints") as refused:
        six_axis_arm().pose(readings)  # type: ignore[arg-type]
    pinned(str(refused.value))
