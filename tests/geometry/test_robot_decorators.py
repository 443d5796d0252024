"""Every kind of Robot: Jacobians against central differences, corrections built in, decorators on decorators."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
import pytest

from geometry import (
    Compliance,
    Compliant,
    Corrected,
    DhRobot,
    GivenPoses,
    InputError,
    Inverted,
    JointDeviation,
    Parameter,
    Pose,
    Robot,
    RobotUncertainty,
    draw_errors,
    inverse_kinematics,
    require_arm,
    table,
    with_beta_prior,
)
from geometry.robot import ScaledReadings, with_reading_scales, without_reading_scales
from tests.geometry.strategies import random_robot, six_axis_arm
from tests.pinned import pinned

ATOL_POSE = 1e-9  # mm, and of rotations
ATOL_PER_RAD = 2e-5  # mm/rad: a central difference of a pose some metres away, of the torque within it as well
SIGMA_PER_NM = 2e-6
LOAD = Compliance(stiffness=(1e6, 4e5, 9e5, 4e5, np.inf, 4e5))


@dataclass(frozen=True, eq=False)
class Eccentric(JointDeviation):
    """A gear whose wheel sits off its centre: joint ``joint`` turns by s sin q + c cos q further than it reads."""

    joint: int = 2
    sigma_rad: float = 1e-3

    @property
    def own_parameters(self) -> tuple[Parameter, ...]:
        """Sine and cosine of one joint."""
        names = (f"sine{self.joint}", f"cosine{self.joint}")
        return tuple(Parameter(name, "rad", self.sigma_rad, "eccentricity") for name in names)

    def deviation(self, joints_rad: np.ndarray, values: np.ndarray) -> np.ndarray:
        """Of one joint alone."""
        q = joints_rad[..., self.joint - 1]
        off = np.zeros(joints_rad.shape)
        off[..., self.joint - 1] = values[0] * np.sin(q) + values[1] * np.cos(q)
        return off


def arm() -> DhRobot:
    """Parallel axes 2 and 3, signs, coupling, a tool frame and a β that is not zero."""
    coupling = np.eye(6)
    coupling[2, 1] = 1.0
    sign = np.array([1.0, -1.0, 1.0, 1.0, -1.0, 1.0])
    last = Pose.exp([10.0, -20.0, 30.0, 0.1, 0.2, -0.3])
    bent = replace(six_axis_arm(), sign=sign, coupling=coupling, T_last_hand=last, name="arm")
    return bent.with_changes(beta=[0.0, 2e-3, 0.0, 0.0, 0.0, 0.0]).with_beta_prior(1e-3)


def modified() -> DhRobot:
    robot = random_robot(np.random.default_rng(4), 6, "modified")
    return replace(robot, uncertainty=RobotUncertainty(a_sigma_mm=0.0))


ROBOTS: dict[str, Callable[[], Robot]] = {
    "standard": arm,
    "modified": modified,
    "compliant": lambda: Compliant(arm(), LOAD, SIGMA_PER_NM),
    "compliant modified, some joints": lambda: Compliant(modified(), LOAD, (0.0, 1e-6, 2e-6, 0.0, 0.0, 1e-6)),
    "eccentric": lambda: Eccentric(arm()),
    "eccentric, compliant": lambda: Eccentric(Compliant(arm(), LOAD, SIGMA_PER_NM), 5),
    "compliant, eccentric": lambda: Compliant(Eccentric(arm()), LOAD, SIGMA_PER_NM),
    "scaled": lambda: ScaledReadings(arm(), 1e-3),
    "inverted, scaled": lambda: Inverted(ScaledReadings(Compliant(arm(), LOAD, SIGMA_PER_NM), 1e-3)),
    "corrected": lambda: Corrected(Eccentric(arm()), draw_errors(Eccentric(arm()), np.random.default_rng(8))),
    "compliant, corrected": lambda: Compliant(
        Corrected(arm(), draw_errors(arm(), np.random.default_rng(8))), LOAD, 1e-6
    ),
    "inverted": lambda: Inverted(arm()),
    "inverted, compliant": lambda: Inverted(Compliant(arm(), LOAD, SIGMA_PER_NM)),
}


@pytest.fixture(params=ROBOTS)
def robot(request: pytest.FixtureRequest) -> Robot:
    return ROBOTS[request.param]()


def _drawn(robot: Robot) -> tuple[np.ndarray, np.ndarray]:
    """Readings (3, n) and values (P,), ten times as large as they should be."""
    rng = np.random.default_rng(2)
    return rng.uniform(-1.5, 1.5, (3, robot.n_joints)), 10 * draw_errors(robot, rng)


def _derivative(move: Callable[[float], Pose], step: float) -> np.ndarray:
    back = move(0.0).inverse()
    return np.asarray(((back @ move(step)).log() - (back @ move(-step)).log()) / (2 * step))


def test_joint_jacobians_are_derivatives(robot: Robot) -> None:
    q, values = _drawn(robot)
    for v in (None, values):
        jacobian = robot.joint_jacobian(q, v)
        for i, e in enumerate(np.eye(robot.n_joints)):
            numeric = _derivative(lambda s, e=e, v=v: robot.pose(q + s * e, v), 1e-4)  # type: ignore[misc]
            np.testing.assert_allclose(jacobian[..., i], numeric, rtol=0, atol=ATOL_PER_RAD)


def test_parameter_jacobians_are_derivatives(robot: Robot) -> None:
    """At the nominal robot and away from it; steps and tolerances in units of each parameter's σ."""
    q, values = _drawn(robot)
    for v in (np.zeros(len(values)), values):
        jacobian = robot.parameter_jacobian(q, v)
        assert jacobian.shape == (3, 6, len(robot.parameters))
        for k, p in enumerate(robot.parameters):
            step = np.eye(len(v))[k] * p.sigma
            numeric = _derivative(lambda s, step=step, v=v: robot.pose(q, v + s * step), 0.1)  # type: ignore[misc]
            np.testing.assert_allclose(jacobian[..., k] * p.sigma, numeric, rtol=0, atol=1e-7, err_msg=p.name)
    np.testing.assert_array_equal(robot.parameter_jacobian(q), robot.parameter_jacobian(q, np.zeros(len(values))))


