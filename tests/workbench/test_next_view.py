"""The next views on a ball, a plate and a wedge: reached, telling more than random ones, and curing what is open."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from calib.hands import placed
from calib.synthetic.surfaces import ProfileNoise, observe_surface, surface_cell
from calib.synthetic.telling_nothing import SPOILT, spoilt_cell
from geometry import Sensor, Surface
from geometry.sensor import ProfileOutput
from jig_cad import Edge, Plane, Sphere, Wedge
from tests.workbench.helpers import Cli
from workbench.files import Cell, read_frames
from workbench.plan import next_views, plan_limits, propose_on_surface, size_mm

CURED = 0.3  # of the σ that one plane at three tilts leaves, after four more views


@pytest.mark.parametrize("target", [Sphere(40.0), Plane(), Wedge(90.0), Edge()])
def test_the_next_views_are_reached_and_tell_more_than_random_ones(target: Surface, tmp_path: Path) -> None:
    rng = np.random.default_rng(4)
    made = surface_cell(target, rng, (("A", "calibrate", 5), ("B", "calibrate", 5), ("C", "calibrate", 5)))
    seen = observe_surface(made, rng, ProfileNoise(), 40, labelled=False)
    cell = Cell(tmp_path, seen.sensor, target, made.robot, seen.frames, seen.design)
    frames = placed(seen.frames, made.robot)
    plan = next_views(cell, made.T_hand_sensor, dict(made.T_base_target), frames, 3, model="full", compared=20)
    assert len(plan.views) == 3
    for view in plan.views:
        q = view.frame.joints_rad
        assert q is not None
        assert bool(made.robot.within_limits(q))
        assert view.room_mm >= 0
        assert view.frame.number > max(f.number for f in frames)
    after = float(size_mm(plan.after, "E"))
    assert after < float(size_mm(plan.before, "E"))
    assert after <= float(np.median(size_mm(plan.random, "E")))
    sizes = [v.size_mm for v in plan.views]
    assert sizes == sorted(sizes, reverse=True)
    again = next_views(cell, made.T_hand_sensor, dict(made.T_base_target), frames, 1, model="full")
    np.testing.assert_array_equal(again.views[0].frame.joints_rad, plan.views[0].frame.joints_rad)


def test_what_is_open_is_closed(tmp_path: Path) -> None:
    """One plane seen at three tilts leaves a direction open; the views proposed are of other tilts."""
    spoilt = SPOILT["one plane, three tilts"]
    rng = np.random.default_rng(5)
    made = spoilt_cell(spoilt, rng)
    seen = observe_surface(made, rng, ProfileNoise(), 40, labelled=False)
    cell = Cell(tmp_path, seen.sensor, spoilt.target, made.robot, seen.frames, seen.design)
    frames = placed(seen.frames, made.robot)
    plan = next_views(cell, made.T_hand_sensor, dict(made.T_base_target), frames, 4)
    assert float(size_mm(plan.noise, "E")) < CURED * float(size_mm(plan.before, "E"))


def test_a_plan_has_views_of_the_places_that_verify(cli: Cli, tmp_path: Path) -> None:
    """As for strings: numbered on, and none of them counts for the σ predicted."""
    cell, out = tmp_path / "cell", tmp_path / "plan.csv"
    assert cli("init", cell, "--target", "sphere", "--sensor", "lmi_gocator_2340").code == 0
    assert cli("plan", cell, "--per-location", 1, "--out", out).code == 0
    rows = read_frames(out, 6)
    assert sorted(r.number for r in rows) == list(range(len(rows)))
    assert {r.location: r.role for r in rows} == {"A": "calibrate", "B": "calibrate", "C": "calibrate", "D": "verify"}


def test_views_that_are_proposed_together_differ(tmp_path: Path) -> None:
    """At one place, where the best view stays the best once it is chosen; and from those that are there."""
    rng = np.random.default_rng(6)
    made = surface_cell(Sphere(40.0), rng, (("A", "calibrate", 14),))
    seen = observe_surface(made, rng, ProfileNoise(), 40, labelled=False)
    cell = Cell(tmp_path, seen.sensor, made.target, made.robot, seen.frames, seen.design)
    plan = next_views(cell, made.T_hand_sensor, dict(made.T_base_target), placed(seen.frames, made.robot), 12)
    joints = [v.frame.joints_rad for v in plan.views] + [f.joints_rad for f in seen.frames]
    hands = [made.robot.pose(q) for q in joints]
    for i in range(len(plan.views)):
        for other in (h for k, h in enumerate(hands) if k != i):
            assert np.linalg.norm((hands[i].inverse() @ other).log() * ([1.0] * 3 + [300.0] * 3)) > 15.0


def test_a_recorded_place_that_verifies_needs_no_field_of_view(tmp_path: Path) -> None:
    """Its frames show where the sensor sees the target, as those of places that calibrate do."""
    rng = np.random.default_rng(7)
    made = surface_cell(Sphere(40.0), rng, (("A", "calibrate", 4), ("B", "calibrate", 4), ("C", "verify", 3)))
    seen = observe_surface(made, rng, ProfileNoise(), 40, labelled=False)
    sensor = Sensor(seen.sensor.sheet, profile=ProfileOutput(sigma_y_mm=0.03, sigma_z_mm=0.03))
    cell = Cell(tmp_path, sensor, made.target, made.robot, seen.frames, made.T_hand_sensor, made.T_base_target)
    proposal = propose_on_surface(cell, 1, "D", "scp", plan_limits(30.0, 90.0, 3.0), 0)
    assert {r.location: r.role for r in proposal.rows}["C"] == "verify"
