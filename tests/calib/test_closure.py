"""Fixed-point closure on synthetic and on recorded sockets."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from calib.closure.judge import Socket, closure, held_out_rms
from calib.closure.terms import closure_problem, solve_closure
from calib.synthetic.cell import industrial_arm
from geometry import DhRobot, draw_errors
from tests.pinned import pinned
from tests.recordings import MISSING, recording

RECORDED = recording("real/socket_closure/data")
QUARTER = np.pi / 2


def panda() -> DhRobot:
    """Franka's published modified DH table with the flange."""
    alpha = np.array([0, -1, 1, 1, -1, 1, 1]) * QUARTER
    a, d = [0, 0, 0, 82.5, -82.5, 0, 88], [333, 0, 316, 0, 384, 0, 107]
    return DhRobot.from_dh(np.zeros(7), d, a, alpha, convention="modified")


def iiwa() -> DhRobot:
    """KUKA LBR iiwa 14 R820, modified DH."""
    alpha = np.array([0, -1, 1, 1, -1, -1, 1]) * QUARTER
    return DhRobot.from_dh(np.zeros(7), [360, 0, 420, 0, 400, 0, 126], np.zeros(7), alpha, convention="modified")


def recorded(name: str) -> list[Socket]:
    """All sockets of a recorded robot."""
    if not RECORDED.is_dir():
        pytest.skip(MISSING)
    files = sorted((RECORDED / name).glob("*/hole_?.csv"))
    return [Socket(f.parent.name, f.stem, np.loadtxt(f, delimiter=",")) for f in files]


def synthetic(rng: np.random.Generator, robot: DhRobot, tool: np.ndarray) -> list[Socket]:
    """Exact configurations of three locations with two sockets 50 mm apart (Newton on the joints)."""
    out = []
    for k in range(3):
        q0 = np.array([0.0, 0.0, 0.6, 0.0, -0.8, 0.0]) + rng.uniform(-0.4, 0.4, 6)
        first = robot.pose(q0) @ tool
        for side in (0, 1):
            goal, rows = first + side * 50.0 * -first / np.linalg.norm(first), []
            for _ in range(60):
                q = q0 + rng.uniform(-0.6, 0.6, 6)
                for _ in range(12):
                    hand = robot.pose(q)
                    lever = np.cross(np.eye(3), tool).T
                    jacobian = hand.R @ np.concatenate([np.eye(3), lever], 1) @ robot.joint_jacobian(q)
                    q = q + np.linalg.pinv(jacobian) @ (goal - hand @ tool)
                if np.linalg.norm(goal - robot.pose(q) @ tool) < 1e-9:
                    rows.append(q)
            out.append(Socket(f"place {k}", f"hole_{side}", np.array(rows)))
    return out


def test_exact_sockets_give_the_tool_and_close() -> None:
    """With the true robot the tool's point comes back exactly."""
    tool = np.array([10.0, -20.0, 140.0])
    sockets = synthetic(np.random.default_rng(1), industrial_arm(), tool)
    problem = closure_problem(sockets, industrial_arm(), 50.0, 1.0, 0.1)
    fit = solve_closure(problem, np.zeros(len(problem.prior_sigma), dtype=bool))
    np.testing.assert_allclose(fit.tool_mm, tool, atol=1e-6)
    assert fit.rms_mm < 1e-6


def test_wrong_robot_is_corrected() -> None:
    rng = np.random.default_rng(2)
    made = industrial_arm().corrected(5 * draw_errors(industrial_arm(), rng))
    sockets = synthetic(rng, made, np.array([10.0, -20.0, 140.0]))
    result = closure(sockets, industrial_arm(), 50.0, prior_scale=5.0)
    pinned(result)
    assert result.gains
    assert result.calibrated.rms_mm < 0.02 * result.nominal.rms_mm


@pytest.mark.parametrize(
    ("name", "robot", "last", "reach_mm"),
    [("panda_1", panda, "right", 0.9), ("panda_2", panda, "mid_right", 0.27), ("panda_3", panda, "frontright", 0.27)],
)
def test_recorded_pandas_close_where_they_were_not_fitted(name: str, robot, last: str, reach_mm: float) -> None:  # type: ignore[no-untyped-def]
    """The last location is held out, as in the reference fit of the data's description."""
    sockets = recorded(name)
    problem = closure_problem([s for s in sockets if s.location != last], robot(), 50.0, 3.0, 0.1)
    fit = solve_closure(problem, np.ones(len(problem.prior_sigma), dtype=bool))
    pinned(fit)
    assert held_out_rms(fit, [s for s in sockets if s.location == last]) < reach_mm


