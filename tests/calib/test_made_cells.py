"""Cells as the benchmarks draw them, kept: what is proven of calibration is proven of these.

That they are what real cells are like no test here says.
"""

from __future__ import annotations

import numpy as np
import pytest

from calib.synthetic.cell import (
    Layout,
    Noise,
    axis_points,
    default_sensor,
    industrial_arm,
    made_cell,
    observe,
    pose_cell,
    random_cell,
)
from calib.synthetic.degenerate import constant_lever, mirror_frames
from calib.synthetic.exact_recovery import recover
from calib.synthetic.lit_string import lit_centroids
from calib.synthetic.problem import exact_pose_problem, made_problem
from calib.synthetic.surfaces import ProfileNoise, observe_surface, surface_cell, views_of
from calib.synthetic.telling_nothing import SPOILT, spoilt_cell
from calib.synthetic.views import SpotNoise, observe_spots, random_lines, random_sensor, random_view
from geometry import Surface, assumed_compliance
from jig_cad import Balls, Edge, Jig, Plane, Sphere, Wedge
from tests.pinned import pinned

PLACES = (("A", "calibrate", 3), ("B", "calibrate", 2), ("D", "verify", 2))
LAYOUTS = {
    "plain": Layout(places=PLACES),
    "no half turns": Layout(places=PLACES, half_turns=False, tilt_deg=(2.0, 35.0), swing_deg=50.0),
    "near": Layout(places=PLACES, standoff_mm=(200.0, 220.0), radius_mm=(1000.0, 1200.0), height_mm=(300.0, 500.0)),
    "last joints": Layout(places=(("A", "calibrate", 3),), moving=3, swing_joint_deg=25.0),
}
NOISES = {
    "usual": Noise(),
    "points": Noise(joint_rad=0.0, robot=False, anchors=False),
    "joints": Noise(point_mm=0.0, robot=False, anchors=False),
    "none": Noise(0.0, 0.0, robot=False, anchors=False),
    "bent": Noise(compliance=assumed_compliance(industrial_arm())),
}
TARGETS: dict[str, Surface] = {
    "sphere": Sphere(40.0),
    "balls": Balls.of({"a": (30.0, (0, 0, 0)), "b": (20.0, (80, 0, 0)), "c": (20.0, (0, 60, 0))}),
    "plane": Plane(),
    "edge": Edge(),
    "wedge": Wedge(75.0),
}


@pytest.mark.parametrize("layout", LAYOUTS)
def test_where_the_jig_stands_and_how_it_is_seen(layout: str) -> None:
    cell = random_cell(np.random.default_rng(7), LAYOUTS[layout])
    pinned({"places": cell.T_base_jig, "names": cell.location, "joints": cell.joints_rad, "scp": cell.T_hand_sensor})


@pytest.mark.parametrize("noise", NOISES)
def test_what_is_measured_of_a_cell(noise: str) -> None:
    cell = random_cell(np.random.default_rng(8), LAYOUTS["plain"])
    rng = np.random.default_rng(9)
    made = made_cell(cell, rng, NOISES[noise])
    seen = observe(cell, made, rng, NOISES[noise])
    pinned({
        "frames": [(f.number, f.location, f.role, f.joints_rad, f.axis) for f in seen.frames],
        "exact": [axis_points(T.inverse(), made.jig) for T in list(made.T_base_jig.values())[:1]],
    })  # fmt: skip


@pytest.mark.parametrize("target", TARGETS)
def test_what_is_measured_of_surfaces(target: str) -> None:
    rng = np.random.default_rng(10)
    cell = surface_cell(TARGETS[target], rng, places=(("A", "calibrate", 3), ("B", "verify", 2)))
    pinned(
        {"places": cell.T_base_target, "joints": cell.joints_rad, "views": views_of(cell.target, rng, 4, 25.0, 60.0)}
    )
    for noise in (ProfileNoise(), ProfileNoise(0.02, 0.7, 0.0, robot=False)):
        for labelled in (True, False):
            frames = observe_surface(cell, rng, noise, points=25, labelled=labelled).frames
            pinned([(f.number, f.location, f.joints_rad, f.axis, f.points) for f in frames])


def test_views_that_tell_nothing() -> None:
    pinned({n: spoilt_cell(s, np.random.default_rng(11), count=2).joints_rad for n, s in SPOILT.items()})


def test_views_that_tell_too_little_of_a_jig() -> None:
    cell = random_cell(np.random.default_rng(12), LAYOUTS["plain"])
    for make in (mirror_frames, constant_lever):
        seen = make(cell, np.random.default_rng(13), Noise())
        pinned([(f.number, f.location, f.joints_rad, f.T_base_hand, f.axis) for f in seen.frames])
    pinned(pose_cell(np.random.default_rng(14), LAYOUTS["plain"]))


def test_spots_and_lines_as_they_are_drawn() -> None:
    found = {}
    for k in range(6):
        rng = np.random.default_rng([k, 15])
        view = random_view(rng, bool(k % 2))
        noise = SpotNoise(clutter=3 * k, hidden=k % 3, cut=k % 2)
        truth = observe_spots(view, noise, rng)
        found[str(k)] = (random_sensor(rng)[1], random_lines(rng, 4)[0].anchors_mm, view.T_sensor_jig, truth)
    pinned(found)


def test_problems_and_recoveries() -> None:
    bundle, cell, made = made_problem(16, Noise())
    pinned({"problem": bundle.location, "cell": cell.joints_rad, "made": made.T_base_jig})
    pinned(recover(np.random.default_rng(17), Jig.nominal()))
    pinned({"own": exact_pose_problem(np.random.default_rng(18), Jig.nominal(), LAYOUTS["plain"])[1:]})


@pytest.mark.parametrize("thread", [(0.6, 0.0, 0.3), (0.6, 0.05, 0.35), (0.0, 0.4, 0.1)])
def test_light_of_strings_as_it_is_summed(thread: tuple[float, float, float]) -> None:
    yz = np.array([[0.0, 300.0], [15.0, 280.0], [-20.0, 320.0]])
    directions = np.array([[1.0, 0.0, 0.0], [0.9, 0.3, 0.1], [0.8, -0.2, 0.5]])
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    pinned({"yz": lit_centroids(yz, directions, 0.25, default_sensor(), thread, turns=24, steps=9)})
