"""Where balls stand, from circles through exact sections: of a plate, and of a bar whose turn about itself is open."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import pytest

from calib.surface.constellation import balls_places, renamed_by_place, told_alone
from geometry import AxisPoints, Frame, Pose, exp_so3
from jig_cad import Balls

X = Pose.from_fixed_xyz_deg([10.0, 80.0, -30.0], [60.0, -20.0, 150.0])  # T_hand_sensor
PLACE = Pose.from_fixed_xyz_deg([20.0, -35.0, 70.0], [1100.0, 200.0, 500.0])
BAR = {"a": (30.0, (-100.0, 0.0, 0.0)), "b": (30.0, (50.0, 0.0, 0.0))}
TURNED_BAR = {"a": (30.0, (50.0, 0.0, 0.0)), "b": (24.0, (-100.0, 0.0, 0.0))}
PLATE = {"a": (30.0, (0, 0, 0)), "b": (30.0, (90, 10, 0)), "c": (30.0, (20, 80, 15)), "d": (30.0, (100, 95, 0))}
NAMELESS = "abcdefgh"


def _frame(number: int, sensor: Pose, cut: Mapping[str, np.ndarray], radii: Mapping[str, float]) -> Frame:
    """Three nodes on the circle of every ball that the sheet cuts, named in the order of y, whatever they are of."""
    labels: list[str] = []
    nodes = []
    for k, name in enumerate(sorted(cut, key=lambda n: float((sensor.inverse() @ cut[n])[1]))):
        x, y, z = sensor.inverse() @ cut[name]
        r, t = np.sqrt(radii[name] ** 2 - x**2), np.array([-0.7, 0.1, 0.8])
        nodes.append(np.column_stack([y + r * np.sin(t), z - r * np.cos(t)]))
        labels += [NAMELESS[k]] * 3
    yz = np.concatenate(nodes)
    axis = AxisPoints(
        tuple(labels), np.full(len(yz), -1), yz, np.tile(1e-4 * np.eye(2), (len(yz), 1, 1)), ("",) * len(yz)
    )
    return Frame(number=number, location="A", role="calibrate", hand=sensor @ X.inverse(), axis=axis)


def _frames(balls: Mapping[str, tuple[float, tuple[float, float, float]]], pairs: list[tuple[str, ...]]) -> list[Frame]:
    """Frames of some balls each: the sheet through near their middles, from 300 mm, each turned otherwise."""
    rng, out = np.random.default_rng(3), []
    radii = {n: d / 2 for n, (d, _) in balls.items()}
    at = {n: PLACE @ np.array(c, float) for n, (_, c) in balls.items()}
    for k, names in enumerate(pairs):
        middle = np.mean([at[n] for n in names], axis=0)
        y = at[names[-1]] - at[names[0]] if len(names) > 1 else rng.normal(size=3)
        y = y / np.linalg.norm(y)
        z = np.cross(rng.normal(size=3), y)
        z /= np.linalg.norm(z)
        R = np.column_stack([np.cross(y, z), y, z]) @ exp_so3(rng.normal(0, 0.02, 3))
        sensor = Pose(R, middle - R @ np.array([rng.uniform(-4, 4), 0.0, 300.0]))
        out.append(_frame(k, sensor, {n: at[n] for n in names}, radii))
    return out


@pytest.mark.parametrize("balls", [BAR, TURNED_BAR])
def test_two_balls_on_a_bar_stand_where_they_are_and_their_turn_is_open(
    balls: Mapping[str, tuple[float, tuple[float, float, float]]],
) -> None:
    target = Balls.of(balls)
    assert target.on_a_line
    frames = _frames(balls, [("a", "b"), ("a",), ("b", "a"), ("b",), ("a", "b")])
    (place,) = balls_places(frames, target, X)
    true = np.array([PLACE @ np.array(c, float) for _, c in balls.values()])
    found = place @ target.centres_mm
    if balls is BAR and np.linalg.norm(found[0] - true[0]) > 1:  # equal ones may be called the other way round
        found = found[::-1]
    np.testing.assert_allclose(found, true, rtol=0, atol=1e-6)


def test_balls_of_a_plate_are_named_by_their_place() -> None:
    target = Balls.of(PLATE)
    shown = [("a", "b"), ("c", "d"), ("b", "d"), ("a", "c"), ("d",), ("a", "d"), ("b", "c")]
    frames = _frames(PLATE, shown)
    places = balls_places(frames, target, X, count=4)
    np.testing.assert_allclose(places[0] @ target.centres_mm, PLACE @ target.centres_mm, rtol=0, atol=1e-6)
    assert len(places) <= 4
    for f, names in zip(renamed_by_place(frames, target, X, places[0]), shown, strict=True):
        assert set(f.axis.label) == set(names)
    assert balls_places([], target, X) == []


def test_sizes_alone_name_a_pair() -> None:
    """Of 30 and 24 mm, cut near their middles; of equal balls nothing does."""
    frames = _frames(TURNED_BAR, [("a", "b")])
    target = Balls.of(TURNED_BAR)
    told = told_alone(frames[0], target)
    assert told is not None
    assert sorted(told.values()) == ["a", "b"]
    (renamed,) = renamed_by_place(frames, target, X, PLACE)
    assert {told[n] for n in dict.fromkeys(frames[0].axis.label)} == set(renamed.axis.label)
    assert told_alone(_frames(BAR, [("a", "b")])[0], Balls.of(BAR)) is None
