"""The bundle's analytic Jacobians against the complex step."""

from __future__ import annotations

import numpy as np
import pytest

from calib.bundle.linearise import State, initial_state, linearise, moved
from calib.bundle.problem import Problem
from calib.synthetic.cell import Noise
from calib.synthetic.problem import made_problem, true_jigs
from geometry import PARAMETERS, DhRobot

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
        getattr(robot, "theta_offset" if name == "theta" else name) + delta[i] for i, name in enumerate(PARAMETERS)
    )
    for i in range(robot.n_joints):
        c, s = np.cos(q[i] + theta[i]), np.sin(q[i] + theta[i])
        ca, sa, cb, sb = np.cos(alpha[i]), np.sin(alpha[i]), np.cos(beta[i]), np.sin(beta[i])
        rz = np.array([[c, -s, 0, 0], [s, c, 0, 0], [0, 0, 1, d[i]], [0, 0, 0, 1]])
        rx = np.array([[1, 0, 0, a[i]], [0, ca, -sa, 0], [0, sa, ca, 0], [0, 0, 0, 1]])
        ry = np.array([[cb, 0, sb, 0], [0, 1, 0, 0], [-sb, 0, cb, 0], [0, 0, 0, 1]])
        T = T @ rz @ rx @ ry
    return T


def _predict(problem: Problem, state: State, frame: int, xi: np.ndarray) -> np.ndarray:
    """Crossings (M, 2) of one frame, all unknowns moved by ``xi`` = SCP 6, jig 6, hand 6, anchors 12, robot 30."""
    robot, joints = problem.chain.robot, problem.chain.joints_rad
    assert robot is not None
    assert joints is not None
    delta = np.zeros((5, 6))
    delta[problem.chain.parameters[:, 0], problem.chain.parameters[:, 1]] = state.parameters
    hand = _hand(robot, joints[frame], delta + xi[30:].reshape(5, 6)) @ _small(xi[12:18])
    jig = state.Ts_base_jig[problem.location][frame].matrix @ _small(xi[6:12])
    anchors = problem.anchors_mm.astype(complex)
    anchors[:, 1:] += state.anchors + xi[18:30].reshape(6, 2)
    to_sensor = np.linalg.inv(hand @ state.T_hand_sensor.matrix @ _small(xi[:6])) @ jig
    points = anchors @ to_sensor[:3, :3].T + to_sensor[:3, 3]
    starts, ends = problem.points.start_weights[frame] @ points, problem.points.end_weights[frame] @ points
    s = -starts[:, :1] / (ends - starts)[:, :1]
    return (starts + s * (ends - starts))[:, 1:]


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_bundle_jacobians_equal_the_complex_step(seed: int) -> None:
    """At a state away from the nominal in every unknown; proves nothing about convergence."""
    rng = np.random.default_rng(seed)
    problem, cell, made = made_problem(seed, Noise())
    state = initial_state(problem, cell.design, true_jigs(made))
    state = moved(
        problem, state, rng.normal(size=6) * 1e-2, rng.normal(size=(3, 6)) * 1e-2, rng.normal(size=24) * 1e-3,
        rng.normal(size=12) * 0.03,
    )  # fmt: skip
    lin = linearise(problem, state)
    for frame in (0, 8, 20):
        complex_step = np.empty((5, 2, 60))
        for k in range(60):
            xi = np.zeros(60, dtype=complex)
            xi[k] = 1j * STEP
            complex_step[..., k] = _predict(problem, state, frame, xi).imag / STEP
        rows, joints = problem.chain.parameters.T
        robot = complex_step[..., 30:].reshape(5, 2, 5, 6)[..., rows, joints]
        for analytic, numeric in (
            (lin.scp[frame], complex_step[..., :6]),
            (lin.jig[frame], complex_step[..., 6:12]),
            (lin.hand[frame], complex_step[..., 12:18]),
            (lin.anchors[frame], complex_step[..., 18:30]),
            (lin.hand[frame] @ lin.parameters[frame], robot),
        ):
            np.testing.assert_allclose(analytic, numeric, rtol=0, atol=RTOL * np.max(np.abs(numeric)))


def test_predicted_points_are_those_of_the_cell() -> None:
    """At the truth of a cell without noise the residuals vanish: the generator and the solver agree on the geometry."""
    problem, cell, made = made_problem(4, Noise(point_mm=0.0, joint_rad=0.0, robot=False, anchors=False))
    state = initial_state(problem, cell.T_hand_sensor, true_jigs(made))
    assert np.max(np.abs(linearise(problem, state).residual)) < 1e-9
