"""A sensor that stands, and a target that the hand carries: the pose in the base is recovered within its σ."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from calib import CalibConfig, calibrate
from calib.printed import nees
from calib.synthetic.cell import Layout, axis_points, default_sensor, industrial_arm, views
from calib.verify import verify
from geometry import AxisPoints, DhRobot, Frame, Inverted, Pose, draw_errors, inverse_kinematics
from jig_cad import Jig, sample_tolerance
from tests.pinned import pinned

TRUE = Pose.from_fixed_xyz_deg((3.0, -87.0, 2.0), (1900.0, 60.0, 900.0))  # depth towards the arm
DESIGN = TRUE @ Pose.exp(np.array([2.0, -3.0, 2.5, 0.01, -0.015, 0.02]))
# T_hand_jig: the jig before the flange, its back to it, mounted in three ways
MOUNTED = {
    "A": Pose.from_fixed_xyz_deg((180.0, 0.0, 0.0), (0.0, 10.0, 160.0)),
    "B": Pose.from_fixed_xyz_deg((192.0, -8.0, 60.0), (20.0, -15.0, 160.0)),
    "C": Pose.from_fixed_xyz_deg((170.0, 14.0, -70.0), (-30.0, 5.0, 160.0)),
}
POINT_MM = 0.02
NEES_LIMIT = 22.5  # of six numbers: 1 in 1,000
ATOL_MM = 1e-6


def _frames(rng: np.random.Generator, true_arm: DhRobot, arm: DhRobot, jig: Jig, noisy: bool) -> tuple[Frame, ...]:
    frames: list[Frame] = []
    for name, T_hand_jig in MOUNTED.items():
        seen = views(rng, Layout(swing_deg=15.0), jig, 40).inverse()
        goals = TRUE @ seen @ T_hand_jig.inverse()
        found = inverse_kinematics(arm, goals, rng, max_starts=12)
        joints = found.joints[found.converged & arm.within_limits(found.joints)][:8]
        assert len(joints) == 8
        truly = joints + (rng.normal(size=joints.shape) * true_arm.uncertainty.joint_sigma_rad if noisy else 0.0)
        yz = axis_points(TRUE.inverse() @ true_arm.pose(truly) @ T_hand_jig, jig)
        yz = yz + (rng.normal(size=yz.shape) * POINT_MM if noisy else 0.0)
        covariance = np.broadcast_to(np.eye(2) * POINT_MM**2, (*yz.shape, 2))
        frames += [
            Frame(
                len(frames) + k,
                name,
                joints_rad=q,
                axis=AxisPoints(jig.strings, np.full(yz.shape[1], -1), yz[k], covariance[k], ("",) * yz.shape[1]),
                labels_given=True,
            )
            for k, q in enumerate(joints)
        ]
    return tuple(frames)


def test_without_noise_it_is_found_to_the_last_digit() -> None:
    arm, jig = industrial_arm(), Jig.nominal()
    frames = _frames(np.random.default_rng(0), arm, arm, jig, noisy=False)
    result = calibrate(frames, jig, arm, default_sensor(), DESIGN, config=CalibConfig(model="scp"), mount="fixed")
    assert result.T_hand_sensor is not None
    np.testing.assert_allclose(result.T_hand_sensor.matrix, TRUE.matrix, rtol=0, atol=ATOL_MM)
    for name, place in MOUNTED.items():
        found = result.locations[name].T_base_target
        assert found is not None
        np.testing.assert_allclose(found.matrix, place.matrix, rtol=0, atol=ATOL_MM)
    answer = result.to_json()
    assert '"mount": "fixed"' in answer
    assert '"T_base_sensor"' in answer


@pytest.mark.parametrize("model", ["auto", pytest.param("scp", marks=pytest.mark.slow)])
def test_with_the_arms_errors_sigma_is_true(model: str) -> None:
    """Errors of the table, of joints, anchors and points as stated: the squared error in σ of six draws together."""
    arm, total = industrial_arm(), 0.0
    for seed in range(3):
        rng = np.random.default_rng(seed)
        jig = Jig.nominal()
        made = sample_tolerance(jig, rng)
        frames = _frames(rng, arm.corrected(draw_errors(arm, rng)), arm, made, noisy=True)
        result = calibrate(frames, jig, arm, default_sensor(), DESIGN, config=CalibConfig(model=model), mount="fixed")
        assert result.verdict.trustworthy, result.verdict.text
        assert result.T_hand_sensor is not None
        assert result.covariance is not None
        one = nees(TRUE, result.T_hand_sensor, result.covariance)
        assert one < NEES_LIMIT
        total += one
    assert total < 42.3  # of 18 numbers: 1 in 1,000


def test_hand_poses_alone_do() -> None:
    """Without a table: noise of the hand's poses acts at the hand, two metres from where the sensor stands."""
    arm, jig = industrial_arm(), Jig.nominal()
    rng = np.random.default_rng(7)
    shaken = []
    for f in _frames(rng, arm, arm, jig, noisy=True):
        noise = rng.normal(size=6) * np.array([0.05] * 3 + [5e-5] * 3)
        shaken.append(replace(f, joints_rad=None, T_base_hand=arm.pose(f.joints_rad) @ Pose.exp(noise)))
    result = calibrate(shaken, jig, None, default_sensor(), DESIGN, mount="fixed")
    pinned(result)
    assert result.verdict.trustworthy, result.verdict.text
    assert result.T_hand_sensor is not None
    assert result.covariance is not None
    assert nees(TRUE, result.T_hand_sensor, result.covariance) < NEES_LIMIT
    assert result.estimate is not None
    assert 0.02 < result.estimate.noise["hand_sigma_mm"] < 0.12


def test_the_truth_verifies_to_the_noise() -> None:
    arm, jig = industrial_arm(), Jig.nominal()
    frames = _frames(np.random.default_rng(3), arm, arm, jig, noisy=True)
    found = verify(frames, jig, arm, default_sensor(), TRUE, mount="fixed")
    pinned(found)
    assert found.largest_rms_mm is not None
    assert found.largest_rms_mm < 0.2


@pytest.mark.slow
def test_data_of_a_fixed_sensor_taken_for_one_on_the_hand_are_not_trusted() -> None:
    arm, jig = industrial_arm(), Jig.nominal()
    frames = _frames(np.random.default_rng(3), arm, arm, jig, noisy=True)
    assert not calibrate(frames, jig, arm, default_sensor(), DESIGN).verdict.trustworthy


def test_a_chain_inverted_twice_is_the_chain() -> None:
    arm, q = industrial_arm(), np.full((2, 6), 0.3)
    twice = Inverted(Inverted(arm))
    np.testing.assert_allclose(twice.pose(q).matrix, arm.pose(q).matrix, rtol=0, atol=ATOL_MM)
    np.testing.assert_allclose(twice.joint_jacobian(q), arm.joint_jacobian(q), rtol=0, atol=ATOL_MM)
