"""Gravity's deflection of an arm: against a torque worked out by hand, and no deflection without weight."""

from __future__ import annotations

import numpy as np
import pytest

from calib.synthetic.cell import industrial_arm
from geometry import InputError
from geometry.robot import GRAVITY, Compliance, deflection, torque, torque_by_joints
from tests.geometry.strategies import random_robot
from tests.pinned import pinned

ATOL_RAD = 1e-9
NONE = (0.0,) * 6


def test_a_payload_on_an_outstretched_arm() -> None:
    """One mass at the hand turns a joint with a horizontal axis by m g times its horizontal distance over stiffness."""
    robot, q = industrial_arm(), np.deg2rad([[0.0, 90.0, 0.0, 0.0, 0.0, 0.0]])
    found = deflection(robot, q, Compliance(mass_kg=NONE, payload_kg=10.0, balanced=NONE))[0]
    hand, links = robot.pose(q).t[0], robot.link_poses(q).t[0]
    torque = 10.0 * GRAVITY * (hand[0] - links[1, 0]) / 1000
    assert abs(found[1]) == pytest.approx(torque / Compliance().stiffness[1], rel=1e-6)
    assert found[0] == pytest.approx(0.0, abs=ATOL_RAD)


def test_the_hand_sinks() -> None:
    robot = industrial_arm()
    q = np.random.default_rng(3).uniform(-0.8, 0.8, (50, 6))
    moved = robot.pose(q + deflection(robot, q, Compliance(mass_kg=NONE))).t[:, 2]
    assert np.all(moved <= robot.pose(q).t[:, 2] + 1e-6)


def test_no_weight_no_deflection_and_other_arms_are_refused() -> None:
    robot, q = industrial_arm(), np.zeros((1, 6))
    still = deflection(robot, q, Compliance(mass_kg=NONE, payload_kg=0.0))
    np.testing.assert_allclose(still, 0.0, rtol=0, atol=ATOL_RAD)
    with pytest.raises(InputError, match="stiffness has 1 values for a robot of 6") as refused:
        deflection(robot, q, Compliance(stiffness=(1.0,)))
    pinned(str(refused.value))


@pytest.mark.parametrize("convention", ["standard", "modified"])
def test_torque_is_the_slope_of_the_energy(convention: str) -> None:
    """Also with signs, coupling, a first and a last frame; and its change with the readings is the slope of it."""
    rng = np.random.default_rng(5)
    robot, q = random_robot(rng, 6, convention), rng.uniform(-2, 2, (4, 6))
    load = Compliance(mass_kg=(30.0, 250.0, 120.0, 180.0, 40.0, 20.0))

    def energy(at: np.ndarray) -> np.ndarray:
        heights = robot.link_poses(at).t[..., 2]
        links = (heights[..., :-1] + heights[..., 1:]) / 2 @ np.array(load.mass_kg)
        return np.asarray(GRAVITY * (links + robot.pose(at).t[..., 2] * load.payload_kg) / 1000)

    step = 1e-4
    steps = step * np.eye(6)
    slope = np.stack([(energy(q + s) - energy(q - s)) / (2 * step) for s in steps], -1)
    found = torque(robot, q, load)
    np.testing.assert_allclose(found, -slope * (1 - np.array(load.balanced)), rtol=0, atol=1e-5)  # of thousands of N·m
    change = np.stack([(torque(robot, q + s, load) - torque(robot, q - s, load)) / (2 * step) for s in steps], -1)
    np.testing.assert_allclose(torque_by_joints(robot, q, load), change, rtol=0, atol=1e-4)
