"""Hand poses in place of joints: σ carry the errors of the robot's table, which all frames share."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import chi2

from calib import CalibConfig
from calib.configurations import standing
from calib.hands import with_joints
from calib.judge.verdict import Facts, Motion, judge
from calib.printed import gimbal_note, nees
from calib.synthetic.cell import CellFrames, Noise, SyntheticCell, calibrated, made_cell, observe, random_cell
from calib.synthetic.problem import CALIBRATE_ONLY
from calib.synthetic.surfaces import ProfileNoise, observe_surface, surface_cell
from geometry import ArmConfiguration, DhRobot, InputError, Pose
from jig_cad import Sphere
from tests.pinned import pinned

ATOL_MM = 1e-6
NEES_LIMIT = 30.0  # a sound covariance exceeds it in 4 of 100,000 runs


def _poses(cell: SyntheticCell, observed: CellFrames) -> CellFrames:
    """What a controller writes: poses by its nominal table."""
    frames = tuple(replace(f, joints_rad=None, T_base_hand=cell.robot.pose(f.joints_rad)) for f in observed.frames)
    return replace(observed, frames=frames)


def _draw(rng: np.random.Generator, cell: SyntheticCell) -> tuple[SyntheticCell, CellFrames]:
    made = made_cell(cell, rng, Noise())
    return made, _poses(cell, observe(cell, made, rng, Noise()))


@pytest.mark.parametrize("runs", [18, pytest.param(90, marks=pytest.mark.slow)])
def test_sigma_is_true_with_a_robot_table(runs: int) -> None:
    """Mean NEES of the draws within the 99.9 % interval of chi² (n = 6); no sound data set is refused.

    The cells' joints are drawn among all arm configurations, so that many frames get another solution's joints.
    """
    rng, errors = np.random.default_rng(21), []
    for i in range(runs):
        if i % 6 == 0:
            cell = random_cell(rng, CALIBRATE_ONLY)
        made, poses = _draw(rng, cell)
        result = calibrated(poses, cell.jig, cell.robot)
        assert result.verdict.trustworthy
        assert result.T_hand_sensor is not None
        assert result.covariance is not None
        errors.append(nees(made.T_hand_sensor, result.T_hand_sensor, result.covariance))
    low, high = chi2.ppf([0.0005, 0.9995], 6 * runs) / runs
    assert low < np.mean(errors) < high
    assert np.mean(np.array(errors) > chi2.isf(0.05, 6)) < 0.15 + 1 / runs


def test_joints_found_again_give_the_poses() -> None:
    cell = random_cell(np.random.default_rng(4), CALIBRATE_ONLY)
    _, poses = _draw(np.random.default_rng(5), cell)
    for f in with_joints(poses.frames, cell.robot):
        assert f.joints_inferred
        assert f.joints_rad is not None
        assert f.T_base_hand is not None
        np.testing.assert_allclose(cell.robot.pose(f.joints_rad).matrix, f.T_base_hand.matrix, atol=ATOL_MM)


def test_models_beyond_scp_need_a_table() -> None:
    """With one they answer, also where the arm's configuration was chosen; poses alone are refused."""
    cell = random_cell(np.random.default_rng(4), CALIBRATE_ONLY)
    made, poses = _draw(np.random.default_rng(5), cell)
    result = calibrated(poses, cell.jig, cell.robot, CalibConfig(model="full"))
    assert result.verdict.trustworthy
    assert result.T_hand_sensor is not None
    assert result.covariance is not None
    assert nees(made.T_hand_sensor, result.T_hand_sensor, result.covariance) < chi2.isf(1e-4, 6)
    with pytest.raises(InputError, match="joint readings") as refused:
        calibrated(poses, cell.jig, None, CalibConfig(model="full"))
    pinned(str(refused.value))


def test_without_a_table_sigma_have_a_floor_that_is_said() -> None:
    """Also where the poses are none that the table reaches (here ten metres away)."""
    cell = random_cell(np.random.default_rng(4), CALIBRATE_ONLY)
    _, poses = _draw(np.random.default_rng(5), cell)
    away = Pose(np.eye(3), np.array([1e4, 0, 0]))
    frames = tuple(replace(f, T_base_hand=away @ f.T_base_hand) for f in poses.frames if f.T_base_hand is not None)
    for robot, data in ((None, poses), (cell.robot, replace(poses, frames=frames))):
        result = calibrated(data, cell.jig, robot)
        assert min(result.sigma_translation_mm) > 0.3
        assert any("floor of 0.3 mm and 0.03°" in n for n in result.notes)
        bare = calibrated(data, cell.jig, robot, CalibConfig(hand_floor_mm=0.0, hand_floor_deg=0.0))
        assert min(bare.sigma_translation_mm) < min(result.sigma_translation_mm)


