"""Evidence beside the points: derivatives against the complex step, truth recovered, σ true, and what is refused."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from calib import CalibConfig, CalibrationResult, calibrate
from calib.bundle import DistanceBetween, Evidence, SeatedTool, TrackedPoint
from calib.printed import nees
from calib.synthetic.cell import Noise, SyntheticCell, made_cell, observe, random_cell
from calib.synthetic.problem import made_problem, true_jigs
from calib.synthetic.surfaces import ProfileNoise, observe_surface, surface_cell
from geometry import DhRobot, InputError, Pose, State, Step
from jig_cad import Sphere
from tests.calib.test_jacobians import _hand, _small
from tests.pinned import pinned

STEP, RTOL = 1e-30, 1e-9
REFLECTOR = np.array([30.0, -45.0, 120.0])  # in the hand
TRACKER = Pose.exp(np.array([3500.0, -800.0, 400.0, 0.4, -0.3, 2.0]))  # T_tracker_base
NEES_LIMIT = 22.5  # of six numbers: 1 in 1,000


def _readings(rng: np.random.Generator, count: int) -> np.ndarray:
    middle = np.deg2rad([0.0, 20.0, 10.0, 0.0, 40.0, 0.0])
    return middle + rng.uniform(-1, 1, (count, 6)) * np.deg2rad([60.0, 30.0, 30.0, 90.0, 40.0, 90.0])


def _tracked(rng: np.random.Generator, true_arm: DhRobot, count: int = 25, sigma: float = 0.02) -> TrackedPoint:
    q = _readings(rng, count)
    truly = q + rng.normal(size=q.shape) * true_arm.uncertainty.joint_sigma_rad
    seen = TRACKER @ (true_arm.pose(truly) @ REFLECTOR)
    return TrackedPoint("reflector", q, seen + rng.normal(size=seen.shape) * sigma, sigma)


def _seated(rng: np.random.Generator, true_arm: DhRobot) -> SeatedTool:
    """Twelve readings in each of three sockets, by turning the wrist about the ball: found by least squares."""
    joints, sockets = [], []
    for k, start in enumerate(_readings(rng, 3)):
        place = true_arm.pose(start) @ REFLECTOR
        while sum(s == k for s in sockets) < 12:
            q = start + rng.uniform(-0.5, 0.5, 6)
            for _ in range(20):
                hand, jacobian = true_arm.pose_and_jacobian(q)
                off = hand @ REFLECTOR - place
                moved = hand.R @ np.hstack([np.eye(3), -_cross(REFLECTOR)]) @ jacobian
                q = q - np.linalg.lstsq(moved, off, rcond=None)[0]
            if np.linalg.norm(true_arm.pose(q) @ REFLECTOR - place) < 1e-6:
                joints.append(q)
                sockets.append(k)
    read = np.array(joints) - rng.normal(size=(36, 6)) * true_arm.uncertainty.joint_sigma_rad
    return SeatedTool(read, np.array(sockets), ("one", "two", "three"))


def _cross(v: np.ndarray) -> np.ndarray:
    return np.array([[0, -v[2], v[1]], [v[2], 0, -v[0]], [-v[1], v[0], 0]])


def _moved(bundle, state: State, rng: np.random.Generator) -> State:
    """The state with every common unknown a little off."""
    u = bundle.unknowns
    scale = np.where(np.isfinite(u.sigma) & (u.sigma > 0), u.sigma, 1e-2)
    return state.moved(u, Step(rng.normal(size=u.size) * scale, {"target": rng.normal(size=(3, 6)) * 1e-2}, 0.0))


@pytest.mark.parametrize("kind", ["tracker", "sockets"])
def test_readings_jacobians_equal_the_complex_step(kind: str) -> None:
    """At a state away from the nominal in every unknown, by a chain of complex matrices written out in full."""
    rng = np.random.default_rng(1)
    plain, cell, made = made_problem(1, Noise())
    more: Evidence = _tracked(rng, cell.robot, 6) if kind == "tracker" else _seated(rng, cell.robot)
    bundle = plain.with_evidence([more])
    state = _moved(bundle, bundle.start(cell.design, true_jigs(made)), rng)
    (term,) = bundle.further
    lin = term.linearise(state)
    robot = bundle.hands.robot
    rows = ["theta", "d", "a", "alpha", "beta"]

    def residual(k: int, xi: dict[str, np.ndarray]) -> np.ndarray:
        delta = np.zeros((5, 6), dtype=complex)
        for p, v in zip(robot.parameters, state.vector("robot") + xi["robot"], strict=True):
            delta[rows.index(p.group), p.joint - 1] = v
        hand = _hand(robot, more.joints_rad[k], delta)
        if isinstance(more, TrackedPoint):
            point = np.append(state.vector("tracker: reflector") + xi["tracker: reflector"], 1)
            frame = state.pose("tracker").matrix @ _small(xi["tracker"])
            return (frame @ hand @ point)[:3] - more.xyz_mm[k]
        point = np.append(state.vector("ball") + xi["ball"], 1)
        place = (state.vector("sockets") + xi["sockets"]).reshape(-1, 3)[more.socket[k]]
        return (hand @ point)[:3] - place

    sizes = {b.name: b.size for b in (*more.blocks(plain), plain.unknowns.block("robot"))}
    for k in (0, 3, len(more.joints_rad) - 1):
        still = {n: np.zeros(m, dtype=complex) for n, m in sizes.items()}
        np.testing.assert_allclose(lin.residual[k], residual(k, still).real, rtol=0, atol=1e-9)
        for name, size in sizes.items():
            numeric = np.empty((3, size))
            for i in range(size):
                xi = {n: np.zeros(m, dtype=complex) for n, m in sizes.items()}
                xi[name][i] = 1j * STEP
                numeric[:, i] = residual(k, xi).imag / STEP
            atol = RTOL * max(float(np.max(np.abs(numeric))), 1.0)
            np.testing.assert_allclose(lin.jacobian[name][k], numeric, rtol=0, atol=atol, err_msg=name)


def test_a_distances_jacobians_are_derivatives() -> None:
    """By central differences of every unknown that it meets."""
    rng = np.random.default_rng(2)
    plain, cell, made = made_problem(2, Noise())
    bundle = plain.with_evidence([DistanceBetween("A", "C", 800.0)])
    state = _moved(bundle, bundle.start(cell.design, true_jigs(made)), rng)
    (term,) = bundle.further
    lin = term.linearise(state)
    ends = [b.name for b in bundle.evidence[0].blocks(plain)]
    for name in ends:
        for i in range(3):
            step = np.eye(3)[i] * 1e-3
            ahead, behind = (
                term.linearise(state.with_value(name, state.vector(name) + s * step)).residual for s in (1, -1)
            )
            np.testing.assert_allclose(lin.jacobian[name][..., i], (ahead - behind) / 2e-3, rtol=0, atol=1e-6)
    poses = state.pose("target")
    for group, member in ((0, 0), (1, 2)):
        assert lin.member["target"][group] == member
        for i in range(6):
            moved = [poses[m] for m in range(3)]
            moved[member] = moved[member] @ Pose.exp(np.eye(6)[i] * 1e-4)
            pose = Pose(np.stack([m.R for m in moved]), np.stack([m.t for m in moved]))
            change = term.linearise(state.with_value("target", pose)).residual - lin.residual
            np.testing.assert_allclose(lin.jacobian["target"][group, :, i], change[group] / 1e-4, rtol=0, atol=1e-3)


def _solved(seed: int, evidence: str) -> tuple[SyntheticCell, CalibrationResult, CalibrationResult]:
    rng = np.random.default_rng(seed)
    cell = random_cell(rng)
    made = made_cell(cell, rng, Noise())
    observed = observe(cell, made, rng, Noise())
    more = [_tracked(rng, made.robot)] if evidence == "tracker" else [_seated(rng, made.robot)]
    args = (observed.frames, cell.jig, cell.robot, observed.sensor, observed.design, observed.places)
    plain = calibrate(*args, CalibConfig(model="full"))
    return made, plain, calibrate(*args, CalibConfig(model="full"), evidence=more)


def _shape_error(robot: DhRobot, made: DhRobot) -> float:
    """Rms of positions elsewhere after the best rigid motion: θ1, d1 and the base are nobody's to tell."""
    q = _readings(np.random.default_rng(99), 200)
    a, b = (r.pose(q) @ REFLECTOR for r in (robot, made))
    a, b = a - a.mean(axis=0), b - b.mean(axis=0)
    u, _, vt = np.linalg.svd(a.T @ b)
    turn = u @ np.diag([1, 1, np.sign(np.linalg.det(u @ vt))]) @ vt
    return float(np.sqrt(np.mean(np.sum((a @ turn - b) ** 2, axis=1))))


