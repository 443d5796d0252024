"""Compliance under gravity, estimated with the SCP: recovered within σ, better predictions, said where it is silent."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from calib import CalibConfig
from calib.synthetic.cell import Layout, Noise, calibrated, made_cell, observe, random_cell
from geometry import Compliance, Compliant, InputError, Pose, assumed_compliance, compliant_part, with_compliance_prior
from geometry.robot import GRAVITY
from tests.pinned import pinned

LOAD = Compliance()
LAYOUT = Layout(places=(("A", "calibrate", 9), ("B", "calibrate", 9), ("C", "calibrate", 9), ("D", "verify", 6)))
POINT_MM = 0.01
LEVERS_MM = 2e-3  # torque is by the table stated, in a file by the table corrected: levers differ by parts in 1,000
NEES_LIMIT = 22.5  # of six numbers: 1 in 1,000


def _cell(seed: int, layout: Layout = LAYOUT):
    rng = np.random.default_rng(seed)
    cell = random_cell(rng, layout)
    noise = Noise(point_mm=POINT_MM, joint_rad=float(np.deg2rad(0.002)), compliance=LOAD)
    made = made_cell(cell, rng, noise)
    return cell, observe(cell, made, rng, noise)


@pytest.mark.parametrize("seed", [2, *(pytest.param(s, marks=pytest.mark.slow) for s in (1, 3))])
def test_the_joints_compliance_is_recovered_and_d_is_predicted_better(seed: int) -> None:
    """Masses as assumed, stiffness unknown: what is observed lies within its σ, and place D is measured better."""
    cell, observed = _cell(seed)
    plain = calibrated(observed, cell.jig, cell.robot, CalibConfig(model="full"))
    bends = calibrated(observed, cell.jig, cell.robot, CalibConfig(model="full+compliance"))
    assert bends.verdict.trustworthy, bends.verdict.text
    joints = {j.joint: j for j in bends.joint_compliances}
    assert {2, 3} <= {j for j, one in joints.items() if one.observed}
    assert not joints[1].observed  # a vertical axis carries no weight
    for j, one in joints.items():
        assert abs(one.compliance - 1 / LOAD.stiffness[j - 1]) < 4 * one.sigma
    assert bends.estimate is not None
    xi = (bends.estimate.T_hand_sensor.inverse() @ cell.T_hand_sensor).log()
    assert xi @ np.linalg.solve(bends.estimate.covariance, xi) < NEES_LIMIT
    rms = {m: r.locations["D"].spread_3d_mm.solved for m, r in (("full", plain), ("full+compliance", bends))}
    assert rms["full+compliance"] < rms["full"]
    assert any("joint" in n and "not told by these frames" in n for n in bends.notes)


def test_without_compliance_asked_nothing_is_estimated_of_it() -> None:
    cell, observed = _cell(4)
    robot = Compliant(cell.robot, LOAD, 1e-6)
    result = calibrated(observed, cell.jig, robot, CalibConfig(model="full"))
    of_joints = [v for p, v in zip(robot.parameters, result.robot_delta, strict=True) if p.group == "compliance"]
    assert not np.any(of_joints)
    assert result.joint_compliances == ()


def test_a_stated_compliance_enters_every_model() -> None:
    """The true stiffness in the file: the SCP alone with joint noise alone then fits to the noise."""
    cell, observed = _cell(5)
    told = calibrated(observed, cell.jig, Compliant(cell.robot, LOAD, 0.0), CalibConfig(model="full"))
    untold = calibrated(observed, cell.jig, cell.robot, CalibConfig(model="full"))
    assert told.locations["D"].spread_3d_mm.solved < untold.locations["D"].spread_3d_mm.solved


def test_one_place_of_the_arm_tells_no_compliance() -> None:
    """Three frames that hardly differ in reach: nothing of a joint is learnt, and the answer is weak and says so."""
    layout = Layout(places=(("A", "calibrate", 4),))
    rng = np.random.default_rng(3)
    cell = random_cell(rng, layout)
    noise = Noise(point_mm=0.2, compliance=LOAD)
    made = made_cell(cell, rng, noise)
    result = calibrated(observe(cell, made, rng, noise), cell.jig, cell.robot, CalibConfig(model="full+compliance"))
    silent = [j for j in result.joint_compliances if not j.observed]
    assert len(silent) == len(result.joint_compliances) > 0
    assert result.verdict.code == "weak"
    assert any("nothing of the arm's compliance is observable" in n for n in (*result.notes, result.verdict.text))


def test_an_exact_compliance_is_not_estimated() -> None:
    cell, _ = _cell(6)
    with pytest.raises(InputError, match="is exact") as refused:
        with_compliance_prior(Compliant(cell.robot, LOAD, 0.0))
    pinned(str(refused.value))
    uncertain = with_compliance_prior(cell.robot)
    assert sum(p.group == "compliance" for p in uncertain.parameters) == 6
    assert with_compliance_prior(uncertain) is uncertain
    q = cell.joints_rad[:2]
    np.testing.assert_array_equal(uncertain.pose(q).matrix, cell.robot.pose(q).matrix)  # rigid until estimated


def test_corrections_are_built_into_the_part_that_a_file_can_hold() -> None:
    cell, _ = _cell(7)
    robot = with_compliance_prior(cell.robot)
    values = np.array([(2e-6 if p.group == "compliance" else p.sigma / 3) for p in robot.parameters])
    corrected = robot.corrected(values)
    part = compliant_part(corrected)
    assert part is not None
    q = cell.joints_rad[:3]
    np.testing.assert_allclose(part.pose(q).matrix, corrected.pose(q).matrix, rtol=0, atol=LEVERS_MM)
    np.testing.assert_allclose(part.load.stiffness, 5e5, rtol=1e-12)
    assert compliant_part(cell.robot) is None


def test_a_hanging_arm_bends_the_other_way() -> None:
    """The same arm with gravity reversed turns its joints by the opposite angles."""
    cell, _ = _cell(8)
    q = cell.joints_rad[:4]
    stands, hangs = (Compliant(cell.robot, replace(LOAD, up=(0.0, 0.0, s))) for s in (1.0, -1.0))
    a, b = (r.deviation(q, np.zeros(0)) for r in (stands, hangs))
    np.testing.assert_allclose(a, -b, rtol=0, atol=1e-15)
    assert np.abs(a).max() > 1e-4
    sideways = Compliant(cell.robot, replace(LOAD, up=(1.0, 0.0, 0.0)))
    assert np.abs(sideways.deviation(q, np.zeros(0))[:, 0]).max() > 1e-5  # now the first axis carries weight


def test_an_assumed_arm_bends_by_like_angles() -> None:
    """An arm of half the size, of assumed masses, sinks by half as much at the same readings."""
    cell, _ = _cell(9)
    small = replace(cell.robot, a=cell.robot.a / 2, d=cell.robot.d / 2)
    q = cell.joints_rad[:5]
    big, little = (Compliant(r, assumed_compliance(r)).deviation(q, np.zeros(0)) for r in (cell.robot, small))
    np.testing.assert_allclose(big, little, rtol=1e-9)
    assert GRAVITY > 0
    assert isinstance(cell.T_hand_sensor, Pose)
