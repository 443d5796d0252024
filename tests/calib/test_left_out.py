"""Parts predicted by the others, and σ no smaller than the jackknife's."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np
import pytest

from calib import CalibConfig, calibrate
from calib.judge import at_least_jackknife
from calib.result import LeftOut, LeftOutPart
from calib.synthetic.surfaces import ProfileNoise, observe_surface, surface_cell
from geometry import Frame
from jig_cad import Sphere

REAL = Path(os.environ.get("PERCEPTRON_EMU_DATA", "nowhere")) / "real" / "sphere_fanuc"


def test_the_wider_of_two_covariances_bounds_both() -> None:
    rng = np.random.default_rng(1)
    root = rng.normal(size=(6, 6))
    cov = root @ root.T
    shifts = rng.normal(size=(12, 6)) * 2
    parts = LeftOut("frame", 0.1, tuple(LeftOutPart(str(i), 0.1, s) for i, s in enumerate(shifts)))
    off = shifts - shifts.mean(axis=0)
    jackknife = 11 / 12 * off.T @ off
    wide = at_least_jackknife(cov, parts)
    for smaller in (cov, jackknife):
        assert np.linalg.eigvalsh(wide - smaller)[0] > -1e-9 * np.linalg.eigvalsh(wide)[-1]
    assert at_least_jackknife(1e6 * cov, parts) == pytest.approx(1e6 * cov)


def test_locations_are_left_out_or_frames_where_there_is_one() -> None:
    rng = np.random.default_rng(6)
    cell = surface_cell(Sphere(40.0), rng, (("A", "calibrate", 9), ("B", "calibrate", 9)))
    seen = observe_surface(cell, rng, ProfileNoise(), 60, labelled=False)
    config = CalibConfig(model="full")
    both = calibrate(seen.frames, cell.target, cell.robot, seen.sensor, seen.design, config=config).left_out
    assert both is not None
    assert both.by == "location"
    assert [p.name for p in both.parts] == ["A", "B"]
    own = tuple(
        Frame(f.number, "A", T_base_hand=cell.built.pose(f.joints_rad), axis=f.axis)
        for f in seen.frames
        if f.location == "A" and f.joints_rad is not None
    )
    one = calibrate(own, cell.target, None, seen.sensor, None, config=CalibConfig(model="scp")).left_out
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
