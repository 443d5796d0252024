"""What can not be calibrated at all is refused in a sentence that says what would be right."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from calib import CalibConfig, calibrate
from calib.closure.judge import Socket, closure
from calib.synthetic.cell import Layout, Noise, default_sensor, industrial_arm, made_cell, observe, random_cell
from calib.synthetic.surfaces import ProfileNoise, observe_surface, surface_cell
from calib.verify import verify
from geometry import InputError, Pose
from jig_cad import Sphere

CELL = random_cell(np.random.default_rng(3), Layout(places=(("A", "calibrate", 3), ("B", "calibrate", 2))))
FRAMES = observe(CELL, made_cell(CELL, np.random.default_rng(4), Noise()), np.random.default_rng(5), Noise()).frames
PAPER = CalibConfig(method="paper")
JOINTS = np.linspace(-0.5, 0.5, 18).reshape(3, 6)


def _by_paper(design: Pose | None) -> object:
    return calibrate(FRAMES, CELL.jig, CELL.robot, default_sensor(), design, config=PAPER)


def _ball_by_paper() -> object:
    rng = np.random.default_rng(1)
    cell = surface_cell(Sphere(40.0), rng, places=(("A", "calibrate", 4),))
    seen = observe_surface(cell, rng, ProfileNoise(), points=20)
    return calibrate(seen.frames, cell.target, cell.robot, default_sensor(), cell.design, config=PAPER)


@pytest.mark.parametrize(
    ("asked", "words"),
    [
        (lambda: calibrate((), CELL.jig, CELL.robot, default_sensor(), CELL.design), "the dataset has no frames"),
        (lambda: verify((), CELL.jig, CELL.robot, default_sensor(), CELL.design), "the dataset has no frames"),
        (lambda: _by_paper(None), "the paper's method begins at the sensor's place by its drawing: give [scp_initial]"),
        (_ball_by_paper, "the paper's method measures a pillar of strings: use --method bundle for other targets"),
        (lambda: closure([], CELL.robot), "no sockets were given: each needs the joint readings of at least three"),
        (
            lambda: closure([Socket("A", n, JOINTS) for n in ("one", "two", "three")], CELL.robot),
            'location "A" has more than two sockets: give each base its own location',
        ),
        (
            lambda: calibrate(
                (replace(FRAMES[0], joints_rad=None, T_base_hand=None), *FRAMES[1:]), CELL.jig, CELL.robot,
                default_sensor(), CELL.design,
            ),
            "frame 0 has neither joint readings with a robot nor a hand pose T_base_hand",
        ),
    ],
)  # fmt: skip
def test_it_is_said_in_a_sentence(asked: Callable[[], object], words: str) -> None:
    with pytest.raises(InputError, match=re.escape(words)):
        asked()


def test_hand_poses_predict_nothing_elsewhere() -> None:
    arm = industrial_arm()
    posed = tuple(
        replace(f, joints_rad=None, T_base_hand=arm.pose(f.joints_rad)) for f in FRAMES if f.joints_rad is not None
    )
    result = calibrate(posed, CELL.jig, None, default_sensor(), CELL.design)
    assert result.estimate is not None
    with pytest.raises(InputError, match="needs joint readings and a robot's table"):
        result.estimate.predicted_covariance(JOINTS, np.zeros((3, 1, 2)))
