"""Clearance of sensor, hand and arm from the jig's solids: distances against meshes, and an arm driven into the jig."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh

from geometry import Pose
from jig_cad import Jig
from jig_cad.solids import PillarDesign, jig_solids
from workbench.cell import find_robot
from workbench.plan.clearance import arm_clears, distance_mm

ATOL_MM = 1e-9


def test_no_solid_is_nearer_than_said() -> None:
    """The boxes hold plates, posts and strings, so the distance never exceeds that of the meshes."""
    jig = Jig.nominal()
    points = np.random.default_rng(1).uniform([-150, -150, -150], [250, 150, 250], (400, 3))
    said = distance_mm(jig, points[:, None])
    for name, mesh in jig_solids(jig).items():
        _, distance, _ = trimesh.proximity.closest_point(mesh, points)
        thickness = jig.string_diameter_mm / 2 if name.startswith("string") else 0.0  # boxes hold the strings' axes
        assert np.all(said <= distance + thickness + ATOL_MM)


@pytest.mark.parametrize("depth", [5.0, 60.0, 200.0])
def test_before_the_front_the_plates_edges_are_nearest_or_the_strings(depth: float) -> None:
    """Half way up, before string A: the strings lie ``depth`` behind, the plates' front edges half a height aside."""
    jig = Jig.nominal()
    _, front, _, _ = PillarDesign().plate(jig).bounds
    said = distance_mm(jig, np.array([[[jig.height_mm / 2, 0.0, -depth]]]))
    edge = np.hypot(jig.height_mm / 2, max(depth + front, 0.0))
    np.testing.assert_allclose(said, min(depth, edge), rtol=0, atol=ATOL_MM)


def test_an_arm_in_the_jig_is_found() -> None:
    """The jig put at the hand's place is hit, the same jig two metres off is not."""
    robot = find_robot("abb_irb6640_180_255")
    q = np.deg2rad([[10.0, 20.0, 10.0, 5.0, 40.0, 0.0]])
    hand, mounted = robot.pose(q)[0], Pose(np.eye(3), np.array([0.0, 0.0, 117.0]))
    jig = Jig.nominal()
    assert not arm_clears(robot, q, mounted, hand, jig)[0]
    assert arm_clears(robot, q, mounted, Pose(hand.R, hand.t + np.array([2000.0, 0, 0])), jig)[0]
