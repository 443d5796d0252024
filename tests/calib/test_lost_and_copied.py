"""Order, copies, lonely frames, and most frames lost: what the answer hangs on, and what it must not."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from calib import CalibrationResult
from calib.synthetic.cell import CellFrames, Noise, SyntheticCell, calibrated, made_cell, observe, random_cell
from geometry import Frame
from tests.pinned import pinned

ATOL_MM = 1e-9


@pytest.fixture(scope="module")
def cell() -> SyntheticCell:
    return random_cell(np.random.default_rng(5))


@pytest.fixture(scope="module")
def observed(cell: SyntheticCell) -> CellFrames:
    rng = np.random.default_rng(6)
    return observe(cell, made_cell(cell, rng, Noise()), rng, Noise())


@pytest.fixture(scope="module")
def plain(cell: SyntheticCell, observed: CellFrames) -> CalibrationResult:
    return calibrated(observed, cell.jig, cell.robot)


def _translation(result: CalibrationResult) -> np.ndarray:
    assert result.T_hand_sensor is not None
    return result.T_hand_sensor.t


def test_the_order_of_frames_changes_no_digit(
    cell: SyntheticCell, observed: CellFrames, plain: CalibrationResult
) -> None:
    order = np.random.default_rng(7).permutation(len(observed.frames))
    shuffled = replace(observed, frames=tuple(observed.frames[i] for i in order))
    result = calibrated(shuffled, cell.jig, cell.robot)
    pinned(result)
    assert np.array_equal(_translation(result), _translation(plain))
    assert result.verdict == plain.verdict
    assert result.locations.keys() == plain.locations.keys()


def test_copies_count_once_and_are_named(cell: SyntheticCell, observed: CellFrames, plain: CalibrationResult) -> None:
    twins = tuple(replace(f, number=100 * n + f.number) for n in (1, 2) for f in observed.frames[:20])
    result = calibrated(replace(observed, frames=observed.frames + twins), cell.jig, cell.robot)
    pinned(result)
    assert np.array_equal(_translation(result), _translation(plain))
    assert result.chi2_per_dof == plain.chi2_per_dof
    assert result.locations["A"].max_deviation_mm == plain.locations["A"].max_deviation_mm
    assert {f.number for f in result.frames if f.reason == "copy"} == {f.number for f in twins}
    assert any("copies" in note and "3 = 103 = 203" in note for note in result.notes)


@pytest.mark.parametrize("joint", [0, 1, 4])
def test_one_frame_with_a_joint_a_degree_off_is_left_out_by_name(
    cell: SyntheticCell, observed: CellFrames, plain: CalibrationResult, joint: int
) -> None:
    frames = list(observed.frames)
    joints = frames[5].joints_rad
    assert joints is not None
    frames[5] = replace(frames[5], joints_rad=joints + np.deg2rad(np.eye(6)[joint]))
    result = calibrated(replace(observed, frames=tuple(frames)), cell.jig, cell.robot)
    pinned(result)
    assert result.verdict.trustworthy
    assert [f.number for f in result.frames if f.reason == "outlier"] == [frames[5].number]
    assert any(f"frame {frames[5].number} " in note and "The answer does without it" in note for note in result.notes)
    assert result.covariance is not None
    assert plain.T_hand_sensor is not None
    assert result.T_hand_sensor is not None
    moved = (plain.T_hand_sensor.inverse() @ result.T_hand_sensor).log()
    assert float(moved @ np.linalg.solve(result.covariance, moved)) < 6.0


def test_one_recording_with_two_readings_is_no_copy_but_named(cell: SyntheticCell, observed: CellFrames) -> None:
    other = replace(observed.frames[0], axis=observed.frames[3].axis)
    result = calibrated(replace(observed, frames=(other, *observed.frames[1:])), cell.jig, cell.robot)
    pinned(result)
    assert not any(f.reason == "copy" for f in result.frames)
    assert any("0 = 3" in note and "different joint readings" in note for note in result.notes)


def test_a_frame_alone_has_no_figures_and_spoils_none(
    cell: SyntheticCell, observed: CellFrames, plain: CalibrationResult
) -> None:
    """Its own place fits whatever it shows; a point that is 3 mm off makes an outlier of itself at most."""
    for off_mm in (0.0, 3.0):
        first = observed.frames[0]
        yz = first.axis.yz_mm.copy()
        yz[1] += off_mm
        lonely = replace(first, location="E", axis=replace(first.axis, yz_mm=yz))
        result = calibrated(replace(observed, frames=(lonely, *observed.frames[1:])), cell.jig, cell.robot)
        pinned(result)
        assert result.verdict.code == plain.verdict.code
        assert result.locations["E"].point_rms_mm.solved is None
        assert result.locations["E"].max_deviation_mm.design is None
        assert not any("outlier" in f.axis.flag for f in result.frames[1:])
        assert any('location "E" has frame 0 alone' in note for note in result.notes)


def _with_readings(observed: CellFrames, of: dict[int, int]) -> CellFrames:
    """The frames, some with the joint readings of other rows."""
    frames = observed.frames
    readings = [frames[of.get(i, i)].joints_rad for i in range(len(frames))]
    return replace(observed, frames=tuple(replace(f, joints_rad=q) for f, q in zip(frames, readings, strict=True)))


@pytest.mark.parametrize(("start", "step"), [(10, 1), (6, -1), (0, 1)])
def test_rows_that_are_late_are_found_with_their_start(
    cell: SyntheticCell, observed: CellFrames, start: int, step: int
) -> None:
    """Step 1: a reading is missing, each row has the next one's; -1: one is doubled."""
    last = len(observed.frames) - 1
    late = _with_readings(observed, {i: min(i + step, last) for i in range(start, last + 1) if i + step >= 0})
    result = calibrated(late, cell.jig, cell.robot)
    pinned(result)
    assert result.verdict.code == "frames_contradict"
    assert not result.verdict.trustworthy
    assert result.T_hand_sensor is None
    where = f"from frame {start} on " if start else ""
    assert f"{where}each row is one late" in result.verdict.text


