"""Labels among clutter, with and without a guess, strings hidden or cut short (synthetic spots; no images here)."""

from dataclasses import replace

import numpy as np
import pytest

from calib.config import CalibConfig
from calib.hands import placed
from calib.label.again import relabel
from calib.label.all_frames import label_frames
from calib.label.frame import label_frame
from calib.label.location import label_location
from calib.label.refine import turned_over
from calib.synthetic.views import JigView, SpotNoise, disturbed, observe_spots, random_pose, random_sensor, random_view
from geometry import Frame, Pose, SurfacePoints, exp_so3, stack_poses
from jig_cad import STRINGS, Jig, sample_tolerance
from tests.pinned import pinned

CONFIG = CalibConfig()
HALF_TURN = Jig.nominal(strings=tuple(STRINGS)).symmetries[0]


def wrong_labels(frame, truth, turned=False):
    """How many labels name another string than the truth, or clutter."""
    told = zip(frame.axis.label, frame.axis.spot, strict=True)
    true = (HALF_TURN.relabelled(t) if turned and t else t for t in (truth.label[s] for _, s in told))
    return sum(t != label for t, label in zip(true, frame.axis.label, strict=True))


def run(n, noise, guess, seed, six=None):
    """Frames labelled in full, labels given, labels wrong (up to the half turn where there was no guess)."""
    rng = np.random.default_rng(seed)
    full = given = wrong = 0
    for _ in range(n):
        view = random_view(rng, six)
        truth = observe_spots(view, noise(rng), rng)
        start = disturbed(view.T_sensor_jig, view.jig, 4.0, 1.5, rng) if guess else None
        frame = label_frame(truth.points, view.jig, view.sensor, start, CONFIG)
        given += len(frame.axis)
        full += len(frame.axis) == len(view.jig.strings)
        wrong += wrong_labels(frame, truth) if guess else min(wrong_labels(frame, truth, t) for t in (False, True))
    return full, given, wrong


def test_all_strings_among_clutter_without_a_guess():
    full, _, wrong = run(40, lambda rng: SpotNoise(clutter=int(rng.integers(0, 20))), guess=False, seed=1)
    assert wrong == 0
    assert full >= 38


def test_heavy_clutter_never_makes_a_false_label():
    full, _, wrong = run(15, lambda rng: SpotNoise(clutter=34), guess=False, seed=2)
    assert wrong == 0
    assert full >= 12


def test_one_hidden_string_with_a_guess():
    _, given, wrong = run(30, lambda rng: SpotNoise(clutter=int(rng.integers(0, 12)), hidden=1), guess=True, seed=3)
    assert wrong == 0
    assert given >= 0.9 * 30 * 4


def test_two_hidden_strings_with_a_guess():
    _, given, wrong = run(30, lambda rng: SpotNoise(clutter=int(rng.integers(0, 6)), hidden=2), guess=True, seed=4)
    assert wrong <= 1
    assert given >= 0.8 * 30 * 3


def test_clutter_alone_is_not_labelled():
    rng = np.random.default_rng(5)
    for _ in range(40):
        view = random_view(rng, six=False)
        truth = observe_spots(view, SpotNoise(clutter=int(rng.integers(5, 30)), hidden=5), rng)
        assert label_frame(truth.points, view.jig, view.sensor, None, CONFIG).reason == "not_labelled"


def test_reasons_of_frames_without_an_answer():
    rng = np.random.default_rng(6)
    view = random_view(rng, six=False)
    few = observe_spots(view, SpotNoise(hidden=3), rng).points
    assert label_frame(SurfacePoints.empty(), view.jig, view.sensor, None, CONFIG).reason == "no_spots"
    assert label_frame(few, view.jig, view.sensor, None, CONFIG).reason == "too_few_spots"
    assert label_frame(few, view.jig, view.sensor, view.T_sensor_jig, CONFIG).reason == "too_few_spots"


