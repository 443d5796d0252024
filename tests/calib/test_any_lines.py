"""Lines of any names between any anchors: labelled without a guess, posed and calibrated as the pillar is.

They say nothing of the surface offsets: the spots are made with those that labelling removes.
"""

from dataclasses import replace

import numpy as np
import pytest

from calib import CalibConfig
from calib.label.any_lines import FOUND, any_labels
from calib.label.frame import label_frame
from calib.label.location import label_location
from calib.pose.fit import jig_pose
from calib.synthetic.cell import Layout, Noise, calibrated, made_cell, observe, random_cell
from calib.synthetic.views import JigView, SpotNoise, disturbed, observe_spots, random_pose, random_sensor, random_view
from geometry import AxisPoints, InputError, Pose, SurfacePoints, cross_plane_x0, field_of_view, inside_polygon
from jig_cad import ANCHORS, STRINGS, Jig, sample_tolerance
from tests.pinned import pinned

CONFIG = CalibConfig()
TEN = {
    "p1": (0, -40, 10), "p2": (100, -30, 20), "p3": (0, 45, 0), "p4": (100, -20, 60), "p5": (5, -10, 80),
    "p6": (95, 30, 30), "p7": (0, 20, 40), "p8": (105, 55, 75), "p9": (0, -55, 50), "p10": (100, 10, -5),
}  # fmt: skip
LINES = {"front": ("p1", "p2"), "left": ("p3", "p4"), "back": ("p5", "p6"), "right": ("p7", "p8"), "S5": ("p9", "p10")}
SIX = {"a": (0, 0, 0), "b": (100, 10, 5), "c": (0, -55, 70), "d": (95, -40, 80), "e": (5, 50, 85), "f": (100, 60, 60)}
SHARED = {"front": ("a", "b"), "left": ("c", "d"), "right": ("e", "f"), "fall": ("b", "c"), "rise": ("a", "f")}


def general_jig():
    """Five lines without a parallel pair or a shared anchor."""
    return Jig.of_lines(TEN, LINES)


def fan(n, low_mm, high_mm):
    """Leaning strings around x: n - 1 turns carry them onto themselves, n more where both ends are alike."""
    anchors, strings = {}, {}
    for i, a in enumerate(2 * np.pi * np.arange(n) / n):
        b = a + np.deg2rad(40)
        anchors[f"low {i}"] = (0, low_mm * np.cos(a), 40 + low_mm * np.sin(a))
        anchors[f"high {i}"] = (100, high_mm * np.cos(b), 40 + high_mm * np.sin(b))
        strings[f"string {i}"] = (f"low {i}", f"high {i}")
    return Jig.of_lines(anchors, strings)


def view_of(rng, jig):
    """A random sensor that sees all strings of the jig as made."""
    while True:
        sensor, distance = random_sensor(rng)
        made = sample_tolerance(jig, rng)
        for _ in range(30):
            view = JigView(jig, made, sensor, random_pose(rng, made, distance))
            if np.all(inside_polygon(view.yz_mm, field_of_view(sensor))):
                return view


def wrong_labels(frame, truth, jig):
    """How many labels are another string's or clutter's, up to the symmetries of the jig."""
    true = [truth.label[s] for s in frame.axis.spot]
    ways = [true, *([symmetry.relabelled(t) if t else t for t in true] for symmetry in jig.symmetries)]
    return min(sum(t != label for t, label in zip(way, frame.axis.label, strict=True)) for way in ways)


@pytest.mark.parametrize(
    ("jig", "hidden", "n"),
    [
        (general_jig(), 0, 12),
        (Jig.of_lines(SIX, SHARED), 0, 12),
        (Jig.of_lines(TEN, LINES | {"6th": ("p1", "p8")}), 1, 8),
        (fan(6, 45, 45), 0, 8),
    ],
    ids=["five lines", "shared anchors", "one of six hidden", "a fan of twelve poses"],
)
def test_labels_among_clutter_without_a_guess(jig, hidden, n):
    rng = np.random.default_rng(5)
    full = 0
    for _ in range(n):
        view = view_of(rng, jig)
        truth = observe_spots(view, SpotNoise(clutter=int(rng.integers(0, 10)), hidden=hidden), rng)
        frame = label_frame(truth.points, view.jig, view.sensor, None, CONFIG)
        pinned(frame)
        assert wrong_labels(frame, truth, jig) == 0
        full += len(frame.axis) == len(jig.strings) - hidden
    assert full >= n - 1