def test_corrections_are_built_in(robot: Robot) -> None:
    q, values = _drawn(robot)
    built = robot.corrected(values)
    assert [p.name for p in built.parameters] == [p.name for p in robot.parameters]
    for what in ("joint_jacobian", "parameter_jacobian", "joint_noise"):
        np.testing.assert_allclose(getattr(built, what)(q), getattr(robot, what)(q, values), rtol=1e-9, atol=1e-9)
    np.testing.assert_allclose(built.pose(q).matrix, robot.pose(q, values).matrix, rtol=0, atol=ATOL_POSE)
    back = built.corrected(-values).pose(q)
    np.testing.assert_allclose(back.matrix, robot.pose(q).matrix, rtol=0, atol=ATOL_POSE)


def test_every_robot_is_one(robot: Robot) -> None:
    q, values = _drawn(robot)
    assert isinstance(robot, Robot)
    assert len({p.name for p in robot.parameters}) == len(robot.parameters)
    assert all(p.sigma > 0 for p in robot.parameters)
    assert robot.within_limits(q).shape == (3,)
    pose, jacobian = require_arm(robot).pose_and_jacobian(q, values)
    if isinstance(robot, Inverted):
        jacobian, pose = -pose.adjoint @ jacobian, pose.inverse()
    np.testing.assert_array_equal(pose.matrix, robot.pose(q, values).matrix)
    np.testing.assert_array_equal(jacobian, robot.joint_jacobian(q, values))
    noise = robot.joint_noise(q, values)
    assert np.all(np.linalg.eigvalsh(noise) > -1e-12)
    with pytest.raises(InputError, match="uncertain parameters") as refused:
        robot.pose(q, np.zeros(len(values) + 1))
    pinned(str(refused.value))


def test_hands_that_a_decorated_arm_reaches_are_found() -> None:
    """Inverse kinematics takes any arm; the table alone would miss by what gravity and the gear do."""
    robot = Eccentric(Compliant(six_axis_arm(), LOAD)).corrected(_eccentricity(1e-3))
    rng = np.random.default_rng(3)
    goals = robot.pose(rng.uniform(-1, 1, (10, 6)))
    found = inverse_kinematics(robot, goals, rng)
    pinned(found)
    assert np.all(found.converged)
    np.testing.assert_allclose(robot.pose(found.joints).t, goals.t, rtol=0, atol=1e-8)
    assert np.all(np.linalg.norm(robot.dh_part().pose(found.joints).t - goals.t, axis=-1) > 0.05)


def _eccentricity(sine: float) -> np.ndarray:
    robot = Eccentric(Compliant(six_axis_arm(), LOAD))
    return np.array([sine if p.name == "sine2" else 0.0 for p in robot.parameters])


def test_parameters_have_names_units_and_groups() -> None:
    robot = Compliant(arm(), LOAD, SIGMA_PER_NM)
    names = [p.name for p in robot.parameters]
    assert names[:7] == ["theta1", "theta2", "theta3", "theta4", "theta5", "theta6", "d1"]
    assert names[24:] == ["beta2", *(f"compliance{i}" for i in range(1, 7))]
    found = {p.name: p for p in robot.parameters}
    assert (found["alpha4"].symbol, found["alpha4"].joint, found["alpha4"].unit) == ("α4", 4, "rad")
    assert (found["beta2"].symbol, found["d2"].symbol, found["d2"].unit) == ("β2", "d2", "mm")
    assert (found["compliance3"].group, found["compliance3"].unit) == ("compliance", "rad/Nm")
    assert found["theta1"].sigma == RobotUncertainty().theta_sigma_rad


def test_numbers_that_are_known_are_no_parameters() -> None:
    exact = replace(six_axis_arm(), uncertainty=RobotUncertainty(0.0, 0.0, 0.0, 0.1, 0.0))
    assert [p.name for p in exact.parameters] == [f"a{i}" for i in range(1, 7)]
    assert with_beta_prior(with_beta_prior(exact, 1e-3), 0.0).parameters == exact.parameters


