"""What spoils a data set, told from the motions of hand and jig alone: of exact poses, each with one fault.

Labels, noise and the solver have no part here; tests/calib/test_causes.py has them.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
import pytest

from calib.config import CalibConfig
from calib.judge.causes import cause_of
from calib.judge.culprits import culprit, strangers
from calib.synthetic.cell import industrial_arm
from geometry import Frame, Pose, exp_so3, stack_poses
from jig_cad import Jig
from tests.geometry.strategies import line_sensor

ARM, JIG, SENSOR, CONFIG = industrial_arm(), Jig.nominal(), line_sensor(), CalibConfig()
X = Pose.from_fixed_xyz_deg([10.0, 80.0, -30.0], [60.0, -20.0, 150.0])  # T_hand_sensor
PLACES = {
    "A": Pose.from_fixed_xyz_deg([5.0, -10.0, 30.0], [1200.0, 300.0, 500.0]),
    "B": Pose.from_fixed_xyz_deg([-20.0, 15.0, 100.0], [900.0, -700.0, 450.0]),
    "C": Pose.from_fixed_xyz_deg([40.0, 5.0, -60.0], [1000.0, 900.0, 300.0]),
}
Frames = tuple[Frame, ...]


def frames_of(counts: Sequence[int] = (6, 6), seed: int = 1) -> Frames:
    """Frames at some places, of readings drawn so that the hand turns by tens of degrees."""
    rng, out = np.random.default_rng(seed), []
    for name, count in zip(PLACES, counts, strict=False):
        for _ in range(count):
            q = np.array([0.1, -0.4, 0.5, 0.2, 0.9, 0.3]) + rng.uniform(-0.5, 0.5, 6)
            out.append(seen(Frame(number=len(out), location=name, role="calibrate", joints_rad=q), ARM.pose(q)))
    return tuple(out)


def seen(f: Frame, hand: Pose, location: str | None = None) -> Frame:
    """The frame with the jig's pose as seen from that hand, the jig at the place of its name or another's."""
    jig = (hand @ X).inverse() @ PLACES[location or f.location]
    return replace(f, hand=hand, candidates=stack_poses([jig]), labels_given=True)


def _cause(frames: Frames, design: Pose | None = X, **given: bool) -> str:
    return cause_of(frames, JIG, ARM, SENSOR, design, CONFIG, **given)


def _with_rows(frames: Frames, order: Sequence[int]) -> Frames:
    """The images of the frames, each with the readings of another row."""
    return tuple(
        replace(f, hand=frames[k].hand, joints_rad=frames[k].joints_rad) for f, k in zip(frames, order, strict=True)
    )


def test_sound_frames_name_nothing() -> None:
    frames = frames_of((6, 6, 6))
    assert _cause(frames) == _cause(frames, lost=False) == culprit(frames, JIG, ARM) == ""
    assert strangers(frames, JIG, {3, 7}) == ""


@pytest.mark.parametrize(
    ("start", "step", "words"),
    [
        (0, 1, "each row is one late: its joint readings or pose are those of the row before; frames.csv has one "
               "reading too many there"),
        (5, 1, "from frame 5 on each row is one late: its joint readings or pose are those of the row before"),
        (4, -1, "from frame 4 on each row is one late: its joint readings or pose are those of the row after; "
                "frames.csv has one reading too few there"),
        (3, 2, "from frame 3 on each row is two late: its joint readings or pose are those of two rows before; "
               "frames.csv has two readings too many there"),
    ],
)  # fmt: skip
def test_rows_that_are_late(start: int, step: int, words: str) -> None:
    """A reading too many comes from nowhere: of poses of its own; one too few makes those after it early."""
    frames = frames_of((7, 7))
    stray = [ARM.pose(np.array([0.3, -0.2, 0.4, -0.5, 1.0 + 0.3 * k, -0.6])) for k in range(2)]
    hands = [f.at for f in frames]
    given = (
        [*hands[:start], *stray[:step], *hands[start:]]
        if step > 0
        else [*hands[:start], *hands[start - step :], *stray]
    )
    spoilt = tuple(replace(f, hand=h) for f, h in zip(frames, given, strict=False))
    said = _cause(spoilt)
    assert said.startswith(words)
    assert "% of the pairs of frames instead of" in said
    assert said.endswith("% if they are shifted back)")
    assert _cause(spoilt, lost=False) == said


def test_rows_that_are_exchanged() -> None:
    frames = frames_of((8, 8))
    n = len(frames)
    back = _cause(_with_rows(frames, range(n)[::-1]))
    assert "in different orders: one of them stands the other way round, last first (hand and jig move" in back
    text = _cause(_with_rows(frames, sorted(range(n), key=str)))
    assert "one of them stands sorted as text (0, 1, 10, 11 … 2, 20 …)" in text
    later = _cause(_with_rows(frames, sorted(range(n), key=lambda i: str(i + 1))))
    assert "one of them stands sorted as text from 1 on" in later
    swapped = list(range(n))
    swapped[1], swapped[4], swapped[6] = 4, 6, 1
    said = _cause(_with_rows(frames, swapped))
    assert (
        "the image of frame 1 goes with the readings of frame 6, 4 with 1, 6 with 4 (hand and jig move alike in" in said
    )


def test_one_name_for_two_places() -> None:
    """Each with three frames or more, which move as one; of two no group is made."""
    frames = frames_of((5, 4))
    alone = tuple(replace(f, location="A") for f in frames)
    assert _cause(alone).startswith(
        "all lie in one location: the column says A throughout, but the target stood still only within each of these: "
        "frames 0, 1, 2, 3, 4; frames 5, 6, 7, 8"
    )
    more = frames_of((5, 4, 5))
    mixed = tuple(replace(f, location="A") if f.location == "B" else f for f in more)
    assert _cause(mixed).startswith(
        "location A is several, but the target stood still only within each of these: frames"
    )
    few = tuple(replace(f, location="A") if f.location == "B" else f for f in frames_of((6, 2)))
    assert "is several" not in _cause(few)


@pytest.mark.parametrize(
    ("times", "unit"), [(1e-3, "metres"), (1 / 25.4, "inches"), (0.1, "centimetres"), (1e3, "micrometres")]
)
def test_hand_poses_in_another_unit(times: float, unit: str) -> None:
    hands = [Pose(f.at.R, times * f.at.t) for f in frames_of()]
    frames = tuple(replace(f, hand=h, T_base_hand=h, joints_rad=None) for f, h in zip(frames_of(), hands, strict=True))
    assert _cause(frames) == (
        "hand and jig move alike in 100% of the pairs of frames instead of 0% if x_mm, y_mm, z_mm of frames.csv hold "
        f"{unit}: give millimetres"
    )


@pytest.mark.parametrize(
    ("turn_deg", "words"),
    [
        ([0, 0, 180.0], "it is half a turn off, 180° about z of the sensor: the sensor is mounted the other way round"),
        ([127.3, 127.3, 0], "it is half a turn off, 180° about an oblique axis: the sensor is mounted the other way"),
        (
            [0, 127.28, 127.28],
            "180° about an oblique axis: y and z of the points are exchanged, or the drawing's axes",
        ),
        (
            [0, 90.0, 0],
            "it is turned by 90°, a quarter turn about y of the sensor: check the order and the axes of its",
        ),
        ([71.0, 0, 0], "it is turned by 71°, a quarter turn about x of the sensor"),
        ([69.0, 0, 0], "it is turned by 69° about x of the sensor: check"),
        ([12.1, 0, 0], "it is turned by 12° about x of the sensor"),
    ],
)
def test_a_drawing_turned(turn_deg: list[float], words: str) -> None:
    said = _cause(frames_of(), X @ Pose(exp_so3(np.deg2rad(turn_deg)), np.zeros(3)))
    assert said.startswith("[scp_initial] of cell.toml is not where the sensor is: the motions of hand and jig agree")
    assert "rotation_deg is about [10, 80, -30] and translation_mm about [60, -20, 150]; " in said
    assert words in said


def test_a_drawing_shifted() -> None:
    def moved(mm: float) -> str:
        return _cause(frames_of(), Pose(X.R, X.t + np.array([mm, 0, 0])))

    assert moved(59.9) == ""
    assert moved(60.1).endswith("about [60, -20, 150]; it is 60 mm off")
    assert _cause(frames_of(), X @ Pose(exp_so3(np.deg2rad([11.9, 0, 0])), np.zeros(3))) == ""
    assert _cause(frames_of(), None) == ""
    assert _cause(frames_of(), Pose(X.R, X.t + 500.0), lost=False) == ""


ROUND = np.array([1.0, 1, 1, -1, 1, 1])


def _wrong(change: Callable[[np.ndarray], np.ndarray]) -> str:
    """The cause named where the file's readings are changed ones of the true ones."""
    frames = frames_of()
    read = [change(f.joints_rad) for f in frames if f.joints_rad is not None]
    return _cause(tuple(replace(f, joints_rad=q, hand=ARM.pose(q)) for f, q in zip(frames, read, strict=True)))