def test_without_a_guess_the_half_turn_follows_the_convention():
    rng = np.random.default_rng(7)
    for _ in range(8):
        view = random_view(rng)
        frame = label_frame(observe_spots(view, SpotNoise(), rng).points, view.jig, view.sensor, None, CONFIG)
        pinned(frame)
        assert frame.T_sensor_jig is not None
        assert frame.T_sensor_jig.R[0, 0] > 0


def test_a_spot_cut_short_is_flagged_or_left_out_not_trusted():
    """A string moved by 0.25 to 0.5 mm: never a wrong label, and seldom an unflagged frame of full weight."""
    rng = np.random.default_rng(8)
    unnoticed = labelled = 0
    for _ in range(25):
        view = random_view(rng, six=False)
        truth = observe_spots(view, SpotNoise(cut=1, clutter=3), rng)
        guess = disturbed(view.T_sensor_jig, view.jig, 4.0, 1.5, rng)
        frame = label_frame(truth.points, view.jig, view.sensor, guess, CONFIG)
        pinned(frame)
        assert wrong_labels(frame, truth) == 0
        labelled += frame.reason is None
        unnoticed += frame.reason is None and len(frame.axis) == 5 and set(frame.axis.flag) == {""}
    assert labelled >= 20
    assert unnoticed <= 0.35 * labelled


def location(rng, n=7, noise=lambda i: SpotNoise()):
    """One location: n views of one jig by a hand whose SCP differs from the design by 2° and 3 mm."""
    sensor, distance = random_sensor(rng)
    jig = Jig.nominal(90.0, 85.0)
    made = sample_tolerance(jig, rng)
    poses = stack_poses([random_pose(rng, jig, distance, (5.0, 28.0)) for _ in range(n)])
    design = Pose.from_fixed_xyz_deg([0, 0, 20], [-17, -76, 117])
    true = design @ Pose.exp(np.concatenate([rng.normal(0, 1.5, 3), np.deg2rad(rng.normal(0, 1.2, 3))]))
    T_base_jig = Pose(exp_so3(rng.normal(size=3)), np.array([1500.0, 200.0, 700.0]))
    hands = T_base_jig @ poses.inverse() @ true.inverse()
    truth = [observe_spots(JigView(jig, made, sensor, poses[i]), noise(i), rng) for i in range(n)]
    return jig, sensor, design, T_base_jig, hands, poses, truth


def test_frames_of_a_location_share_their_half_turn_and_help_those_with_hidden_strings():
    rng = np.random.default_rng(9)
    for _ in range(3):
        jig, sensor, design, T_base_jig, hands, poses, truth = location(
            rng, noise=lambda i: SpotNoise(clutter=6, hidden=2 if i == 3 else 1 if i == 5 else 0)
        )
        frames = label_location([t.points for t in truth], hands, design, jig, sensor, CONFIG)
        pinned(frames)
        turned = poses[0].R[0, 0] < 0
        assert [len(f.axis) for f in frames][:3] == [5, 5, 5]
        assert len(frames[5].axis) >= 3
        for frame, one in zip(frames, truth, strict=True):
            assert wrong_labels(frame, one, turned) == 0
        given = label_location([t.points for t in truth], hands, design, jig, sensor, CONFIG, T_base_jig)
        pinned(given)
        for frame, one in zip(given, truth, strict=True):
            assert wrong_labels(frame, one) == 0


def hidden_first(seed):
    """A location whose first view hides two strings and is rolled by more than 90° against the next ones, or not."""
    for k in range(seed, seed + 50):
        rng = np.random.default_rng(k)
        made = location(rng, noise=lambda i: SpotNoise(hidden=2 if i == 0 else 0))
        if made[5].R[0, 0, 0] * made[5].R[1, 0, 0] < 0:
            return made
    raise AssertionError("no such location")


@pytest.mark.parametrize("seed", [100, 200, 300, 400])
def test_a_first_frame_with_hidden_strings_decides_the_half_turn_too(seed):
    """It is labelled through the other frames, which must not decide in its place."""
    jig, sensor, design, _, hands, poses, truth = hidden_first(seed)
    frames = label_location([t.points for t in truth], hands, design, jig, sensor, CONFIG)
    pinned(frames)
    first = next(i for i, f in enumerate(frames) if f.T_sensor_jig is not None)
    assert frames[first].T_sensor_jig.R[0, 0] > 0
    for frame, one in zip(frames, truth, strict=True):
        assert wrong_labels(frame, one, poses[first].R[0, 0] < 0) == 0