def test_a_guess_labels_lines_with_strings_hidden():
    rng = np.random.default_rng(7)
    jig, given = general_jig(), 0
    for _ in range(15):
        view = view_of(rng, jig)
        truth = observe_spots(view, SpotNoise(clutter=5, hidden=2), rng)
        guess = disturbed(view.T_sensor_jig, jig, 4.0, 1.5, rng)
        frame = label_frame(truth.points, jig, view.sensor, guess, CONFIG)
        pinned(frame)
        assert all(truth.label[s] == label for label, s in zip(frame.axis.label, frame.axis.spot, strict=True))
        given += len(frame.axis) == 3
    assert given >= 12


def test_clutter_alone_is_no_jig_and_costs_a_bounded_search():
    """Two hundred spots on a grid, at every distance from one another: as many assignments as ever, and an end."""
    jig = general_jig()
    yz = np.stack(np.meshgrid(np.linspace(-70, 70, 20), np.linspace(250, 330, 10)), -1).reshape(-1, 2)
    found = any_labels(yz, np.zeros(len(yz)), jig, 0.5, np.deg2rad(65), 100)
    assert len(found.labels) <= 100
    assert np.all(np.sum(found.labels >= 0, axis=1) == FOUND)
    rng = np.random.default_rng(1)
    sensor, _ = random_sensor(rng)
    n = 60
    noise = rng.uniform([-80, 220], [80, 340], (n, 2))
    cov, pixels = np.tile(np.eye(2) * 0.02**2, (n, 1, 1)), np.tile(0.01 * np.eye(2), (n, 1, 1))
    spots = SurfacePoints(
        np.zeros((n, 2)), pixels, noise, cov, np.full(n, 0.8), ("",) * n, np.zeros(n), np.ones((n, 2)), np.full(n, 50.0)
    )
    assert label_frame(spots, jig, sensor, None, CONFIG).reason == "not_labelled"


def test_a_location_of_a_turned_jig_is_labelled_one_way():
    """Frames of one place, each labelled by itself in any of twelve ways, agree through the chain."""
    rng = np.random.default_rng(3)
    jig = fan(6, 45, 45)
    first = view_of(rng, jig)
    middle = Pose(np.eye(3), jig.anchors_mm.mean(0))
    turns = np.array([[0, 0, 0, 0.15, 0.02, 0], [2, 3, 0, -0.1, 0.1, 0], [-3, 1, 1, 0, -0.12, 0]])
    poses = first.T_sensor_jig @ middle @ Pose.exp(turns) @ middle.inverse()
    truths = [observe_spots(replace(first, T_sensor_jig=T), SpotNoise(), rng) for T in (poses[0], poses[1], poses[2])]
    spots = [t.points for t in truths]
    frames = label_location(spots, poses.inverse(), Pose.identity(), jig, first.sensor, CONFIG)
    pinned(frames)
    way = {}
    for frame, truth in zip(frames, truths, strict=True):
        assert len(frame.axis) >= 5
        for label, spot in zip(frame.axis.label, frame.axis.spot, strict=True):
            assert way.setdefault(label, truth.label[spot]) == truth.label[spot]
    assert len(set(way.values())) == 6


RENAMED = {"A": "front", "B": "left post", "C": "right post", "B'": "fall", "C'": "rise", "D'": "back"}


def renamed(jig):
    """The jig with other names, read as lines between anchors of other names."""
    holes = dict(zip(ANCHORS, ("f0", "f1", "l0", "l1", "r0", "r1"), strict=True))
    anchors = {holes[a]: tuple(p) for a, p in zip(jig.anchors, jig.nominal_anchors_mm.tolist(), strict=True)}
    strings = {RENAMED[s]: tuple(holes[a] for a in STRINGS[s]) for s in jig.strings}
    other = Jig.of_lines(anchors, strings, jig.string_diameter_mm, jig.tolerance_mm)
    return replace(other, anchors_mm=jig.anchors_mm, measured=jig.measured)