def test_recorded_iiwa_gains_nothing_from_the_larger_model() -> None:
    result = closure(recorded("kuka_14"), iiwa(), 50.0)
    pinned(result)
    assert not result.gains
    assert "no gain from the larger model" in result.text


def test_recorded_panda_gains_everywhere() -> None:
    result = closure(recorded("panda_3"), panda(), 50.0)
    pinned(result)
    assert result.gains
    assert max(h.calibrated_mm for h in result.held_out) < 0.27


@pytest.fixture(scope="module")
def seated() -> list[Socket]:
    """Sockets of an arm with errors of its stated size, joints that repeat to 0.003° and seats of 0.1 mm."""
    rng = np.random.default_rng(8)
    made = industrial_arm().corrected(draw_errors(industrial_arm(), rng))
    exact = synthetic(rng, made, np.array([10.0, -20.0, 140.0]))
    return [Socket(s.location, s.name, s.joints_rad + rng.normal(size=s.joints_rad.shape) * 1e-4) for s in exact]


@pytest.mark.parametrize(("distance_mm", "right"), [(50.0, True), (55.0, False), (49.0, False)])
def test_a_wrong_distance_is_named(seated: list[Socket], distance_mm: float, right: bool) -> None:
    """It pulls the robot's lengths by many σ while the sockets still close."""
    result = closure(seated, industrial_arm(), distance_mm)
    pinned(result)
    assert result.trustworthy == right
    if not right:
        assert result.code == "distance_contradicts"
        assert f"not {distance_mm:g}" in result.text
        assert result.found_distance_mm is not None
        assert abs(result.found_distance_mm[0] - 50.0) < 4 * result.found_distance_mm[1]


def test_priors_count_in_chi2(seated: list[Socket]) -> None:
    """Departures from the priors are part of the cost, and cost no degree of freedom."""
    problem = closure_problem(seated, industrial_arm(), 55.0, 3.0, 0.1)
    fit = solve_closure(problem, np.ones(len(problem.prior_sigma), dtype=bool))
    pinned(fit)
    assert fit.cost > np.sum(fit.pulls**2) > 1000
    assert fit.chi2_per_dof > 2


def test_a_table_of_another_arm_is_named(seated: list[Socket]) -> None:
    """Another arm does not close at all; a length that is 30 mm wrong only by a pull."""
    other = industrial_arm().with_changes(a=np.array([0, 400.0, 0, 0, 0, 0]))
    assert closure(seated, other, 50.0).code == "robot_contradicts"
    wrong = industrial_arm().with_changes(a=np.array([0, 30.0, 0, 0, 0, 0]))
    result = closure(seated, wrong, 50.0)
    pinned(result)
    assert result.code == "priors_contradict"
    assert "the sockets close only if a2 is changed by -" in result.text


def test_sigma_of_predicted_positions_is_seen_at_locations_left_out(seated: list[Socket]) -> None:
    """Of both models, without what the locations left out widen; three locations tell a factor of two."""
    result = closure(seated, industrial_arm(), 50.0)
    pinned(result)
    for seen, expected in (("nominal_mm", "nominal_sigma_mm"), ("calibrated_mm", "calibrated_sigma_mm")):
        rms, sigma = (np.sqrt(np.mean([getattr(h, k) ** 2 for h in result.held_out])) for k in (seen, expected))
        assert 0.5 < rms / sigma < 2.0
    assert result.predicted_sigma_mm is not None
    missed = tuple(
        replace(h, nominal_mm=10 * h.nominal_sigma_mm, calibrated_mm=10 * h.nominal_sigma_mm) for h in result.held_out
    )
    wide = replace(result, held_out=missed)
    assert not wide.gains
    assert wide.widened == pytest.approx(10.0)
    np.testing.assert_allclose(wide.tool_covariance, 100 * result.nominal.tool_covariance)


@pytest.mark.parametrize("name", ["panda_3", "panda_4"])
def test_sigma_of_predicted_positions_on_recorded_arms(name: str) -> None:
    result = closure(recorded(name), panda(), 50.0)
    pinned(result)
    assert result.code == "ok"
    assert result.widened < 1.3
