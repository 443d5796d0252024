"""A wrong answer is never called trustworthy: the paper's method, mirror images, levers, given jig poses."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import chi2

from calib import CalibConfig
from calib.paper.check import checked
from calib.printed import nees
from calib.result import Estimate, Verdict
from calib.synthetic.cell import CellFrames, Layout, Noise, SyntheticCell, calibrated, made_cell, observe, random_cell
from calib.synthetic.degenerate import constant_lever, mirror_frames
from geometry import Pose
from tests.pinned import pinned

PAPER = CalibConfig(method="paper")
FEW = Layout(places=(("A", "calibrate", 3), ("B", "calibrate", 3), ("C", "calibrate", 3)))
TAIL = 1e-7  # of 6 degrees of freedom, over the runs here


def _cell(seed: int) -> tuple[SyntheticCell, SyntheticCell, CellFrames]:
    rng = np.random.default_rng(seed)
    cell = random_cell(rng, FEW)
    made = made_cell(cell, rng, Noise())
    return cell, made, observe(cell, made, rng, Noise())


def test_paper_answers_that_are_trusted_are_within_their_sigma() -> None:
    """Three frames a location: few enough that a mirror image of one frame spoils the paper's iteration."""
    trusted = 0
    for seed in range(25):
        cell, made, observed = _cell(seed)
        result = calibrated(observed, cell.jig, cell.robot, PAPER)
        pinned(result)
        if result.verdict.trustworthy and result.T_hand_sensor is not None and result.covariance is not None:
            trusted += 1
            assert nees(made.T_hand_sensor, result.T_hand_sensor, result.covariance) < chi2.isf(TAIL, 6)
    assert trusted > 15


@pytest.mark.parametrize(("offset_mm", "code"), [(0.0, "ok"), (40.0, "not_converged")])
def test_paper_is_held_against_all_points_together(offset_mm: float, code: str) -> None:
    n = np.zeros(0)
    bundle = Estimate(
        T_hand_sensor=Pose.identity(),
        covariance=np.diag([0.2**2] * 3 + [1e-3**2] * 3),
        robot=None,
        robot_delta=n,
        robot_sigma=n,
        chi2_per_dof=1.0,
        degrees_of_freedom=10,
        converged=True,
        iterations=3,
        initial_cost=1.0,
        final_cost=1.0,
        condition=10.0,
        noise={},
    )
    paper = replace(bundle, T_hand_sensor=Pose(np.eye(3), np.array([offset_mm, 0, 0])))
    ok = Verdict("ok", "")
    assert checked(ok, paper, ok, bundle).code == code
    assert checked(ok, paper, Verdict("outliers", ""), bundle).code == "outliers"


@pytest.mark.parametrize("seed", range(3))
def test_mirror_images_that_nothing_resolves_are_ambiguous(seed: int) -> None:
    rng = np.random.default_rng(seed)
    cell = random_cell(rng, FEW)
    frames = mirror_frames(cell, rng, Noise())
    assert calibrated(frames, cell.jig, None).verdict.code == "ambiguous_pose"
    assert not calibrated(frames, cell.jig, None, PAPER).verdict.trustworthy


@pytest.mark.parametrize("seed", range(3))
def test_lever_that_stands_still_is_said_of_the_paper_alone(seed: int) -> None:
    rng = np.random.default_rng(seed)
    cell = random_cell(rng, FEW)
    frames = constant_lever(cell, rng, Noise())
    assert calibrated(frames, cell.jig, None, PAPER).verdict.code == "lever_constant"
    assert calibrated(frames, cell.jig, None).verdict.trustworthy


@pytest.mark.parametrize(
    "wrong", [Pose(np.eye(3), np.array([2500.0, 0, 0])), Pose.from_fixed_xyz_deg([0, 0, 60.0], [0, 0, 0])]
)
def test_wrong_given_jig_pose_is_named(wrong: Pose) -> None:
    cell, _, observed = _cell(1)
    right = {k: T for k, T in cell.T_base_jig.items() if k != "B"}
    given = {**right, "B": cell.T_base_jig["B"] @ wrong}
    result = calibrated(replace(observed, places=given), cell.jig, cell.robot)
    pinned(result)
    plain = calibrated(observed, cell.jig, cell.robot)
    assert [n for n in result.notes if "T_base_jig" in n and "[locations.B]" in n]
    assert not [n for n in result.notes if "[locations.A]" in n or "[locations.C]" in n]
    assert result.T_hand_sensor is not None
    assert plain.T_hand_sensor is not None
    np.testing.assert_allclose(result.T_hand_sensor.matrix, plain.T_hand_sensor.matrix, atol=1e-9)
