"""One wrong number, or rows that are not their profiles', where a ball is measured: named, and the answer's σ hold.

A ball's sections are known to microns, so that gates by their noise see outliers everywhere before anything is named.
Few cells; benchmarks/calib_faults_surfaces.py has the rates over kinds, balls, plates and wedges.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from calib import CalibrationResult, calibrate
from calib.printed import nees
from calib.synthetic.surfaces import ProfileNoise, SurfaceCell, observe_surface, surface_cell
from geometry import Frame
from jig_cad import Sphere
from tests.pinned import pinned

NEES_LIMIT = 30.0  # a sound covariance exceeds it in 4 of 100,000 runs


def _cell(seed: int, views: int = 7) -> tuple[SurfaceCell, tuple[Frame, ...]]:
    rng = np.random.default_rng(seed)
    cell = surface_cell(Sphere(40.0), rng, tuple((name, "calibrate", views) for name in "ABC"))
    return cell, observe_surface(cell, rng, ProfileNoise(correlation=0.5), 200, labelled=False).frames


def _solved(cell: SurfaceCell, frames: list[Frame]) -> CalibrationResult:
    from calib.synthetic.cell import default_sensor

    return calibrate(frames, cell.target, cell.robot, default_sensor(), cell.design)


def _read(f: Frame) -> np.ndarray:
    assert f.joints_rad is not None
    return f.joints_rad.copy()


@pytest.mark.parametrize(
    ("named", "joint", "scale", "off_deg", "size"),
    [
        ("reading_scale3", 3, 1.003, 0.0, -0.3),
        ("theta5", 5, 1.0, 0.9, -0.9),
        ("theta3", 3, 1.0, -0.6, 0.6),
    ],
)
def test_reading_of_a_ball_that_is_off_is_named(
    named: str, joint: int, scale: float, off_deg: float, size: float
) -> None:
    cell, frames = _cell(4)
    bad = []
    for f in frames:
        q = _read(f)
        q[joint - 1] = scale * q[joint - 1] + np.deg2rad(off_deg)
        bad.append(replace(f, joints_rad=q))
    result = _solved(cell, bad)
    pinned(result)
    assert result.verdict.code == "priors_contradict"
    (culprit,) = result.culprit
    assert named in (culprit.parameter, *culprit.same_as)
    if culprit.parameter == named:
        assert abs(culprit.size - size) < 0.15
    assert result.T_hand_sensor is not None
    assert result.covariance is not None
    assert nees(cell.T_hand_sensor, result.T_hand_sensor, result.covariance) < NEES_LIMIT


@pytest.mark.parametrize("fault", ["location", pytest.param("joint", marks=pytest.mark.slow)])
def test_row_of_a_ball_that_is_not_its_profiles_is_left_out_and_named(fault: str) -> None:
    cell, frames = _cell(5)
    bad = list(frames)
    if fault == "location":
        bad[9] = replace(bad[9], location="A")
    else:
        q = _read(bad[9])
        q[1] += np.deg2rad(1.0)
        bad[9] = replace(bad[9], joints_rad=q)
    result = _solved(cell, bad)
    assert result.verdict.code == "ok"
    assert [f.number for f in result.frames if not f.used] == [9]
    assert any(words.startswith("frame 9 contradicts all others") for words in result.remarks)
    assert result.T_hand_sensor is not None
    assert result.covariance is not None
    assert nees(cell.T_hand_sensor, result.T_hand_sensor, result.covariance) < NEES_LIMIT


@pytest.mark.slow
def test_rows_of_a_ball_that_are_late_from_one_frame_on_are_named() -> None:
    cell, frames = _cell(6, 5)
    late = [replace(f, joints_rad=frames[i - 1].joints_rad) if i >= 9 else f for i, f in enumerate(frames)]
    result = _solved(cell, late)
    assert result.verdict.code == "frames_contradict"
    assert "from frame 9 on profiles and poses are out of step" in result.verdict.text
    assert "taken with the row after its own" in result.verdict.text
