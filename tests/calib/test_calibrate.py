"""calibrate as a whole on given axis points: answers, figures, verdicts."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest

from calib import CalibConfig
from calib.printed import nees
from calib.synthetic.cell import CellFrames, Noise, SyntheticCell, calibrated, made_cell, observe, random_cell
from geometry import InputError, Pose
from jig_cad import Jig
from tests.pinned import pinned

NEES_LIMIT = 30.0  # a sound covariance exceeds it in 4 of 100,000 runs
ATOL_MM = 1e-9


@pytest.fixture(scope="module")
def cell() -> SyntheticCell:
    return random_cell(np.random.default_rng(11))


@pytest.fixture(scope="module")
def made(cell: SyntheticCell) -> SyntheticCell:
    return made_cell(cell, np.random.default_rng(12), Noise())


@pytest.fixture(scope="module")
def observed(cell: SyntheticCell, made: SyntheticCell) -> CellFrames:
    return observe(cell, made, np.random.default_rng(13), Noise())


def _calibrate_frames(observed: CellFrames) -> CellFrames:
    return replace(observed, frames=tuple(f for f in observed.frames if f.role == "calibrate"))


@pytest.mark.parametrize("model", ["scp", "scp+offsets", "full"])
def test_truth_lies_within_sigma(cell: SyntheticCell, made: SyntheticCell, observed: CellFrames, model: str) -> None:
    """One cell; that σ is true on average is the benchmark's business."""
    result = calibrated(observed, cell.jig, cell.robot, CalibConfig(model=model))
    assert result.T_hand_sensor is not None
    assert result.covariance is not None
    assert nees(made.T_hand_sensor, result.T_hand_sensor, result.covariance) < NEES_LIMIT
    assert result.verdict.code == "ok"  # errors of the robot's stated size are no misfit
    assert ("σ carry these errors" in result.verdict.text) == (model == "scp")


def test_full_model_beats_scp_at_the_verify_location(cell: SyntheticCell, observed: CellFrames) -> None:
    figures = {
        model: calibrated(observed, cell.jig, cell.robot, CalibConfig(model=model)).locations["D"]
        for model in ("scp", "full")
    }
    for name in ("max_deviation_mm", "spread_3d_mm", "point_rms_mm"):
        scp, full = getattr(figures["scp"], name), getattr(figures["full"], name).solved
        assert scp.design > 3 * scp.solved
        assert scp.solved > full


def test_figures_are_what_they_are_defined_as(cell: SyntheticCell, observed: CellFrames) -> None:
    """Fig. 7's deviation and the spread again from each frame's own pose, the rms again from the residuals."""
    result = calibrated(observed, cell.jig, cell.robot, CalibConfig(model="scp"))
    assert result.T_hand_sensor is not None
    for name, location in result.locations.items():
        frames = [f for f in result.frames if f.location == name]
        joints = np.array([f.joints_rad for f in observed.frames if f.location == name])
        hands = cell.robot.pose(joints)
        own = [f.T_sensor_target for f in frames]
        x = np.array([(hands[i] @ result.T_hand_sensor @ p).t for i, p in enumerate(own) if p is not None])
        distance = np.linalg.norm(x, axis=1)
        assert location.max_deviation_mm.solved == pytest.approx(
            np.max(np.abs(distance - distance.mean())), abs=ATOL_MM
        )
        spread = np.max(np.linalg.norm(x - x.mean(axis=0), axis=1))
        assert location.spread_3d_mm.solved == pytest.approx(spread, abs=ATOL_MM)
        residuals = np.concatenate([f.residual_mm for f in frames])
        assert location.point_rms_mm.solved == pytest.approx(np.sqrt(np.mean(residuals**2)), abs=ATOL_MM)


def test_outlying_point_is_flagged_but_stays_in_the_figures(cell: SyntheticCell, observed: CellFrames) -> None:
    bad = observed.frames[3]
    moved = bad.axis.yz_mm.copy()
    moved[2] += [3.0, -2.0]
    frames = list(observed.frames)
    frames[3] = replace(bad, axis=replace(bad.axis, yz_mm=moved))
    clean = calibrated(observed, cell.jig, cell.robot, CalibConfig(model="full"))
    result = calibrated(replace(observed, frames=tuple(frames)), cell.jig, cell.robot, CalibConfig(model="full"))
    assert result.frames[3].axis.flag == ("", "", "outlier", "", "")
    assert result.frames[3].used
    assert result.locations["A"].point_rms_mm.solved > 3 * clean.locations["A"].point_rms_mm.solved
    assert result.T_hand_sensor is not None
    assert clean.T_hand_sensor is not None
    assert np.linalg.norm((clean.T_hand_sensor.inverse() @ result.T_hand_sensor).t) < 0.05


def test_verify_frames_never_enter_the_solution(cell: SyntheticCell, observed: CellFrames) -> None:
    both = calibrated(observed, cell.jig, cell.robot)
    alone = calibrated(_calibrate_frames(observed), cell.jig, cell.robot)
    assert both.T_hand_sensor is not None
    assert alone.T_hand_sensor is not None
    np.testing.assert_array_equal(both.T_hand_sensor.matrix, alone.T_hand_sensor.matrix)