@pytest.mark.parametrize("convention", ["standard", "modified"])
def test_beta_is_uncertain_at_parallel_axes_alone(convention: str) -> None:
    """The last α of a standard table, the first of a modified one, joins no two joints."""
    robot = DhRobot.from_dh(np.zeros(4), [1.0] * 4, [100.0] * 4, [0.0, 0.001, 1.5, 0.0], convention=convention)
    beta = [p.joint for p in with_beta_prior(robot, 1e-3).parameters if p.group == "beta"]
    assert beta == ([1, 2] if convention == "standard" else [2, 4])


def test_a_beta_prior_reaches_through_decorators() -> None:
    inside = Corrected(six_axis_arm(), draw_errors(six_axis_arm(), np.random.default_rng(1)))
    robot = Compliant(Eccentric(inside), LOAD, 1e-6)
    more = with_beta_prior(robot, 1e-3)
    assert {p.name for p in more.parameters} - {p.name for p in robot.parameters} == {"beta2"}
    q = np.full((1, 6), 0.3)
    np.testing.assert_allclose(more.pose(q).matrix, robot.pose(q).matrix, rtol=0, atol=ATOL_POSE)


def test_errors_are_drawn_row_by_row_of_the_table() -> None:
    """The same numbers whatever is taken as known, and those of a table alone when a decorator adds its own."""
    robot = six_axis_arm()
    z = np.random.default_rng(5).normal(size=(5, 6))
    u = robot.uncertainty
    rows = table(robot, draw_errors(robot, np.random.default_rng(5)))
    sigma = {"theta": u.theta_sigma_rad, "d": u.d_sigma_mm, "a": u.a_sigma_mm, "alpha": u.alpha_sigma_rad}
    for name, number in zip(sigma, z, strict=False):
        np.testing.assert_array_equal(rows[name], number * sigma[name])
    assert not np.any(rows["beta"])
    more = table(Compliant(robot, LOAD, 1e-6), draw_errors(Compliant(robot, LOAD, 1e-6), np.random.default_rng(5)))
    np.testing.assert_array_equal(more["alpha"], rows["alpha"])
    assert more["compliance"].shape == (6,)


def test_given_poses_stand_by_their_numbers() -> None:
    rng = np.random.default_rng(0)
    poses, noise = Pose.exp(rng.normal(size=(4, 6))), np.diag([1.0, 2, 3, 4, 5, 6])
    robot: Robot = GivenPoses(poses, noise)
    q = robot.readings[[2, 0]]  # type: ignore[attr-defined]
    np.testing.assert_array_equal(robot.pose(q).t, poses.t[[2, 0]])
    np.testing.assert_array_equal(robot.joint_noise(q), np.stack([noise, noise]))
    assert robot.parameter_jacobian(q, np.zeros(0)).shape == (2, 6, 0)
    assert not np.any(robot.joint_jacobian(q))
    assert robot.within_limits([[3], [4], [0.5]]).tolist() == [True, False, False]
    assert with_beta_prior(robot, 1e-3) is robot
    assert draw_errors(robot, rng).shape == (0,)
    with pytest.raises(InputError, match="by their numbers, 0 to 3") as refused:
        robot.pose([[4.0]])
    pinned(str(refused.value))
    with pytest.raises(InputError, match="need joint readings") as refused:
        robot.corrected([1.0])
    pinned(str(refused.value))
    with pytest.raises(InputError, match="known by its hand poses alone") as refused:
        require_arm(robot)
    pinned(str(refused.value))
    same = Corrected(robot, np.zeros(0))
    np.testing.assert_array_equal(same.pose(q).t, poses.t[[2, 0]])


def test_a_table_is_changed_by_the_names_of_its_rows() -> None:
    robot = six_axis_arm().with_changes(d=[0, 0, 0, 1.5, 0, 0])
    assert robot.d[3] == 1143.5
    with pytest.raises(InputError, match="not delta") as refused:
        robot.with_changes(delta=np.zeros(6))
    pinned(str(refused.value))


@pytest.mark.parametrize("plain", [arm(), Inverted(arm()), Compliant(arm(), LOAD, SIGMA_PER_NM)])
def test_scales_of_readings_come_and_go(plain: Robot) -> None:
    """An arm seen from its hand stays one; a scale of 1 % turns each joint by 1 % of its reading."""
    q, _ = _drawn(plain)
    scaled = with_reading_scales(plain)
    assert with_reading_scales(scaled) is scaled
    assert type(without_reading_scales(scaled)) is type(plain)
    assert without_reading_scales(plain) is plain
    assert isinstance(scaled, Inverted) == isinstance(plain, Inverted)
    assert [p.sigma for p in scaled.parameters[len(plain.parameters) :]] == [0.0] * plain.n_joints
    values = np.zeros(len(scaled.parameters))
    values[-plain.n_joints :] = [0.01, 0.0, 0.0, 0.0, -0.01, 0.0]
    turned = q * (1 + values[-plain.n_joints :])
    np.testing.assert_allclose(scaled.pose(q, values).matrix, plain.pose(turned).matrix, rtol=0, atol=ATOL_POSE)
