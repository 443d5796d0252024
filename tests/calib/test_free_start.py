"""Strings without a drawing of the mount: the SCP begins at what the frames' own jig poses tell."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from calib import CalibConfig, CalibrationResult, calibrate
from calib.bundle import free_start
from calib.synthetic.cell import CellFrames, Noise, calibrated, made_cell, observe, random_cell
from geometry import Pose, Robot, stack_poses
from jig_cad import Jig
from tests.pinned import pinned

SAME_MM, SAME_RAD = 1e-4, 1e-6  # one minimum, reached from two starts
NEAR_MM, NEAR_DEG = 3.0, 1.0  # what labelling by a chain copes with


def _without_design(observed: CellFrames, jig: Jig, robot: Robot) -> CalibrationResult:
    return calibrate(observed.frames, jig, robot, observed.sensor, None, config=CalibConfig(model="full"))


@pytest.mark.parametrize("sixth", [False, True])
def test_the_answer_is_that_from_a_drawing(sixth: bool) -> None:
    rng = np.random.default_rng(21)
    jig = Jig.nominal(strings=("A", "B", "C", "B'", "C'", "D'")) if sixth else Jig.nominal()
    cell = random_cell(rng, jig=jig)
    made = made_cell(cell, rng, Noise())
    observed = observe(cell, made, rng, Noise())
    drawn = calibrated(observed, cell.jig, cell.robot, CalibConfig(model="full"))
    free = _without_design(observed, cell.jig, cell.robot)
    assert drawn.T_hand_sensor is not None
    assert free.T_hand_sensor is not None, free.verdict.text
    xi = (drawn.T_hand_sensor.inverse() @ free.T_hand_sensor).log()
    np.testing.assert_allclose(xi[:3], 0, rtol=0, atol=SAME_MM)
    np.testing.assert_allclose(xi[3:], 0, rtol=0, atol=SAME_RAD)
    assert free.T_hand_sensor_design is None
    one = free.locations["D"]
    assert one.point_rms_mm.design is None
    assert one.max_deviation_mm.design is None
    assert one.point_rms_mm.solved == pytest.approx(drawn.locations["D"].point_rms_mm.solved, abs=SAME_MM)


def test_any_mount_is_found_among_mirrors_and_half_turns() -> None:
    """Each frame offers its true pose, a mirror and both turned by the jig's symmetry, in any order."""
    rng = np.random.default_rng(5)
    jig = Jig.nominal()
    turn = jig.symmetries[0].pose
    for _ in range(4):
        X = Pose.exp(np.concatenate([rng.normal(size=3) * 100, rng.normal(size=3) * 2]))
        places = Pose.exp(np.column_stack([rng.normal(size=(2, 3)) * 300, rng.normal(size=(2, 3))]))
        location = np.repeat([0, 1], 6)
        tilts = Pose.exp(np.column_stack([rng.normal(size=(12, 3)) * 20, rng.normal(size=(12, 3)) * 0.3]))
        seen = Pose.exp(np.array([0.0, 0, 290, 0, 0, 0])) @ tilts
        hands = stack_poses([places[int(k)] for k in location]) @ seen.inverse() @ X.inverse()
        noisy = seen @ Pose.exp(rng.normal(size=(12, 6)) * [0.1, 0.1, 0.1, 0.002, 0.002, 0.002])
        options = []
        for i in range(12):
            mirror = noisy[i] @ Pose.exp(np.array([20.0, 30, 5, 0.3, -0.5, 0.2]) * rng.choice([-1, 1], 6))
            both = [noisy[i], mirror, noisy[i] @ turn, mirror @ turn]
            options.append(stack_poses([both[k] for k in rng.permutation(4)]))
        found = free_start(hands, options, location)
        assert found is not None
        xi = (X.inverse() @ found).log()
        assert np.linalg.norm(xi[:3]) < NEAR_MM
        assert np.rad2deg(np.linalg.norm(xi[3:])) < NEAR_DEG


def test_views_that_tell_nothing_give_a_verdict() -> None:
    """One axis only: no start, and what to add."""
    rng = np.random.default_rng(22)
    cell = random_cell(rng)
    made = made_cell(cell, rng, Noise())
    observed = observe(cell, made, rng, Noise())
    same = observed.frames[0]
    frames = [replace(f, number=k, joints_rad=same.joints_rad, axis=same.axis) for k, f in enumerate(observed.frames)]
    result = calibrate(frames, cell.jig, cell.robot, observed.sensor, None, config=CalibConfig(model="full"))
    pinned(result)
    assert not result.verdict.trustworthy
    assert result.T_hand_sensor is None
    assert "scp_initial" in result.verdict.text