def test_base_frame_does_not_matter(cell: SyntheticCell, observed: CellFrames) -> None:
    """The robot standing elsewhere, turned, gives the same SCP and the same σ."""
    elsewhere = Pose.exp(np.array([500.0, -300.0, 200.0, 0.3, -0.2, 1.0]))
    here = calibrated(observed, cell.jig, cell.robot)
    there = calibrated(observed, cell.jig, replace(cell.robot, T_base_first=elsewhere))
    assert here.T_hand_sensor is not None
    assert there.T_hand_sensor is not None
    assert np.max(np.abs((here.T_hand_sensor.inverse() @ there.T_hand_sensor).log())) < 1e-6
    np.testing.assert_allclose(here.sigma_translation_mm, there.sigma_translation_mm, rtol=1e-4)


def test_hand_poses_in_place_of_joints(cell: SyntheticCell, made: SyntheticCell, observed: CellFrames) -> None:
    """Their noise is estimated and said to be; a model that corrects the robot is refused."""
    frames = tuple(replace(f, joints_rad=None, T_base_hand=made.robot.pose(f.joints_rad)) for f in observed.frames)
    poses = replace(observed, frames=frames)
    result = calibrated(poses, cell.jig, None)
    assert result.T_hand_sensor is not None
    assert result.covariance is not None
    assert nees(made.T_hand_sensor, result.T_hand_sensor, result.covariance) < NEES_LIMIT
    assert 0.005 < result.estimate.noise["hand_sigma_mm"] < 0.5  # joints of 0.003° at two metres
    with pytest.raises(InputError, match="joint readings") as refused:
        calibrated(poses, cell.jig, None, CalibConfig(model="full"))
    pinned(str(refused.value))


def test_paper_method_answers_with_its_own_sigma(
    cell: SyntheticCell, made: SyntheticCell, observed: CellFrames
) -> None:
    result = calibrated(observed, cell.jig, cell.robot, CalibConfig(method="paper"))
    bundle = calibrated(observed, cell.jig, cell.robot)
    assert result.T_hand_sensor is not None
    assert result.covariance is not None
    assert bundle.covariance is not None
    assert nees(made.T_hand_sensor, result.T_hand_sensor, result.covariance) < NEES_LIMIT
    assert np.trace(result.covariance[:3, :3]) > np.trace(bundle.covariance[:3, :3])


def _two(observed: CellFrames) -> CellFrames:
    return replace(observed, frames=observed.frames[:2])


def _alike(observed: CellFrames) -> CellFrames:
    return replace(observed, frames=tuple(replace(observed.frames[0], number=i) for i in range(5)))


def _radians(observed: CellFrames) -> CellFrames:
    frames = tuple(replace(f, joints_rad=np.deg2rad(f.joints_rad)) for f in observed.frames)
    return replace(observed, frames=frames)


def _half_outliers(observed: CellFrames) -> CellFrames:
    rng = np.random.default_rng(5)
    frames = []
    for f in observed.frames:
        shift = (rng.random(len(f.axis)) < 0.5)[:, None] * rng.uniform(-20, 20, (len(f.axis), 2))
        frames.append(replace(f, axis=replace(f.axis, yz_mm=f.axis.yz_mm + shift)))
    return replace(observed, frames=tuple(frames))


@pytest.mark.parametrize(
    ("spoil", "codes"),
    [
        (_two, {"too_few_poses"}),
        (_alike, {"poses_not_distinct"}),
        (_radians, {"rotation_too_small", "not_converged", "outliers"}),
        (_half_outliers, {"outliers", "not_converged", "too_few_poses"}),
    ],
)
def test_bad_data_are_said_to_be_bad(cell: SyntheticCell, observed: CellFrames, spoil, codes: set[str]) -> None:  # type: ignore[no-untyped-def]
    result = calibrated(spoil(observed), cell.jig, cell.robot)
    assert result.verdict.code in codes
    assert not result.verdict.trustworthy
    assert result.T_hand_sensor is None  # no number whose σ is not true
    assert result.covariance is None


def test_wrong_jig_size_is_no_answer(observed: CellFrames, cell: SyntheticCell) -> None:
    assert not calibrated(observed, Jig.nominal(side_mm=80.0), cell.robot).verdict.trustworthy


def test_unidentifiable_parameters_are_named(cell: SyntheticCell, observed: CellFrames) -> None:
    words = " | ".join(calibrated(observed, cell.jig, cell.robot, CalibConfig(model="full")).weak_directions)
    for names in ("θ1, d1", "θ6, d6, a6, α6", "d2, d3"):
        assert names in words


def test_a_result_prints_on_a_screen(cell: SyntheticCell, observed: CellFrames) -> None:
    """The numbers are those of the record; where none is to be trusted none is shown."""
    result = calibrated(observed, cell.jig, cell.robot, CalibConfig(model="scp"))
    text = str(result)
    lines = text.splitlines()
    assert len(lines) <= 30
    assert max(map(len, lines)) <= 110
    assert result.T_hand_sensor is not None
    for value in (*result.T_hand_sensor.t, *result.T_hand_sensor.fixed_xyz_deg):
        assert f"{value:.4f} ± " in text
    assert result.verdict.code in lines[0]
    assert all(name in text for name in result.locations)
    words = " ".join(text.split())
    assert result.verdict.text in words
    assert f"note: {result.notes[0]}" in words
    few = calibrated(replace(observed, frames=observed.frames[:2]), cell.jig, cell.robot, CalibConfig(model="scp"))
    assert "none that can be trusted" in str(few)
    read = json.loads(result.to_json())
    np.testing.assert_allclose(read["T_hand_sensor"], result.T_hand_sensor.matrix, atol=1e-6)
    assert json.loads(few.to_json())["T_hand_sensor"] is None