def test_gimbal_lock_is_one_line_with_the_matrix() -> None:
    """At Y = 90° only X - Z is known; its σ is that of a turn about the sensor's x."""
    T = Pose.from_fixed_xyz_deg([10.0, 89.99, 30.0], [0.0, 0.0, 0.0])
    (words,) = gimbal_note(T, np.diag([0.1**2] * 3 + [np.deg2rad(0.02) ** 2] * 3))
    assert "X and Z turn about the same axis" in words
    assert "X - Z = -20.0000 ± 0.0200°" in words
    assert f"{T.R[0, 1]:.7f}" in words
    assert gimbal_note(Pose.from_fixed_xyz_deg([10.0, 60.0, 30.0], [0.0, 0.0, 0.0]), np.eye(6)) == ()


def _columns(cell: SyntheticCell, q: np.ndarray, kind: str) -> ArmConfiguration:
    """What a controller writes of readings: KUKA's turn bits and status, ABB's quarter turns, FANUC's letters."""
    turn = sum(1 << i for i in range(6) if q[i] < 0)
    links = cell.robot.link_poses(q)
    heading, wrist = links.R[1][:, 0], links.t[5] - links.t[0]
    behind = bool(wrist @ heading < 0)
    bent = bool(np.cross(links.t[2] - links.t[1], links.t[5] - links.t[1]) @ links.R[1][:, 2] > 0)
    if kind == "abb":
        return ArmConfiguration(quadrants=(*(int(np.floor(q[i] / (np.pi / 2))) for i in (0, 3, 5)), 0))
    if kind == "fanuc":
        up = bent != behind
        return ArmConfiguration(letters=("N" if q[4] < 0 else "F") + ("U" if up else "D") + ("B" if behind else "T"))
    return ArmConfiguration(status=int(behind) + 2 * int(bent), turn=turn)


@pytest.mark.parametrize("kind", ["kuka", "fanuc"])
def test_status_columns_give_the_joints_and_the_same_answer(kind: str) -> None:
    """Joints and poses of the same frames: the same verdict, the same numbers, with every model."""
    cell = random_cell(np.random.default_rng(4), CALIBRATE_ONLY)
    made = made_cell(cell, np.random.default_rng(5), Noise())
    joints = observe(cell, made, np.random.default_rng(6), Noise())
    frames = tuple(
        replace(p, configuration=_columns(cell, f.joints_rad, kind))
        for f, p in zip(joints.frames, _poses(cell, joints).frames, strict=True)
        if f.joints_rad is not None
    )
    for f, g in zip(joints.frames, with_joints(frames, cell.robot), strict=True):
        assert not g.joints_inferred
        apart = (np.array(g.joints_rad) - f.joints_rad + np.pi) % (2 * np.pi) - np.pi
        np.testing.assert_allclose(apart, 0, atol=1e-6)
    config = CalibConfig(model="full")
    a = calibrated(joints, cell.jig, cell.robot, config)
    b = calibrated(replace(joints, frames=frames), cell.jig, cell.robot, config)
    assert b.verdict == a.verdict
    assert a.T_hand_sensor is not None
    assert b.T_hand_sensor is not None
    np.testing.assert_allclose(b.T_hand_sensor.t, a.T_hand_sensor.t, atol=1e-4)
    assert any("status columns" in n for n in b.notes)


def test_columns_that_leave_it_open_do_not_decide() -> None:
    """ABB's quarter turns of three axes leave the elbow open for some poses; those of no solution decide nothing."""
    cell = random_cell(np.random.default_rng(4), CALIBRATE_ONLY)
    decided = 0
    for q in cell.joints_rad:
        pose, rng = cell.robot.pose(q), np.random.default_rng(0)
        found = standing(cell.robot, pose, _columns(cell, q, "abb"), rng)
        if found is not None:
            decided += 1
            np.testing.assert_allclose((found - q + np.pi) % (2 * np.pi) - np.pi, 0, atol=1e-6)
    assert decided > 0
    assert standing(cell.robot, pose, ArmConfiguration(quadrants=(7, 7, 7, 0)), rng) is None


WRONG: dict[str, dict[str, list[float]]] = {
    "theta3": {"theta": [0, 0, float(np.deg2rad(0.4)), 0, 0, 0]},
    "a2": {"a": [0, 4.0, 0, 0, 0, 0]},
}