@pytest.mark.parametrize("of", [{7 + i: 13 - i for i in range(7)}, {i: i - 1 for i in range(8, 14)}])
def test_rows_exchanged_at_one_place_alone_are_found(
    cell: SyntheticCell, observed: CellFrames, of: dict[int, int]
) -> None:
    result = calibrated(_with_readings(observed, of), cell.jig, cell.robot)
    pinned(result)
    assert result.verdict.code == "frames_contradict"
    assert not result.verdict.trustworthy
    assert "are not each other's rows" in result.verdict.text


def test_places_under_one_name_are_told_apart(cell: SyntheticCell, observed: CellFrames) -> None:
    one = tuple(replace(f, location="A", role="calibrate") for f in observed.frames)
    result = calibrated(replace(observed, frames=one), cell.jig, cell.robot)
    pinned(result)
    assert result.verdict.code == "frames_contradict"
    assert "the column says A throughout" in result.verdict.text
    assert "frames 7, 8, 9, 10, 11, 12, 13" in result.verdict.text


def test_lost_frames_are_no_lack_of_poses(cell: SyntheticCell, observed: CellFrames) -> None:
    lost = tuple(replace(f, reason="image_unreadable") if i % 7 else f for i, f in enumerate(observed.frames))
    result = calibrated(replace(observed, frames=lost), cell.jig, cell.robot)
    pinned(result)
    assert result.verdict.code == "frames_contradict"
    assert "images unreadable" in result.verdict.text
    few = replace(observed, frames=observed.frames[:2])
    assert calibrated(few, cell.jig, cell.robot).verdict.code == "too_few_poses"


def test_a_third_of_the_frames_may_be_lost(cell: SyntheticCell, observed: CellFrames) -> None:
    def spoilt(f: Frame) -> Frame:
        return replace(f, reason="no_spots") if f.number % 3 == 0 and f.role == "calibrate" else f

    result = calibrated(replace(observed, frames=tuple(map(spoilt, observed.frames))), cell.jig, cell.robot)
    pinned(result)
    assert result.verdict.trustworthy


def test_noise_that_is_larger_than_stated_is_said(cell: SyntheticCell, observed: CellFrames) -> None:
    def surer(f: Frame) -> Frame:
        assert f.axis is not None
        return replace(f, axis=replace(f.axis, cov_yz_mm2=f.axis.cov_yz_mm2 / 2.2))

    result = calibrated(replace(observed, frames=tuple(map(surer, observed.frames))), cell.jig, cell.robot)
    pinned(result)
    assert result.verdict.code == "ok"
    assert "and the σ given follow" in result.verdict.text