@pytest.mark.parametrize(
    ("evidence", "seed"), [("tracker", 1), ("sockets", 1), pytest.param("tracker", 2, marks=pytest.mark.slow)]
)
def test_the_robot_is_known_better_and_sigma_holds(evidence: str, seed: int) -> None:
    """The table's σ shrink, the SCP lies within its own. A tracker that saw the arm's whole space tells its shape:
    positions elsewhere come nearer to the made arm's by a third; sockets at three places tell less than one draw shows.
    """
    made, plain, more = _solved(seed, evidence)
    assert more.verdict.trustworthy, more.verdict.text
    assert nees(made.T_hand_sensor, more.T_hand_sensor, more.covariance) < NEES_LIMIT
    before, after = (_shape_error(r.robot, made.robot) for r in (plain, more))
    assert after < (0.7 if evidence == "tracker" else 1.2) * before
    sigma = [np.linalg.norm(r.estimate.robot_sigma) for r in (plain, more)]
    assert sigma[1] < sigma[0]
    assert 0.6 < more.chi2_per_dof < 1.6


def test_a_known_distance_between_balls_holds_the_scale() -> None:
    """The places of two balls come out nearer to what is known than without it, where the arm's own errors show."""
    noise, off = ProfileNoise(), {False: 0.0, True: 0.0}
    for seed in (4, 5):
        rng = np.random.default_rng(seed)
        cell = surface_cell(Sphere(40.0), rng, noise=noise)
        observed = observe_surface(cell, rng, noise, points=60)
        truth = float(np.linalg.norm(cell.T_base_target["A"].t - cell.T_base_target["B"].t))
        model = CalibConfig(model="full")
        args = (observed.frames, cell.target, cell.robot, observed.sensor, observed.design, None, model)
        for known in (False, True):
            result = calibrate(*args, evidence=[DistanceBetween("A", "B", truth, 0.02)] if known else [])
            pinned(result)
            assert result.verdict.trustworthy, result.verdict.text
            assert nees(cell.T_hand_sensor, result.T_hand_sensor, result.covariance) < NEES_LIMIT
            a, b = (np.array(result.locations[n].surface["centre_mm"]) for n in ("A", "B"))
            off[known] = max(off[known], abs(float(np.linalg.norm(a - b)) - truth))
    assert off[True] < 0.7 * off[False]  # the figures place each ball by its own location's frames alone