@pytest.mark.parametrize("name", WRONG)
def test_a_controllers_table_that_is_wrong_is_contradicted_by_its_poses(name: str) -> None:
    """The arm is another than its table: the poses are off, and σ must not be those of a sound table."""
    rng = np.random.default_rng(12)
    cell = random_cell(rng, CALIBRATE_ONLY)
    made = made_cell(cell, rng, Noise())
    observed = observe(cell, made, rng, Noise())
    wrong = cell.robot.with_changes(**WRONG[name])
    result = calibrated(_poses(replace(cell, robot=wrong), observed), cell.jig, wrong)
    assert result.verdict.code == "priors_contradict"
    assert name in {n for c in result.culprit for n in (c.parameter, *c.same_as)}
    if result.verdict.trustworthy:
        assert result.T_hand_sensor is not None
        assert result.covariance is not None
        assert nees(made.T_hand_sensor, result.T_hand_sensor, result.covariance) < NEES_LIMIT


def test_errors_larger_than_stated_are_said_of_poses_too() -> None:
    rng = np.random.default_rng(14)
    cell = random_cell(rng, CALIBRATE_ONLY)
    made = made_cell(cell, rng, Noise())
    u = cell.robot.uncertainty
    sure = replace(
        u,
        theta_sigma_rad=u.theta_sigma_rad / 10,
        d_sigma_mm=u.d_sigma_mm / 10,
        a_sigma_mm=u.a_sigma_mm / 10,
        alpha_sigma_rad=u.alpha_sigma_rad / 10,
    )
    poses = _poses(cell, observe(cell, made, rng, Noise()))
    result = calibrated(poses, cell.jig, replace(cell.robot, uncertainty=sure))
    assert result.verdict.code == "priors_contradict"
    assert "[uncertainty] of robot.toml" in result.verdict.text


def test_what_auto_is_with_an_arm_whose_solution_is_open_is_said() -> None:
    cell = random_cell(np.random.default_rng(4), CALIBRATE_ONLY)
    _, poses = _draw(np.random.default_rng(5), cell)
    with_table = calibrated(poses, cell.jig, cell.robot)
    assert with_table.model == "scp"
    assert any("in which of its configurations the arm was" in r for r in with_table.remarks)
    without = calibrated(poses, cell.jig, None)
    assert any("no joint readings that a robot's table turns into poses" in r for r in without.remarks)


def test_errors_that_the_table_explains_are_no_misfit() -> None:
    """A ball from twelve poses of an arm with three parallel axes, as built: residuals exceed points and joints by far,
    errors of the stated size explain them, and σ carry these.
    """
    alpha = np.deg2rad([90.0, 0.0, 0.0, 90.0, -90.0, 0.0])
    lengths = [180.7, 0, 0, 174.15, 119.85, 116.55], [0, -612.7, -571.55, 0, 0, 0]
    arm = DhRobot.from_dh(np.zeros(6), *lengths, alpha, name="arm")
    rng = np.random.default_rng(6)
    cell = surface_cell(Sphere(40.0), rng, (("A", "calibrate", 12),), robot=arm)
    data = observe_surface(cell, rng, ProfileNoise())
    frames = tuple(replace(f, joints_rad=None, T_base_hand=arm.pose(f.joints_rad)) for f in data.frames)
    result = calibrated(replace(data, frames=frames), cell.target, arm)
    assert result.chi2_per_dof > CalibConfig().misfit_chi2
    assert result.verdict.code == "ok"
    assert "once errors of the robot's table of the stated size are allowed for" in result.verdict.text
    assert result.T_hand_sensor is not None
    assert result.covariance is not None
    assert nees(cell.T_hand_sensor, result.T_hand_sensor, result.covariance) < NEES_LIMIT


def test_residuals_of_poses_that_no_error_of_the_table_explains_are_a_misfit() -> None:
    facts = Facts(
        converged=True, iterations=5, chi2_per_dof=6.0, explained=5.0, dof=60, condition=30.0,
        noise_covariance=1e-4 * np.eye(6), outlier_share=0.0, outlying_strings=(), rival=np.inf, locations=1,
        inferred=True,
    )  # fmt: skip
    verdict = judge(facts, Motion(12, 11, 11, 90.0, 40.0, 100.0), CalibConfig())
    assert verdict.code == "model_misfit"
    assert verdict.withheld
    assert "of the stated size do not explain them" in verdict.text
