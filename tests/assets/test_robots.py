"""Every arm preset against sums of its maker's dimensions, worked out here by hand, and an independent chain.

What this does not prove: that the makers' dimensions are those of a particular machine.
"""

import tomllib

import numpy as np
import pytest
from pytransform3d import transformations as pt

import assets
from geometry import inverse_kinematics
from workbench.files import read_robot

ATOL_MM = 1e-9
BENT = 1 / np.sqrt(2)

# name: (readings [deg], flange position [mm] as sums of the maker's dimensions)
POSITIONS = {
    # upper arm upright, forearm forward: reach a1 + d4 + d6, height d1 + a2 + a3
    "abb_irb120": [
        ([0, 0, 0, 0, 0, 0], (302 + 72, 0, 290 + 270 + 70)),
        ([90, 0, 0, 0, 90, 0], (0, 302, 290 + 270 + 70 - 72)),
        ([0, 90, -90, 0, 0, 0], (270 + 302 + 72, 0, 290 + 70)),
    ],
    "abb_irb2400": [
        ([0, 0, 0, 0, 0, 0], (100 + 755 + 85, 0, 615 + 705 + 135)),
        # the parallel rod keeps the forearm level while the upper arm leans by 45°
        ([0, 45, 0, 0, 0, 0], (100 + 705 * BENT + 755 + 85, 0, 615 + 705 * BENT + 135)),
        ([0, 0, 60, 0, -60, 0], (100 + 135 * np.sqrt(0.75) + 755 / 2 + 85, 0, 615 + 705 + 67.5 - 755 * np.sqrt(0.75))),
    ],
    "abb_irb6640_180_255": [
        ([0, 0, 0, 0, 0, 0], (320 + 1142 + 200, 0, 780 + 1075 + 200)),
        ([0, 0, 0, 0, 90, 0], (320 + 1142, 0, 780 + 1075 + 200 - 200)),
        ([0, 85, -85, 0, 0, 0], (320 + 1075 * np.sin(np.deg2rad(85)) + 1342, 0, 980 + 1075 * np.cos(np.deg2rad(85)))),
    ],
    # stretched forward at zero; A1 turns clockwise seen from above
    "kuka_kr6_r700": [
        ([0, 0, 0, 0, 0, 0], (25 + 315 + 365 + 80, 0, 400 + 35)),
        ([0, -90, 90, 0, 0, 0], (25 + 35 * 0 + 365 + 80, 0, 400 + 315 + 35)),
        ([90, -90, 90, 0, 0, 0], (0, -(25 + 365 + 80), 400 + 315 + 35)),
        ([0, -90, 90, 0, 90, 0], (25 + 365, 0, 400 + 315 + 35 - 80)),
    ],
    "kuka_kr210_l150": [
        ([0, -90, 90, 0, 0, 0], (350 + 1500 + 230, 0, 750 + 1250 - 55)),
        ([-90, -90, 90, 0, 90, 0], (0, 350 + 1500, 750 + 1250 - 55 - 230)),
    ],
    # J3 keeps the forearm level when J2 leans; positive J3 and J5 raise
    "fanuc_m20ia_10l": [
        ([0, 0, 0, 0, 0, 0], (150 + 1040 + 100, 0, 525 + 790 + 250)),
        ([0, 45, 0, 0, 0, 0], (150 + 790 * BENT + 1040 + 100, 0, 525 + 790 * BENT + 250)),
        ([0, 0, 90, 0, 0, 0], (150 - 250, 0, 525 + 790 + 1040 + 100)),
        ([0, 0, 0, 0, 90, 0], (150 + 1040, 0, 525 + 790 + 250 + 100)),
    ],
    "fanuc_r2000ib_210f": [
        ([0, 0, 0, 0, 0, 0], (312 + 1280 + 235, 0, 670 + 1075 + 225)),
        ([0, -45, 0, 0, 0, 0], (312 - 1075 * BENT + 1280 + 235, 0, 670 + 1075 * BENT + 225)),
        ([0, 0, -90, 0, 90, 0], (312 + 225 + 235, 0, 670 + 1075 - 1280)),
    ],
    # upright at J2 = 90; J2 leans back and J3 raises
    "hyundai_hh7": [
        ([0, 90, 0, 0, 0, 0], (40 + 445 + 86.5, 0, 446 + 445 + 40)),
        ([0, 0, 0, 0, 0, 0], (40 + 445 + 40, 0, 446 - 445 - 86.5)),
        ([90, 90, 90, 0, 0, 0], (0, 40 - 40, 446 + 445 + 445 + 86.5)),
    ],
    "hyundai_ha006b": [
        ([0, 90, 0, 0, 0, 0], (200 + 650 + 105, 0, 358.5 + 560 + 137.5)),
        ([0, 90, 0, 0, 90, 0], (200 + 650, 0, 358.5 + 560 + 137.5 - 105)),
    ],
    # stretched level along -x at zero, wrist offset along -y; upright at -90
    "ur5": [
        ([0, 0, 0, 0, 0, 0], (-425 - 392.25, -109.15 - 82.3, 89.159 - 94.65)),
        ([0, -90, 0, -90, 0, 0], (0, -109.15 - 82.3, 89.159 + 425 + 392.25 + 94.65)),
    ],
    "ur10": [
        ([0, 0, 0, 0, 0, 0], (-612 - 572.3, -163.941 - 92.2, 127.3 - 115.7)),
        ([90, -90, 0, -90, 0, 0], (163.941 + 92.2, 0, 127.3 + 612 + 572.3 + 115.7)),
    ],
    "ur5e": [
        ([0, 0, 0, 0, 0, 0], (-425 - 392.2, -133.3 - 99.6, 162.5 - 99.7)),
        ([0, -90, 0, -90, 0, 0], (0, -133.3 - 99.6, 162.5 + 425 + 392.2 + 99.7)),
    ],
    "ur10e": [
        ([0, 0, 0, 0, 0, 0], (-612.7 - 571.55, -174.15 - 116.55, 180.7 - 119.85)),
        ([0, -90, 0, -90, 0, 0], (0, -174.15 - 116.55, 180.7 + 612.7 + 571.55 + 119.85)),
    ],
    # upright at zero, the flange hanging down 88 in front; elbow bent back by the offset 82.5
    "franka_panda": [
        ([0, 0, 0, 0, 0, 0, 0], (88, 0, 333 + 316 + 384 - 107)),
        ([0, 0, 0, -90, 0, 90, 0], (82.5 + 384 + 88, 0, 333 + 316 + 82.5 - 107)),
    ],
    "kuka_iiwa14": [
        ([0, 0, 0, 0, 0, 0, 0], (0, 0, 360 + 420 + 400 + 126)),
        ([0, 90, 0, 0, 0, 0, 0], (420 + 400 + 126, 0, 360)),
        ([0, 0, 0, -90, 0, 0, 0], (400 + 126, 0, 360 + 420)),
        ([0, 0, 0, 0, 0, 90, 0], (126, 0, 360 + 420 + 400)),
    ],
}