@pytest.mark.parametrize(("evidence", "off_mm"), [("tracker", 1.0), ("tracker", 3000.0), ("sockets", 3.0)])
def test_a_wrong_row_is_left_out_and_named(evidence: str, off_mm: float) -> None:
    """The answer is that without the row, to the last digit, and a remark says which and how far off it is.

    A socket's reading is off by what its first joint moves the ball by.
    """
    rng = np.random.default_rng(6)
    cell = random_cell(rng)
    made = made_cell(cell, rng, Noise())
    observed = observe(cell, made, rng, Noise())
    seen = _tracked(rng, made.robot) if evidence == "tracker" else _seated(rng, made.robot)
    without = seen.without(11)
    if isinstance(seen, TrackedPoint):
        seen.xyz_mm[11] += [0.0, off_mm, 0.0]
        name = "position 12 of the tracked point reflector"
    else:
        seen.joints_rad[11, 0] += off_mm / np.hypot(*(made.robot.pose(seen.joints_rad[11]) @ REFLECTOR)[:2])
        name = "reading 12 of socket one"
    args = (observed.frames, cell.jig, cell.robot, observed.sensor, observed.design)
    result, right = (calibrate(*args, evidence=[e]) for e in (seen, without))
    assert result.verdict.code == "ok", result.verdict.text
    (words,) = [w for w in result.remarks if "[evidence]" in w]
    assert words.startswith(name)
    told = float(words.split(" mm from")[0].split()[-1])
    assert abs(told - off_mm) < 0.3 + 0.05 * off_mm
    np.testing.assert_array_equal(result.T_hand_sensor.matrix, right.T_hand_sensor.matrix)
    np.testing.assert_array_equal(result.covariance, right.covariance)


