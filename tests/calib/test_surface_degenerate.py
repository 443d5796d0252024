"""Views from which a surface does not tell the SCP are refused by their name, with noise and robot errors as built.

All kinds, over many cells, are benchmarks/calib_degenerate_surfaces.py's business.
"""

from __future__ import annotations

import numpy as np
import pytest

from calib import CalibConfig, calibrate
from calib.printed import nees
from calib.synthetic.surfaces import ProfileNoise, observe_surface, surface_cell
from calib.synthetic.telling_nothing import SPOILT, spoilt_cell
from jig_cad import Edge, Sphere, Wedge
from tests.pinned import pinned

NEES_LIMIT = 22.5  # of six numbers: 1 in 1,000


KINDS = (
    ("sphere, shifts alone", True),
    ("sphere, one axis", False),
    ("sphere, through its middle", False),
    ("one plane, three tilts", True),
    ("one plane, tilts about one axis", False),
    ("edge, crossed square", True),
    ("wedge, shifts alone", False),
)  # and whether a drawing tells where the sensor is mounted


@pytest.mark.parametrize(
    ("name", "by_design"),
    [*KINDS, *(pytest.param(name, not drawn, marks=pytest.mark.slow) for name, drawn in KINDS)],
)
def test_it_is_refused_by_name_with_what_to_add(name: str, by_design: bool) -> None:
    spoilt = SPOILT[name]
    rng = np.random.default_rng(5)
    cell = spoilt_cell(spoilt, rng)
    seen = observe_surface(cell, rng, ProfileNoise(), points=60, labelled=False)
    design = seen.design if by_design else None
    result = calibrate(seen.frames, spoilt.target, cell.robot, seen.sensor, design, config=CalibConfig(model="full"))
    assert not result.verdict.trustworthy
    assert result.T_hand_sensor is None
    assert result.covariance is None
    assert any(w in result.verdict.text for w in spoilt.words), result.verdict.text
    assert "add poses" in result.verdict.text


def test_so_few_frames_that_two_answers_fit_are_no_answer() -> None:
    """Four sections of a ball without a drawing fit a place 0.8 m off as well as the true one; twelve do not."""
    rng = np.random.default_rng(2)
    noise = ProfileNoise(correlation=0.5)
    cell = surface_cell(Sphere(40.0), rng, (("A", "calibrate", 12),), noise)
    seen = observe_surface(cell, rng, noise, 100, labelled=False)
    few, all_of = (calibrate(list(seen.frames)[:n], Sphere(40.0), cell.robot, seen.sensor, None) for n in (4, 12))
    assert few.verdict.code == "ambiguous_pose", few.verdict.text
    assert few.T_hand_sensor is None
    assert "[scp_initial]" in few.verdict.text
    assert all_of.verdict.trustworthy
    assert nees(cell.T_hand_sensor, all_of.T_hand_sensor, all_of.covariance) < NEES_LIMIT


@pytest.mark.parametrize("seed", [10, 18])
def test_few_frames_from_a_drawing_do_not_end_in_a_false_answer(seed: int) -> None:
    """Five sections of a ball: from the drawing alone the solve ends 60 and 150 mm off, by σ of some 10 mm."""
    rng = np.random.default_rng(seed)
    noise = ProfileNoise(correlation=0.5)
    cell = surface_cell(Sphere(40.0), rng, (("A", "calibrate", 5),), noise)
    seen = observe_surface(cell, rng, noise, 100, labelled=False)
    result = calibrate(seen.frames, Sphere(40.0), cell.robot, seen.sensor, seen.design)
    pinned(result)
    assert result.verdict.code in ("weak", "ambiguous_pose")
    if result.T_hand_sensor is not None:
        assert nees(cell.T_hand_sensor, result.T_hand_sensor, result.covariance) < NEES_LIMIT


@pytest.mark.parametrize("by_design", [True, False])
def test_two_views_a_wedge_that_two_answers_fit_are_no_answer(by_design: bool) -> None:
    """Both fit to χ² of 1.6 and 1.7, 8 mm and 5° apart: a search without the drawing must not take either."""
    rng = np.random.default_rng(2)
    noise = ProfileNoise(correlation=0.5)
    places = (("A", "calibrate", 2), ("B", "calibrate", 2), ("C", "calibrate", 2))
    cell = surface_cell(Wedge(90.0), rng, places, noise)
    seen = observe_surface(cell, rng, noise, 100, labelled=False)
    design = seen.design if by_design else None
    result = calibrate(seen.frames, Wedge(90.0), cell.robot, seen.sensor, design)
    pinned(result)
    assert result.verdict.code == "ambiguous_pose", result.verdict.text
    assert result.T_hand_sensor is None


@pytest.mark.slow
def test_an_edge_seen_so_that_its_place_is_open_is_no_fault_of_the_program() -> None:
    """One of the trials behind the verdict meets a location whose equations are singular."""
    rng = np.random.default_rng(17)
    noise = ProfileNoise(correlation=0.5)
    cell = surface_cell(Edge(), rng, (("A", "calibrate", 8),), noise)
    seen = observe_surface(cell, rng, noise, 100, labelled=False)
    result = calibrate(seen.frames, Edge(), cell.robot, seen.sensor, seen.design)
    assert not result.verdict.trustworthy or result.verdict.code == "weak"