def test_every_arm_has_its_sums() -> None:
    assert set(POSITIONS) == set(assets.list_presets("robots"))


@pytest.mark.parametrize("name", POSITIONS)
def test_the_flange_is_where_the_makers_dimensions_put_it(name: str) -> None:
    robot = read_robot(assets.path("robots", name))
    for readings, position in POSITIONS[name]:
        flange = robot.pose(np.deg2rad(readings)).t
        np.testing.assert_allclose(flange, position, rtol=0, atol=ATOL_MM, err_msg=str(readings))


@pytest.mark.parametrize("name", POSITIONS)
def test_the_file_read_by_an_independent_chain_agrees(name: str) -> None:
    """The TOML's numbers multiplied out with pytransform3d, coupling and signs by hand."""
    table = tomllib.loads(assets.path("robots", name).read_text())
    robot, rng = read_robot(assets.path("robots", name)), np.random.default_rng(1)
    for q in rng.uniform(robot.min_rad, robot.max_rad, (5, robot.n_joints)):
        out = np.eye(4)
        for i, joint in enumerate(table["joint"]):
            row = table.get("coupling", {}).get("matrix", np.eye(robot.n_joints))[i]
            theta = joint.get("sign", 1) * np.dot(row, q) + np.deg2rad(joint["theta_offset_deg"])
            alpha, a, d = np.deg2rad(joint["alpha_deg"]), joint["a_mm"], joint["d_mm"]
            screw_z = pt.transform_from_exponential_coordinates([0, 0, theta, 0, 0, d])
            screw_x = pt.transform_from_exponential_coordinates([alpha, 0, 0, a, 0, 0])
            out = out @ (screw_z @ screw_x if table["convention"] == "standard" else screw_x @ screw_z)
        np.testing.assert_allclose(robot.pose(q).matrix, out, rtol=0, atol=1e-9)


@pytest.mark.parametrize("name", POSITIONS)
def test_poses_within_the_limits_are_reached_by_inverse_kinematics(name: str) -> None:
    robot, rng = read_robot(assets.path("robots", name)), np.random.default_rng(2)
    goals = robot.pose(rng.uniform(robot.min_rad, robot.max_rad, (40, robot.n_joints)))
    found = inverse_kinematics(robot, goals, rng)
    assert np.all(robot.within_limits(found.joints))
    assert found.converged.mean() >= 0.95


@pytest.mark.parametrize("name", POSITIONS)
def test_presets_say_where_their_numbers_come_from(name: str) -> None:
    text = assets.path("robots", name).read_text()
    assert text.startswith("# length")
    assert "limits" in text
    uncertainty = tomllib.loads(text)["uncertainty"]
    assert (uncertainty["joint_sigma_deg"], uncertainty["theta_sigma_deg"], uncertainty["d_sigma_mm"]) == (
        0.003,
        0.03,
        0.15,
    )