@pytest.mark.parametrize("given", [False, True])
def test_a_first_frame_labelled_late_turns_its_location_unless_the_place_is_given(given):
    jig, sensor, design, T_base_jig, hands, poses, truth = hidden_first(100)
    wrong = T_base_jig if poses.R[0, 0, 0] < 0 else T_base_jig @ jig.symmetries[0].pose  # does not show frame 0 upright
    frames = tuple(Frame(i, "A", points=t.points, T_base_hand=hands[i]) for i, t in enumerate(truth))
    fresh = placed(frames, None)
    labelled = label_frames(fresh, jig, sensor, design, {"A": wrong}, CONFIG)
    decided = {"A": wrong} if given else {}
    again = relabel(labelled, fresh, jig, sensor, design, {"A": wrong}, decided, CONFIG)
    assert sum(s.usable for s in again) >= 6
    upright = next(s for s in again if s.usable).candidates[0].R[0, 0] > 0
    assert upright != given
    for s, one in zip(again, truth, strict=True):
        assert wrong_labels(s, one, upright == (poses[0].R[0, 0] < 0)) == 0


def test_one_alien_frame_does_not_mislead_the_others():
    """A frame of another location under this one's name is outvoted."""
    rng = np.random.default_rng(10)
    jig, sensor, design, _, hands, poses, truth = location(rng)
    R = hands.R.copy()
    R[0] = exp_so3(np.array([0.0, 0.6, 0.3])) @ R[0]
    frames = label_location([t.points for t in truth], Pose(R, hands.t), design, jig, sensor, CONFIG)
    pinned(frames)
    turned = poses[1].R[0, 0] < 0
    for frame, one in list(zip(frames, truth, strict=True))[1:]:
        assert len(frame.axis) == 5
        assert wrong_labels(frame, one, turned) == 0


@pytest.mark.slow
def test_5000_frames():
    """Mislabelled or false spots ≤ 0.05 %; labelled in full ≥ 99.5 % with five strings, 99 % with a guess.

    Six strings seen from any side without a guess: 96 %; near mid-height the three faces are almost alike.
    """

    def noise(rng):
        return SpotNoise(clutter=int(rng.integers(0, 20)))

    five, given, wrong = run(2000, noise, guess=False, seed=100, six=False)
    six, more, bad = run(1000, noise, guess=False, seed=101, six=True)
    guessed, also, worse = run(2000, noise, guess=True, seed=102)
    assert wrong + bad + worse <= 5e-4 * (given + more + also)
    assert five >= 0.995 * 2000
    assert six >= 0.96 * 1000
    assert guessed >= 0.99 * 2000


def test_a_point_kept_in_doubt_keeps_its_residual_through_the_half_turn():
    """A spot 0.6 mm off its string is kept with a flag: the frame's candidates speak of all points, turned or not."""
    rng = np.random.default_rng(11)
    doubtful = 0
    for _ in range(16):
        view = random_view(rng, six=False)
        truth = observe_spots(view, SpotNoise(), rng)
        yz = truth.points.yz_mm.copy()
        yz[list(truth.label).index("B'")] += [0.6, 0.0]
        frame = label_frame(replace(truth.points, yz_mm=yz), view.jig, view.sensor, view.T_sensor_jig, CONFIG)
        pinned(frame)
        if "pose_residual" not in frame.axis.flag:
            continue
        doubtful += 1
        turned = turned_over(frame, view.jig.symmetries[0], truth.points, view.jig, view.sensor, CONFIG)
        for one in (frame, turned):
            assert all(c.residuals_mm.shape == (len(one.axis), 2) for c in one.candidates)
            assert np.argmax(np.linalg.norm(one.candidates[0].residuals_mm, axis=1)) == one.axis.flag.index(
                "pose_residual"
            )
    assert doubtful >= 3