def test_what_nothing_overrules() -> None:
    """A distance that is 5 mm off is one number against the frames: withheld. With every third row off a tracker is
    none: the answer is that without it.
    """
    rng = np.random.default_rng(6)
    cell = random_cell(rng)
    made = made_cell(cell, rng, Noise())
    observed = observe(cell, made, rng, Noise())
    seen = _tracked(rng, made.robot)
    seen.xyz_mm[::3] += rng.normal(size=(9, 3)) * 20.0
    apart = float(np.linalg.norm(cell.T_base_jig["A"].t - cell.T_base_jig["B"].t))
    args = (observed.frames, cell.jig, cell.robot, observed.sensor, observed.design)
    result = calibrate(*args, evidence=[DistanceBetween("A", "B", apart + 5.0)])
    pinned(result)
    assert not result.verdict.trustworthy
    assert "the distance from A" in result.verdict.text
    assert result.covariance is None
    result, without = calibrate(*args, evidence=[seen]), calibrate(*args)
    pinned((result, without))
    assert any("of the tracked point" in w and "none of them was used" in w for w in result.remarks)
    np.testing.assert_array_equal(result.covariance, without.covariance)


def test_a_wrong_distance_of_balls_is_not_laid_on_the_robot() -> None:
    """3 mm more than the balls are apart would take a robot 20 times worse than stated."""
    rng = np.random.default_rng(3)
    cell = surface_cell(Sphere(40.0), rng, (("A", "calibrate", 7), ("B", "calibrate", 7)))
    observed = observe_surface(cell, rng, ProfileNoise())
    apart = float(np.linalg.norm(cell.T_base_target["A"].t - cell.T_base_target["B"].t))
    args = (observed.frames, cell.target, cell.robot, observed.sensor, observed.design)
    result = calibrate(*args, evidence=[DistanceBetween("A", "B", apart + 3.0)])
    assert result.verdict.code == "priors_contradict"
    assert result.verdict.text.startswith("the distance from A to B")
    assert result.covariance is None
    assert calibrate(*args, evidence=[DistanceBetween("A", "B", apart)]).verdict.trustworthy


def test_what_can_not_be_used_is_refused() -> None:
    cell = random_cell(np.random.default_rng(4))
    rng = np.random.default_rng(4)
    observed = observe(cell, cell, rng, Noise(robot=False, anchors=False))
    poses = tuple(replace(f, joints_rad=None, T_base_hand=cell.robot.pose(f.joints_rad)) for f in observed.frames)
    seen = _tracked(rng, cell.robot)
    with pytest.raises(InputError, match="needs the robot's table") as refused:
        calibrate(poses, cell.jig, None, observed.sensor, observed.design, evidence=[seen])
    pinned(str(refused.value))
    with pytest.raises(InputError, match="4 or more are needed") as refused:
        TrackedPoint("few", np.zeros((2, 6)), np.zeros((2, 3)))
    pinned(str(refused.value))
    with pytest.raises(InputError, match="two or more are needed") as refused:
        SeatedTool(np.zeros((3, 6)), np.array([0, 0, 1]), ("one", "two"))
    pinned(str(refused.value))
    with pytest.raises(InputError, match="tells nothing") as refused:
        DistanceBetween("A", "A", 100.0)
    pinned(str(refused.value))
    with pytest.raises(InputError, match="must be positive") as refused:
        DistanceBetween("A", "B", -100.0)
    pinned(str(refused.value))
