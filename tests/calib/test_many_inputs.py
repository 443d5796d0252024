"""Many small problems drawn at random about what is decided, their answers kept: a limit that moves changes some.

What makes the answers right is for the other tests to say.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from calib import CalibConfig, calibrate
from calib.judge.causes import cause_of
from calib.judge.culprits import culprit
from calib.label.frame import label_frame
from calib.pose.fit import jig_pose
from calib.synthetic.cell import Layout, Noise, default_sensor, made_cell, observe, random_cell
from calib.synthetic.views import SpotNoise, disturbed, observe_spots, random_jig, random_pose, random_view
from geometry import Frame, NoAnswerError, Pose, exp_so3
from jig_cad import Jig
from tests.calib.test_jig_pose import axis_of
from tests.calib.test_motion_causes import ARM, CONFIG, JIG, SENSOR, X, frames_of, seen
from tests.pinned import pinned


@pytest.mark.parametrize("guess", [False, True])
def test_labels_of_many_frames(guess: bool) -> None:
    """Few strings or many, among clutter or not, cut or hidden."""
    found = {}
    for k in range(30):
        rng = np.random.default_rng([k, int(guess)])
        view = random_view(rng, bool(k % 2))
        noise = SpotNoise(
            clutter=int(rng.integers(0, 25)),
            hidden=int(rng.integers(0, 3)) if guess else 0,
            cut=int(rng.integers(0, 2)),
        )
        spots = observe_spots(view, noise, rng).points
        start = disturbed(view.T_sensor_jig, view.jig, 5.0, 2.0, rng) if guess else None
        found[str(k)] = label_frame(spots, view.jig, view.sensor, start, CalibConfig())
    pinned(found)


def test_poses_of_many_jigs() -> None:
    """Of three to six strings, well seen or hardly, with a guess or none."""
    found: dict[str, object] = {}
    for k in range(40):
        rng = np.random.default_rng([k, 3])
        jig, _ = random_jig(rng) if k % 2 else (Jig.nominal(110.0, 95.0), None)
        T = random_pose(rng, jig, rng.uniform(120, 400))
        labels = [str(s) for s in rng.permutation(jig.strings)[: int(rng.integers(3, len(jig.strings) + 1))]]
        axis = axis_of(T, jig, sigma_mm=rng.uniform(0.005, 0.4), labels=labels, rng=rng)
        start = disturbed(T, jig, 8.0, 4.0, rng) if rng.random() < 0.5 else None
        try:
            found[str(k)] = jig_pose(axis, jig, start)
        except NoAnswerError as error:
            found[str(k)] = str(error)
    pinned(found)


def _turned(rng: np.random.Generator, frames: list[Frame]) -> list[Frame]:
    """Some frames labelled as the turned jig."""
    which = rng.random(len(frames)) < rng.uniform(0, 0.5)
    turn = JIG.symmetries[0].pose
    return [replace(f, candidates=f.candidates @ turn) if w else f for f, w in zip(frames, which, strict=True)]


def _misnamed(rng: np.random.Generator, frames: list[Frame]) -> list[Frame]:
    which = rng.random(len(frames)) < rng.uniform(0, 0.3)
    return [replace(f, location="A") if w else f for f, w in zip(frames, which, strict=True)]


def _moved(rng: np.random.Generator, frames: list[Frame]) -> list[Frame]:
    """The jig moved for some frames, by little or by much."""
    which = rng.random(len(frames)) < rng.uniform(0, 0.4)
    by = Pose(exp_so3(rng.normal(0, rng.choice([0.01, 0.1]), 3)), rng.normal(0, rng.choice([2.0, 30.0]), 3))
    return [replace(f, candidates=by @ f.candidates) if w else f for f, w in zip(frames, which, strict=True)]


def _rows(rng: np.random.Generator, frames: list[Frame]) -> list[Frame]:
    """Rows exchanged, or late from somewhere on."""
    order = np.arange(len(frames))
    if rng.random() < 0.5:
        some = rng.permutation(len(frames))[: int(rng.integers(2, 6))]
        order[np.sort(some)] = some
    else:
        start = int(rng.integers(0, len(frames)))
        order[start:] = np.minimum(order[start:] + int(rng.choice([-2, -1, 1, 2])), len(frames) - 1)
    rows = [frames[k] for k in np.maximum(order, 0)]
    return [replace(f, hand=r.hand, joints_rad=r.joints_rad) for f, r in zip(frames, rows, strict=True)]


def _bent(rng: np.random.Generator, frames: list[Frame]) -> list[Frame]:
    """Every pose of the jig a little off, as of noise or of a wrong sensor."""
    angle, mm = rng.choice([0.005, 0.02]), rng.choice([1.0, 4.0])
    return [
        replace(f, candidates=Pose(exp_so3(rng.normal(0, angle, 3)), rng.normal(0, mm, 3)) @ f.candidates)
        for f in frames
    ]


SPOILT: dict[str, Callable[[np.random.Generator, list[Frame]], list[Frame]]] = {
    "turned": _turned,
    "misnamed": _misnamed,
    "moved": _moved,
    "rows": _rows,
    "bent": _bent,
}


@pytest.mark.parametrize("name", SPOILT)
def test_what_many_spoilt_sets_are_said_to_be(name: str) -> None:
    said = {}
    for k in range(6):
        rng = np.random.default_rng([k, len(name)])
        frames = list(frames_of((int(rng.integers(3, 8)), int(rng.integers(3, 8))), seed=k))
        spoilt = tuple(SPOILT[name](rng, [seen(f, f.at) for f in frames]))
        design = X @ Pose(exp_so3(rng.normal(0, 0.15, 3)), rng.normal(0, 30, 3))
        said[str(k)] = (culprit(spoilt, JIG, ARM), cause_of(spoilt, JIG, ARM, SENSOR, design, CONFIG))
    pinned(said)


@pytest.mark.parametrize("k", range(5))
def test_answers_where_one_number_is_somewhat_wrong(k: int) -> None:
    """A row of the robot's table or the jig's side by 1 to 12 of its σ: from below what is noticed to far beyond."""
    rng = np.random.default_rng([k, 5])
    cell = random_cell(rng, Layout(places=(("A", "calibrate", 5), ("B", "calibrate", 4), ("D", "verify", 3))))
    frames = observe(cell, made_cell(cell, rng, Noise()), rng, Noise()).frames
    off = np.zeros(6)
    off[int(rng.integers(1, 5))] = 0.3 * rng.uniform(1, 12) * rng.choice([-1, 1])
    row = str(rng.choice(["a", "d"]))
    jig = cell.jig if k % 4 else Jig.nominal(side_mm=cell.jig.side_mm + 0.4)
    robot = cell.robot.with_changes(**{row: off}) if k % 4 else cell.robot
    pinned(calibrate(frames, jig, robot, default_sensor(), cell.design))
