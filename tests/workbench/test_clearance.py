"""Clearance of sensor, hand and arm from the jig's solids: distances against meshes, and an arm driven into the jig."""

from __future__ import annotations

import numpy as np
import trimesh

from geometry import Pose
from jig_cad import Jig
from jig_cad.solids import jig_solids
from workbench.cell.presets import find_robot
from workbench.plan.clearance import arm_clears, distance_mm

ATOL_MM = 1e-9


def test_no_solid_is_nearer_than_said() -> None:
    """The boxes hold plates, posts and strings, so the distance never exceeds that of the meshes."""
    jig = Jig.nominal()
    points = np.random.default_rng(1).uniform([-150, -150, -150], [250, 150, 250], (400, 3))
    said = distance_mm(jig, points[:, None])
    for mesh in jig_solids(jig).values():
        _, distance, _ = trimesh.proximity.closest_point(mesh, points)
        assert np.all(said <= distance + 0.2)  # strings have a thickness


def test_before_the_front_the_distance_is_the_depth() -> None:
    jig = Jig.nominal()
    said = distance_mm(jig, np.array([[[50.0, 0.0, -200.0]]]))
    np.testing.assert_allclose(said, 200.0, rtol=0, atol=ATOL_MM + 8.0)  # the plates' margin
    assert said < 200.0


def test_an_arm_in_the_jig_is_found() -> None:
    """The jig put at the hand's place is hit, the same jig two metres off is not."""
    robot = find_robot("abb_irb6640_180_255")
    q = np.deg2rad([[10.0, 20.0, 10.0, 5.0, 40.0, 0.0]])
    hand, mounted = robot.pose(q)[0], Pose(np.eye(3), np.array([0.0, 0.0, 117.0]))
    jig = Jig.nominal()
    assert not arm_clears(robot, q, mounted, hand, jig)[0]
    assert arm_clears(robot, q, mounted, Pose(hand.R, hand.t + np.array([2000.0, 0, 0])), jig)[0]
