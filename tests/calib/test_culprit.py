"""What spoilt a data set is named: frames, joint columns, a row of the robot's table, the jig."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from calib.config import CalibConfig
from calib.hands import placed
from calib.judge.culprits import culprit
from calib.judge.culprits_jig import wrong_jig
from calib.label.all_frames import label_frames
from calib.synthetic.cell import Noise, SyntheticCell, calibrated, default_sensor, made_cell, observe, random_cell
from calib.synthetic.problem import CALIBRATE_ONLY
from geometry import DhRobot, Frame
from jig_cad import Jig
from tests.pinned import pinned

Frames = tuple[Frame, ...]
ATOL_LEFT_OUT = 1e-6  # mm, rad: a frame that was left out pulls nothing


@pytest.fixture(scope="module")
def cell_and_frames() -> tuple[SyntheticCell, Frames]:
    rng = np.random.default_rng(3)
    cell = random_cell(rng, CALIBRATE_ONLY)
    return cell, observe(cell, made_cell(cell, rng, Noise()), rng, Noise()).frames


def _said(cell: SyntheticCell, frames: Frames, robot: DhRobot, jig: Jig | None = None) -> str:
    jig = jig or cell.jig
    labelled = label_frames(placed(frames, robot), jig, default_sensor(), cell.design, {}, CalibConfig())
    return wrong_jig(labelled, jig) or culprit(labelled, jig, robot)


def _named(frames: Frames, where: Callable[[int], bool], location: str) -> Frames:
    return tuple(replace(f, location=location) if where(f.number) else f for f in frames)


def _relabelled(frames: Frames, where: Callable[[int], bool]) -> Frames:
    def turned(f: Frame) -> Frame:
        return replace(f, axis=replace(f.axis, label=tuple(map(Jig.nominal().symmetries[0].relabelled, f.axis.label))))

    return tuple(turned(f) if where(f.number) else f for f in frames)


def _joints(frames: Frames, change: Callable[[np.ndarray], np.ndarray]) -> Frames:
    return tuple(replace(f, joints_rad=change(np.asarray(f.joints_rad))) for f in frames)


SPOILT = {
    "": lambda f: f,
    "joint columns hold radians": lambda f: _joints(f, np.deg2rad),
    "columns of joints 2 and 3 are exchanged": lambda f: _joints(f, lambda q: q[[0, 2, 1, 3, 4, 5]]),
    "joint 4 counts the other way round": lambda f: _joints(f, lambda q: q * [1, 1, 1, -1, 1, 1]),
    "frame 3 does not move as the other frames of location C does but as those of location A": lambda f: _named(
        f, lambda n: n == 3, "C"
    ),
    "frames 7, 8, 9, 10, 11, 12, 13 do not move as the other frames of location A do but as one another": lambda f: (
        _named(f, lambda n: 7 <= n < 14, "A")
    ),
    "labels of frames 2, 9 are those of the jig turned by half": lambda f: _relabelled(f, lambda n: n in (2, 9)),
}


@pytest.mark.parametrize("words", SPOILT)
def test_frames_and_joint_columns(words: str, cell_and_frames: tuple[SyntheticCell, Frames]) -> None:
    cell, frames = cell_and_frames
    said = _said(cell, SPOILT[words](frames), cell.robot)
    assert words in said
    assert bool(said) == bool(words)


def test_frames_that_hardly_turn_are_not_accused(cell_and_frames: tuple[SyntheticCell, Frames]) -> None:
    """Location A holds two configurations, four times each: pairs without an axis say nothing against a frame."""
    cell, frames = cell_and_frames
    copies = tuple(replace(frames[k % 2], number=k) for k in range(8))
    kept = (*copies, *(replace(f, number=f.number + 1) for f in frames[7:]))
    assert _said(cell, kept, cell.robot) == ""
    assert "labels of frame 10 are those" in _said(cell, _relabelled(kept, lambda n: n == 10), cell.robot)


def test_row_of_another_arm(cell_and_frames: tuple[SyntheticCell, Frames]) -> None:
    cell, frames = cell_and_frames
    assert "d of joint 4 in the robot's table is changed by about +142 mm" in _said(
        cell, frames, cell.robot.with_changes(d=-142.0 * np.eye(6)[3])
    )


def test_jig_of_another_size(cell_and_frames: tuple[SyntheticCell, Frames]) -> None:
    cell, frames = cell_and_frames
    side = cell.jig.side_mm
    said = _said(cell, frames, cell.robot, Jig.nominal(side_mm=0.8 * side, height_mm=cell.jig.height_mm))
    assert f"side_mm is about {side:.0f}, not {0.8 * side:g}" in said


def test_verdict_says_it_first(cell_and_frames: tuple[SyntheticCell, Frames]) -> None:
    cell, frames = cell_and_frames
    observed = observe(cell, cell, np.random.default_rng(0), Noise())
    turned = _joints(frames, lambda q: q * [1, 1, 1, -1, 1, 1])
    verdict = calibrated(replace(observed, frames=turned), cell.jig, cell.robot).verdict
    assert not verdict.trustworthy
    assert "joint 4 counts the other way round" in verdict.text.split("In all")[0]


def test_single_misnamed_frames_are_left_out_and_named(cell_and_frames: tuple[SyntheticCell, Frames]) -> None:
    cell, frames = cell_and_frames
    observed = observe(cell, cell, np.random.default_rng(0), Noise())
    without = calibrated(replace(observed, frames=tuple(f for f in frames if f.number != 3)), cell.jig, cell.robot)
    pinned(without)
    result = calibrated(replace(observed, frames=_named(frames, lambda n: n == 3, "C")), cell.jig, cell.robot)
    pinned(result)
    assert result.verdict.code == "ok"
    assert [f.number for f in result.frames if f.reason == "outlier"] == [3]
    assert any("location C" in r and "location A: its location is misnamed" in r for r in result.remarks)
    apart = without.T_hand_sensor.inverse() @ result.T_hand_sensor
    assert np.max(np.abs(apart.log())) < ATOL_LEFT_OUT
    for name, location in without.locations.items():
        same = result.locations[name]
        assert same.point_rms_mm.solved == pytest.approx(location.point_rms_mm.solved, abs=ATOL_LEFT_OUT)
    far = result.frames[3].residual_mm
    assert far is not None
    assert np.all(far > 10 * result.locations["A"].point_rms_mm.solved)