def test_joint_columns() -> None:
    alike = "hand and jig move alike in 100% of the pairs of frames instead of "
    said = _wrong(np.deg2rad)
    assert alike in said
    assert said.endswith("if the joint columns hold radians, not degrees")
    assert _wrong(lambda q: q * ROUND).endswith("if joint 4 counts the other way round (its sign)")
    assert _wrong(lambda q: q[[0, 1, 2, 3, 5, 4]]).endswith("if the columns of joints 5 and 6 are exchanged")
    assert "a of joint 2 in the robot's table is changed by about -120 mm" in _with_table(a=(1, 120.0))
    assert "α of joint 3 in the robot's table is changed by about +10°" in _with_table(alpha=(2, np.deg2rad(-10.0)))


def _with_table(**change: tuple[int, float]) -> str:
    """The cause named where one number of the robot's table is wrong."""
    ((row, (joint, by)),) = change.items()
    off = np.zeros(6)
    off[joint] = by
    arm = ARM.with_changes(**{row: off})
    frames = tuple(replace(f, hand=arm.pose(f.joints_rad)) for f in frames_of() if f.joints_rad is not None)
    return cause_of(frames, JIG, arm, SENSOR, X, CONFIG)


def test_frames_that_move_as_none_of_their_location() -> None:
    frames = list(frames_of((7, 7)))
    frames[2] = seen(frames[2], frames[2].at, "C")
    assert culprit(tuple(frames), JIG, ARM) == (
        "frame 2 does not move as the other frames of location A does: check its location, joint readings and image"
    )
    assert strangers(tuple(frames), JIG, {2}) == culprit(tuple(frames), JIG, ARM)
    assert strangers(tuple(frames), JIG, {3}) == ""
    named = list(frames_of((7, 7)))
    named[2], named[4] = replace(named[2], location="B"), replace(named[4], location="B")
    assert culprit(tuple(named), JIG, ARM) == (
        "frames 2, 4 do not move as the other frames of location B do but as those of location A: their location is "
        "misnamed"
    )
    moved = list(frames_of((7, 7)))
    for k in (4, 5, 6):
        moved[k] = seen(moved[k], moved[k].at, "C")
    assert culprit(tuple(moved), JIG, ARM) == (
        "frames 4, 5, 6 do not move as the other frames of location A do but as one another: the jig was moved, or two "
        "locations bear one name"
    )


def test_frames_whose_labels_are_those_of_the_turned_jig() -> None:
    turn = JIG.symmetries[0].pose
    frames = list(frames_of((5, 5)))
    for k in (1, 7, 8):
        frames[k] = replace(frames[k], candidates=frames[k].candidates @ turn)
    said = culprit(tuple(frames), JIG, ARM)
    assert said.startswith(
        "the labels of frames 1, 7, 8 are those of the jig turned by half against the other frames of"
    )
    assert " and " in said.rsplit("exchange ", 1)[1]


def test_too_few_or_too_many_say_nothing() -> None:
    spoilt = _with_rows(frames_of((3, 3)), [3, 4, 5, 0, 1, 2])
    assert culprit(spoilt[:3], JIG, ARM) == ""
    many = frames_of((61, 60))
    assert _cause(_with_rows(many, [*range(1, len(many)), 0])) == ""