@pytest.mark.parametrize("six", [False, True])
def test_a_renamed_pillar_is_labelled_and_posed_to_the_same_bits(six):
    rng = np.random.default_rng(11)
    for k in range(6):
        view = random_view(rng, six)
        truth = observe_spots(view, SpotNoise(clutter=6, hidden=k % 2), rng)
        guess = disturbed(view.T_sensor_jig, view.jig, 4.0, 1.5, rng) if k % 3 else None
        own = label_frame(truth.points, view.jig, view.sensor, guess, CONFIG)
        pinned(own)
        other = label_frame(truth.points, renamed(view.jig), view.sensor, guess, CONFIG)
        pinned(other)
        assert other.axis.label == tuple(RENAMED[s] for s in own.axis.label)
        assert other.reason == own.reason
        if own.T_sensor_jig is not None:
            np.testing.assert_array_equal(other.axis.yz_mm, own.axis.yz_mm)
            np.testing.assert_array_equal(other.T_sensor_jig.matrix, own.T_sensor_jig.matrix)


@pytest.mark.parametrize("method", ["bundle", "paper"])
def test_a_renamed_pillar_calibrates_to_the_same_bits(method):
    rng = np.random.default_rng(2)
    layout = Layout(places=(("A", "calibrate", 5), ("B", "calibrate", 5)))
    cell = random_cell(rng, layout)
    observed = observe(cell, made_cell(cell, rng, Noise()), rng, Noise())
    config = CalibConfig(method=method, model="scp")
    own = calibrated(observed, cell.jig, cell.robot, config)
    frames = tuple(
        replace(f, axis=replace(f.axis, label=tuple(RENAMED[s] for s in f.axis.label))) for f in observed.frames
    )
    other = calibrated(replace(observed, frames=frames), renamed(cell.jig), cell.robot, config)
    np.testing.assert_array_equal(other.T_hand_sensor.matrix, own.T_hand_sensor.matrix)
    np.testing.assert_array_equal(other.covariance, own.covariance)
    assert other.verdict.code == own.verdict.code


def test_any_five_lines_have_their_pose_and_the_paper_asks_for_a_pillar():
    rng = np.random.default_rng(4)
    jig = general_jig()
    for _ in range(10):
        T = random_pose(rng, jig, 300.0)
        starts, ends = T @ jig.starts, T @ jig.ends
        yz = cross_plane_x0(starts, ends - starts)[0][:, 1:]
        cov = np.tile(np.eye(2) * 0.03**2, (5, 1, 1))
        found = jig_pose(AxisPoints(jig.strings, np.full(5, -1), yz, cov, ("",) * 5), jig)
        apart = [np.abs(c.T_sensor_jig.matrix - T.matrix).max() for c in found.candidates]
        assert min(apart) < 1e-6
    cell = random_cell(rng, Layout(places=(("A", "calibrate", 4),)), jig)
    with pytest.raises(
        InputError, match="needs a triangular pillar, and the jig is none: its strings are front, left"
    ) as refused:
        calibrated(observe(cell, cell, rng, Noise()), jig, cell.robot, CalibConfig(method="paper"))
    pinned(str(refused.value))


@pytest.mark.parametrize("jig", [general_jig(), Jig.of_lines(SIX, SHARED)], ids=["ten anchors", "six shared anchors"])
def test_five_lines_calibrate_from_unlabelled_spots(jig):
    """Points of lines that are no pillar, their labels unknown: the SCP within its stated σ."""
    rng = np.random.default_rng(6)
    layout = Layout(places=(("A", "calibrate", 6), ("B", "calibrate", 6)))
    cell = random_cell(rng, layout, jig)
    made = made_cell(cell, rng, Noise())
    given = observe(cell, made, rng, Noise())
    frames = tuple(_spots(f, cell, made, rng, given.sensor) for f in given.frames)
    result = calibrated(replace(given, frames=frames), jig, cell.robot, CONFIG)
    assert sum(f.used for f in result.frames) >= 11
    xi = (result.T_hand_sensor.inverse() @ made.T_hand_sensor).log()
    assert xi @ np.linalg.solve(result.covariance, xi) < 25  # 6 degrees of freedom: 3e-4 lie beyond
    assert {label for f in result.frames for label in f.axis.label} == set(jig.strings)


def _spots(f, cell, made, rng, sensor):
    """The frame as spots of unknown labels among clutter: its own true pose, lit surfaces, noise."""
    T = (made.robot.pose(f.joints_rad) @ made.T_hand_sensor).inverse() @ made.T_base_jig[f.location]
    truth = observe_spots(JigView(cell.jig, made.jig, sensor, T), SpotNoise(clutter=4), rng)
    return replace(f, points=truth.points, axis=AxisPoints.empty(), labels_given=False)
