"""Parts predicted by the others, and σ no smaller than the jackknife's."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np
import pytest

from calib import CalibConfig, calibrate
from calib.judge import at_least, jackknife_covariance
from calib.synthetic.surfaces import ProfileNoise, observe_surface, surface_cell
from geometry import Frame, Pose
from jig_cad import Sphere
from tests.pinned import pinned

REAL = Path(os.environ.get("PERCEPTRON_EMU_DATA", "nowhere")) / "real" / "sphere_fanuc"


def test_the_wider_of_two_covariances_bounds_both() -> None:
    rng = np.random.default_rng(1)
    root = rng.normal(size=(6, 6))
    cov = root @ root.T
    shifts = rng.normal(size=(12, 6)) * 2
    jackknife = jackknife_covariance(shifts)
    assert jackknife == pytest.approx(11 * np.cov(shifts.T, bias=True))
    wide = at_least(cov, jackknife)
    for smaller in (cov, jackknife):
        assert np.linalg.eigvalsh(wide - smaller)[0] > -1e-9 * np.linalg.eigvalsh(wide)[-1]
    assert at_least(1e6 * cov, jackknife) == pytest.approx(1e6 * cov)


def test_points_weighted_alike_are_the_plain_least_squares() -> None:
    """Against scipy on every point's own distance from the ball; nodes stand for points to second order."""
    from scipy.optimize import least_squares

    atol_mm, atol_rad = 0.01, 2e-5  # hundredths of σ
    rng = np.random.default_rng(12)
    cell = surface_cell(Sphere(40.0), rng, (("A", "calibrate", 12),))
    seen = observe_surface(cell, rng, ProfileNoise(), 60, labelled=False)
    hands = cell.built.pose(cell.joints_rad)
    own = tuple(Frame(f.number, "A", T_base_hand=hands[f.number], axis=f.axis) for f in seen.frames)
    result = calibrate(own, cell.target, None, seen.sensor, None)
    pinned(result)
    alike = result.equal_weights
    assert alike is not None
    assert result.covariance is not None
    assert result.left_out is not None
    assert result.locations["A"].T_base_target is not None

    def distances(x: np.ndarray) -> np.ndarray:
        chain = [f.T_base_hand @ alike.T_hand_sensor @ Pose.exp(x[:6]) for f in own if f.T_base_hand is not None]
        points = [p @ np.column_stack([np.zeros(len(f.axis)), f.axis.yz_mm]) for p, f in zip(chain, own, strict=True)]
        return np.asarray(np.linalg.norm(np.concatenate(points) - centre - x[6:], axis=1) - 20.0)

    centre = result.locations["A"].T_base_target.t
    found = least_squares(distances, np.zeros(9), x_scale=[1, 1, 1, 1e-3, 1e-3, 1e-3, 1, 1, 1])
    np.testing.assert_allclose(found.x[:3], 0, rtol=0, atol=atol_mm)
    np.testing.assert_allclose(found.x[3:6], 0, rtol=0, atol=atol_rad)
    assert alike.point_rms_mm == pytest.approx(float(np.sqrt(np.mean(found.fun**2))), rel=1e-3)
    assert alike.left_out_rms_mm > alike.point_rms_mm
    for smaller in (alike.covariance, jackknife_covariance(np.array([p.shift for p in result.left_out.parts]))):
        assert np.linalg.eigvalsh(result.covariance - smaller)[0] > -1e-9 * np.linalg.eigvalsh(result.covariance)[-1]


def test_locations_are_left_out_or_frames_where_there_is_one() -> None:
    rng = np.random.default_rng(6)
    cell = surface_cell(Sphere(40.0), rng, (("A", "calibrate", 9), ("B", "calibrate", 9)))
    seen = observe_surface(cell, rng, ProfileNoise(), 60, labelled=False)
    config = CalibConfig(model="full")
    both = calibrate(seen.frames, cell.target, cell.robot, seen.sensor, seen.design, config=config).left_out
    pinned(both)
    assert both is not None
    assert both.by == "location"
    assert [p.name for p in both.parts] == ["A", "B"]
    own = tuple(
        Frame(f.number, "A", T_base_hand=cell.built.pose(f.joints_rad), axis=f.axis)
        for f in seen.frames
        if f.location == "A" and f.joints_rad is not None
    )
    one = calibrate(own, cell.target, None, seen.sensor, None, config=CalibConfig(model="scp")).left_out
    pinned(one)
    assert one is not None
    assert one.by == "frame"
    assert len(one.parts) == 9
    assert 0 < one.point_rms_mm < 0.5


@pytest.mark.skipif(not REAL.is_dir(), reason="PERCEPTRON_EMU_DATA names no folder with real/sphere_fanuc")
def test_a_real_ball_is_fitted_and_called_weak() -> None:
    """15 profiles without an initial value: what is left, leaving a pose out, and the verdict."""
    from workbench.cell import observe, solve
    from workbench.files import read_cell

    cell = read_cell(REAL)
    result = solve(cell, observe(cell))
    assert result.verdict.code == "weak"
    location = result.locations["A"]
    assert location.n_found >= 0.98 * location.n_points
    assert location.point_rms_mm.solved is not None
    assert location.point_rms_mm.solved <= 0.12
    assert result.left_out is not None
    assert result.left_out.point_rms_mm <= 0.15
    assert result.sigma_translation_mm is not None
    assert result.sigma_translation_mm.min() > 0.35
    assert result.sigma_rotation_deg is not None
    assert np.linalg.norm(result.sigma_rotation_deg) >= 0.77
    alike = result.equal_weights
    assert alike is not None
    assert alike.point_rms_mm == pytest.approx(0.092, abs=0.001)
    assert alike.left_out_rms_mm <= 0.137
