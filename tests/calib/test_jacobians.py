"""Every term's analytic Jacobians against the complex step."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from calib.bundle.hands import Hands
from calib.bundle.problem import Bundle
from calib.closure.terms import KnownDistance, Seated
from calib.figures import OffsetsFromTarget
from calib.pose.own import SeenAlone
from calib.prediction import prediction_jacobian
from calib.sensor_errors import SensorErrors
from calib.synthetic.cell import Noise, default_sensor, industrial_arm
from calib.synthetic.problem import made_problem, true_jigs
from geometry import DhRobot, Pose, State, Step, exp_so3
from geometry.robot import DH_ROWS
from jig_cad import Jig

STEP = 1e-30
RTOL = 1e-9


def _skew(v: np.ndarray) -> np.ndarray:
    return np.array([[0, -v[2], v[1]], [v[2], 0, -v[0]], [-v[1], v[0], 0]])


def _small(xi: np.ndarray) -> np.ndarray:
    """First order of Exp as a 4 × 4 matrix: exact for an imaginary step of 1e-30."""
    out = np.eye(4, dtype=complex)
    out[:3, :3] += _skew(xi[3:])
    out[:3, 3] = xi[:3]
    return out


def _hand(robot: DhRobot, q: np.ndarray, delta: np.ndarray) -> np.ndarray:
    """Standard DH written out with 4 × 4 matrices of complex numbers."""
    T = np.eye(4, dtype=complex)
    theta, d, a, alpha, beta = (
        getattr(robot, "theta_offset" if name == "theta" else name) + delta[i]
        for i, name in enumerate(row.group for row in DH_ROWS)
    )
    for i in range(robot.n_joints):
        c, s = np.cos(q[i] + theta[i]), np.sin(q[i] + theta[i])
        ca, sa, cb, sb = np.cos(alpha[i]), np.sin(alpha[i]), np.cos(beta[i]), np.sin(beta[i])
        rz = np.array([[c, -s, 0, 0], [s, c, 0, 0], [0, 0, 1, d[i]], [0, 0, 0, 1]])
        rx = np.array([[1, 0, 0, a[i]], [0, ca, -sa, 0], [0, sa, ca, 0], [0, 0, 0, 1]])
        ry = np.array([[cb, 0, sb, 0], [0, 1, 0, 0], [-sb, 0, cb, 0], [0, 0, 0, 1]])
        T = T @ rz @ rx @ ry
    return T


def _blocks(bundle: Bundle, state: State, frame: int, xi: dict[str, np.ndarray]) -> np.ndarray:
    """Crossings (M, 2) of one frame, the unknowns moved by ``xi`` (and "hand", the hand's pose)."""
    robot, term, jig = bundle.hands.robot, bundle.term, bundle.target
    assert isinstance(robot, DhRobot)
    assert isinstance(jig, Jig)
    delta = np.zeros((5, 6), dtype=complex)
    rows = {row.group: i for i, row in enumerate(DH_ROWS)}
    for p, value in zip(robot.parameters, state.vector("robot") + xi["robot"], strict=True):
        delta[rows[p.group], p.joint - 1] = value
    hand = _hand(robot, bundle.hands.readings[frame], delta) @ _small(xi["hand"])
    place = state.pose("target")[int(term.member[frame])].matrix @ _small(xi["target"])
    anchors = jig.anchors_mm.astype(complex)
    anchors[:, 1:] += (state.vector("shape") + xi["shape"]).reshape(6, 2)
    to_sensor = np.linalg.inv(hand @ state.pose("scp").matrix @ _small(xi["scp"])) @ place
    points = anchors @ to_sensor[:3, :3].T + to_sensor[:3, 3]
    strings = term.points.feature[frame]
    starts, ends = points[jig.start_index[strings]], points[jig.end_index[strings]]
    s = -starts[:, :1] / (ends - starts)[:, :1]
    return (starts + s * (ends - starts))[:, 1:]


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_bundle_jacobians_equal_the_complex_step(seed: int) -> None:
    """At a state away from the nominal in every unknown; proves nothing about convergence."""
    rng = np.random.default_rng(seed)
    bundle, cell, made = made_problem(seed, Noise())
    step = Step(
        np.concatenate([rng.normal(size=6) * 1e-2, rng.normal(size=24) * 1e-3, rng.normal(size=12) * 0.03]),
        {"target": rng.normal(size=(3, 6)) * 1e-2},
        0.0,
    )
    state = bundle.start(cell.design, true_jigs(made)).moved(bundle.unknowns, step)
    lin = bundle.term.linearise(state)
    sizes = {"scp": 6, "robot": 24, "shape": 12, "target": 6, "hand": 6}
    for frame in (0, 8, 20):
        for name, size in sizes.items():
            numeric = np.empty((10, size))
            for k in range(size):
                xi = {n: np.zeros(m, dtype=complex) for n, m in sizes.items()}
                xi[name][k] = 1j * STEP
                numeric[:, k] = _blocks(bundle, state, frame, xi).imag.ravel() / STEP
            analytic = lin.by_hand[frame] if name == "hand" else lin.jacobian[name][frame]
            np.testing.assert_allclose(analytic, numeric, rtol=0, atol=RTOL * np.max(np.abs(numeric)), err_msg=name)


def test_a_frame_alone() -> None:
    """The pose's Jacobian of SeenAlone is that of the place in the bundle, whose sensor stands in the base."""
    bundle, cell, made = made_problem(5, Noise())
    T = bundle.term.T_sensor_target(bundle.start(cell.design, true_jigs(made)))
    lin = SeenAlone(bundle.term.points, bundle.target).linearise(State({"pose": T}))
    for frame in (0, 20):
        for k in range(6):
            xi = np.zeros(6, dtype=complex)
            xi[k] = 1j * STEP
            to_sensor = T[frame].matrix @ _small(xi)
            points = cell.jig.anchors_mm @ to_sensor[:3, :3].T + to_sensor[:3, 3]
            strings = bundle.term.points.feature[frame]
            a, b = points[cell.jig.start_index[strings]], points[cell.jig.end_index[strings]]
            numeric = ((a - a[:, :1] / (b - a)[:, :1] * (b - a))[:, 1:]).imag.ravel() / STEP
            np.testing.assert_allclose(
                lin.jacobian["pose"][frame, :, k], numeric, rtol=0, atol=1e-9 * abs(numeric).max()
            )


def test_offsets_of_points_in_the_base() -> None:
    """Perpendicular offsets, written out with complex matrices."""
    rng = np.random.default_rng(6)
    jig = Jig.nominal()
    T, feature = Pose(exp_so3(rng.normal(size=3)), rng.normal(size=3) * 100), np.arange(5)
    points = rng.normal(size=(5, 3)) * 50
    lin = OffsetsFromTarget(points, feature, jig).linearise(State({"target": T}))
    for k in range(6):
        xi = np.zeros(6, dtype=complex)
        xi[k] = 1j * STEP
        inverse = np.linalg.inv(T.matrix @ _small(xi))
        q = points @ inverse[:3, :3].T + inverse[:3, 3] - jig.starts
        along = np.sum(q * jig.directions, axis=1, keepdims=True)
        numeric = (q - along * jig.directions).imag / STEP
        np.testing.assert_allclose(lin.jacobian["target"][..., k], numeric, rtol=0, atol=1e-9 * np.abs(numeric).max())


def test_closure_jacobians_equal_the_complex_step() -> None:
    """Sockets, tool and robot of seated configurations, and the known distance between two sockets."""
    rng = np.random.default_rng(7)
    robot, q = industrial_arm(), rng.uniform(-1, 1, (4, 6))
    seated = Seated(Hands(robot, q), np.array([0, 0, 1, 1]), np.array([0, 1, 0, 0]), 0.1)
    values, tool, sockets = rng.normal(size=24) * 1e-3, rng.normal(size=3) * 50, rng.normal(size=(2, 6)) * 100
    state = State({"tool": tool, "robot": values, "excess": np.array([0.3]), "sockets": sockets})
    lin = seated.linearise(state)
    rows = {row.group: i for i, row in enumerate(DH_ROWS)}
    for name, size in (("tool", 3), ("robot", 24)):
        for k in range(size):
            moved = {"tool": tool.astype(complex), "robot": values.astype(complex)}
            moved[name][k] += 1j * STEP
            delta = np.zeros((5, 6), dtype=complex)
            for p, value in zip(robot.parameters, moved["robot"], strict=True):
                delta[rows[p.group], p.joint - 1] = value
            for i in range(4):
                T = _hand(robot, q[i], delta)
                numeric = (T[:3, :3] @ moved["tool"] + T[:3, 3]).imag / STEP
                atol = 1e-9 * max(np.max(np.abs(numeric)), 1.0)
                np.testing.assert_allclose(lin.jacobian[name][i, :, k], numeric, rtol=0, atol=atol)
    np.testing.assert_array_equal(lin.jacobian["sockets"][1, :, 3:], -np.eye(3))
    np.testing.assert_array_equal(lin.jacobian["sockets"][1, :, :3], np.zeros((3, 3)))
    distance = KnownDistance(np.array([True, True]), 50.0).linearise(state)
    for k in range(6):
        places = sockets.astype(complex)
        places[:, k] += 1j * STEP
        between = places[:, 3:] - places[:, :3]
        numeric = np.sqrt(np.sum(between**2, axis=1)).imag / STEP
        np.testing.assert_allclose(distance.jacobian["sockets"][:, 0, k], numeric, rtol=0, atol=1e-12)


def test_predicted_points_are_those_of_the_cell() -> None:
    """At the truth of a cell without noise the residuals vanish: the generator and the solver agree on the geometry."""
    bundle, cell, made = made_problem(4, Noise(point_mm=0.0, joint_rad=0.0, robot=False, anchors=False))
    assert np.max(np.abs(bundle.term.residual(bundle.start(cell.T_hand_sensor, true_jigs(made))))) < 1e-9


def test_sensor_errors_equal_finite_differences() -> None:
    """Away from rest in every unknown; the displaced points have tests of their own (test_sensor_deviation.py)."""
    rng = np.random.default_rng(4)
    plain, cell, made = made_problem(4, Noise())
    errors = SensorErrors.of(default_sensor(), estimated=True)
    assert errors is not None
    term = replace(plain.term, errors=errors)
    count = len(errors.labels)
    values = {"robot": rng.normal(size=24) * 1e-3, "shape": rng.normal(size=12) * 0.03}
    start = plain.start(cell.design, true_jigs(made))
    state = State({**start.values, **values, "sensor": rng.normal(size=count) * 0.1})
    lin = term.linearise(state)
    for k in range(count):
        step = 1e-4 * np.eye(count)[k]
        above, below = (state.with_value("sensor", state.vector("sensor") + s) for s in (step, -step))
        numeric = (term.residual(above) - term.residual(below)) / 2e-4
        np.testing.assert_allclose(lin.jacobian["sensor"][..., k], numeric, atol=1e-6 * np.max(np.abs(numeric)))
    place = state.with_value("target", state.pose("target") @ Pose.exp(np.array([0, 0, 1e-5, 0, 1e-6, 0])))
    moved = lin.jacobian["target"] @ np.array([0, 0, 1e-5, 0, 1e-6, 0])
    np.testing.assert_allclose(term.residual(place) - lin.residual, moved, atol=1e-9)


def test_predicted_points_move_as_differences_say() -> None:
    """By SCP and by every number of the arm's table."""
    rng, robot = np.random.default_rng(11), industrial_arm()
    T, q, yz = Pose.exp(rng.normal(size=6)), rng.uniform(-1, 1, (2, 6)), rng.uniform([-20, 250], [20, 350], (2, 3, 2))
    points = np.concatenate([np.zeros((2, 3, 1)), yz], -1)
    J = prediction_jacobian(T, robot, None, q, yz)
    step, free = 1e-6, len(robot.parameters)
    for k in range(6 + free):
        ends = []
        for sign in (step, -step):
            by_scp, by_robot = sign * np.eye(6 + free)[k, :6], sign * np.eye(6 + free)[k, 6:]
            ends.append((robot.corrected(by_robot).pose(q) @ (T @ Pose.exp(by_scp))) @ points)
        np.testing.assert_allclose(J[..., k], (ends[0] - ends[1]) / (2 * step), rtol=1e-6, atol=1e-6)
