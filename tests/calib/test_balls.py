"""A plate of balls of which a profile shows one or two: named by sizes and distances, or by all frames together."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from calib import CalibConfig, calibrate
from calib.printed import nees
from calib.synthetic.cell import CellFrames
from calib.synthetic.surfaces import ProfileNoise, observe_surface, surface_cell
from geometry import Frame, Pose, Robot, Role
from jig_cad import Balls

NEES_LIMIT = 30.0  # a sound covariance exceeds it in 4 of 100,000 runs
CENTRES = {"a": (0, 0, 0), "b": (90, 10, 0), "c": (20, 80, 15), "d": (100, 95, 0)}
EQUAL = Balls.of({n: (30.0, c) for n, c in CENTRES.items()})
OTHERS = Balls.of({n: (d, c) for (n, c), d in zip(CENTRES.items(), (30.0, 40.0, 25.0, 35.0), strict=True)})
Places = tuple[tuple[str, Role, int], ...]
PLACES: Places = (("A", "calibrate", 8), ("B", "calibrate", 8), ("D", "verify", 5))
THREE: Places = (("A", "calibrate", 9), ("B", "calibrate", 9), ("C", "calibrate", 9), ("D", "verify", 8))


def _in_order_of_y(f: Frame, target: Balls) -> Frame:
    """As extraction names sections: by their order in the profile, whatever they are of."""
    label, y = np.array(f.axis.label), f.axis.yz_mm[:, 0]
    order = sorted(set(f.axis.label), key=lambda n: float(y[label == n].mean()))
    new = {n: target.names[k] for k, n in enumerate(order)}
    return replace(f, axis=replace(f.axis, label=tuple(new[n] for n in f.axis.label)), labels_given=False)


def _seen(target: Balls, places: Places = PLACES) -> tuple[CellFrames, CellFrames, Robot, Pose]:
    rng = np.random.default_rng(2)
    cell = surface_cell(target, rng, places)
    seen = observe_surface(cell, rng, ProfileNoise(), 120, labelled=False)
    anonymous = replace(seen, frames=tuple(_in_order_of_y(f, target) for f in seen.frames))
    return seen, anonymous, cell.robot, cell.T_hand_sensor


def test_equal_balls_are_told_apart_by_a_drawing() -> None:
    """Its mount is off by 3°: single balls are named by where they stand."""
    _check(EQUAL, drawn=True)


@pytest.mark.slow
def test_balls_of_several_sizes_need_no_drawing() -> None:
    """Pairs name themselves, and the rest follow from them."""
    _check(OTHERS, drawn=False)


def _check(target: Balls, drawn: bool) -> None:
    seen, anonymous, robot, truth = _seen(target, PLACES if drawn else THREE)
    two = sum(len(set(f.axis.label)) > 1 for f in seen.frames)
    assert two >= 5
    design = seen.design if drawn else None
    result = calibrate(anonymous.frames, target, robot, seen.sensor, design, config=CalibConfig(model="full"))
    assert result.verdict.code == "ok", result.verdict.text
    assert [f.axis.label for f in result.frames] == [f.axis.label for f in seen.frames]
    assert result.T_hand_sensor is not None
    assert result.covariance is not None
    assert nees(truth, result.T_hand_sensor, result.covariance) < NEES_LIMIT
    last = result.locations[seen.frames[-1].location]
    assert dict(last.surface or {})["kind"] == "balls"
    assert last.point_rms_mm.solved is not None
    assert last.point_rms_mm.solved < 0.2


def test_equal_balls_one_at_a_time_are_not_told_without_a_drawing() -> None:
    seen, anonymous, robot, _ = _seen(EQUAL)
    result = calibrate(anonymous.frames, EQUAL, robot, seen.sensor)
    assert not result.verdict.trustworthy
    assert result.T_hand_sensor is None
    assert "equal balls" in result.verdict.text
