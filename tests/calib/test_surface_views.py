"""Views of surfaces that tell too little, by hands and places alone, at both sides of each limit."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from calib.surface.views import degenerate, general_advice
from calib.synthetic.cell import TRUTH
from calib.synthetic.telling_nothing import SPOILT, spoilt_cell
from geometry import AxisPoints, Frame, Pose, Surface
from jig_cad import Edge, Jig, Plane, Sphere, Wedge

X = Pose.from_fixed_xyz_deg([10.0, 80.0, -30.0], [60.0, -20.0, 150.0])  # T_hand_sensor
PLACE = Pose.from_fixed_xyz_deg([0.0, 0.0, 0.0], [1000.0, 0.0, 400.0])
BALL = Sphere(40.0)
Turns = list[tuple[float, float, float]]
# of the sensor against the place: about its own x, y and z
SOUND: Turns = [(0, 0, 0), (20, 0, 0), (0, 25, 0), (-15, 10, 5), (10, -30, 20), (5, 15, -25), (-25, -10, 10)]


def _frames(turns_deg: Turns, beside_mm: list[float] | None = None, location: str = "A") -> tuple[Frame, ...]:
    """Frames whose sensor, turned so, looks at the target from 300 mm, its sheet so far beside it."""
    beside = [8.0] * len(turns_deg) if beside_mm is None else beside_mm
    out = []
    for k, (turn, off) in enumerate(zip(turns_deg, beside, strict=True)):
        R = Pose.from_fixed_xyz_deg(turn, [0, 0, 0]).R
        sensor = Pose(PLACE.R @ R, PLACE.t - PLACE.R @ R @ np.array([off, 3.0 * (-1) ** k, 300.0]))
        out.append(Frame(number=k, location=location, role="calibrate", hand=sensor @ X.inverse()))
    return tuple(out)


def _said(frames: tuple[Frame, ...], target: Surface, T: Pose | None = X, place: Pose = PLACE) -> str:
    found = degenerate(frames, target, T, dict.fromkeys((f.location for f in frames), place))
    return "" if found is None else found.text


@pytest.mark.parametrize("target", [BALL, Plane(), Edge(), Wedge(90.0)])
def test_sound_views_have_no_name(target: Surface) -> None:
    assert _said(_frames(SOUND), target) == ""
    assert degenerate((), target, X, {}) is None
    assert degenerate(_frames([(0, 0, 0)] * 5), Jig.nominal(), X, {"A": PLACE}) is None


@pytest.mark.parametrize(("turn", "still"), [(2.9, True), (3.1, False)])
def test_shifts_alone(turn: float, still: bool) -> None:
    """Turns of 3° at most between any two."""
    frames = _frames([(0, 0, 0), (turn, 0, 0), (turn / 2, turn / 4, 0), (turn / 3, 0, turn / 4)])
    assert _said(frames, BALL).startswith("the hand was shifted and hardly turned between the frames of a loc") == still
    if still:
        assert "(by 2.9° at most), which tells the sensor's rotation alone: add poses that turn" in _said(frames, BALL)
        assert "and not even the rotation follows from a plane" in _said(frames, Plane())
        three = tuple(replace(f, location="ABC"[i % 3]) for i, f in enumerate(frames * 2))
        assert "which tells the sensor's rotation alone" in _said(three, Plane())
        two = tuple(replace(f, location="AB"[i % 2]) for i, f in enumerate(frames * 2))
        assert "not even the rotation" in _said(two, Plane())


@pytest.mark.parametrize(("second", "one"), [(1.0, True), (4.0, False)])
def test_turns_about_one_axis(second: float, one: bool) -> None:
    """The second axis has less than three hundredths of the first's turns."""
    frames = _frames([(0, 0, 0), (40, 0, 0), (-40, 0, 0), (20, second, 0), (-20, 0, 0)], [6.0, -5.0, 7.0, -8.0, 9.0])
    assert _said(frames, BALL).startswith("the hand turned about one axis only between the frames") == one
    assert _said(frames, Wedge(90.0)).startswith("all turns of the hand are about the wedge's own line, along w") == one
    across = Pose.from_fixed_xyz_deg([0.0, 0.0, 4.0], PLACE.t)
    assert _said(frames, Wedge(90.0), place=across).startswith("the hand turned about one axis only") == one
    nearly = Pose.from_fixed_xyz_deg([0.0, 0.0, 2.0], PLACE.t)
    assert _said(frames, Wedge(90.0), place=nearly).startswith("all turns of the hand are about") == one


def test_a_ball_cut_through_its_middle() -> None:
    """A tenth of the radius, rms, where none is cut at 0.15 or more; else the sections' own radii tell."""

    def said(beside: list[float], **given: Pose | None) -> str:
        return _said(_frames(SOUND, beside), BALL, **given)  # type: ignore[arg-type]

    even = [1.8, -1.8, 1.8, -1.8, 1.8, -1.8, 1.8]
    assert said(even).startswith("every frame cuts the ball through its middle (some 9% of its radius beside it)")
    assert said([v * 2.1 / 1.8 for v in even]) == ""
    assert said([0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 2.9]).startswith("every frame cuts the ball through its middle")
    assert said([0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 3.1]) == ""
    assert said(even, T=None) == ""
    found = degenerate(_frames(SOUND, even), BALL, X, {"A": PLACE})
    assert found is not None
    assert found.certain


@pytest.mark.parametrize(("share", "said"), [(0.09, True), (0.11, False)])
def test_a_ball_cut_through_its_middle_is_seen_by_its_sections(share: float, said: bool) -> None:
    """Where the place says otherwise: three nodes a frame give the section's radius."""
    radius = 20.0 * np.sqrt(1 - share**2)
    t = np.array([-0.6, 0.1, 0.7])
    yz = np.column_stack([radius * np.sin(t), 300.0 - radius * np.cos(t)])
    axis = AxisPoints(("sphere",) * 3, np.arange(3), yz, np.tile(1e-4 * np.eye(2), (3, 1, 1)), ("",) * 3)
    frames = tuple(replace(f, axis=axis) for f in _frames(SOUND, [8.0] * 7))
    assert ("through its middle" in _said(frames, BALL)) == said


@pytest.mark.parametrize(("off", "square"), [(2.9, True), (3.1, False)])
def test_a_line_crossed_square(off: float, square: bool) -> None:
    turns: Turns = [(0, 0, 0), (25, 0, 0), (-25, 0, 0), (10, off, 0), (-10, 0, off / 2), (30, -off, 0)]
    for target in (Edge(), Wedge(90.0)):
        words = f"every frame crosses the {target.kind}'s line square (within 2.9°), where a shift of the sensor along"
        assert (words in _said(_frames(turns), target)) == square
        assert words not in _said(_frames(turns), target, None)


def test_a_plane_is_seen_at_four_tilts_or_more() -> None:
    """Of one plane or two; tilts within 2° are one, turns about the normal add none."""
    three: Turns = [(0, 0, 0), (20, 0, 0), (0, 25, 0), (0, 0, 40), (20, 1.9, 0)]
    said = _said(_frames(three), Plane())
    assert said.startswith("1 plane seen at 3 different tilts of the sensor, and four or more in general position")
    assert "different tilts" not in _said(_frames([*three, (20, 2.2, 0)]), Plane())
    alike: Turns = [(0, 0, 0), (20, 0, 0), (0, 25, 0), (-10, -20, 0)]
    assert _said(_frames([*alike, (15, 15, 0)]), Plane()) == ""


def _about_z(*angles_deg: float) -> list[np.ndarray]:
    return [Pose.from_fixed_xyz_deg([0, 0, a], [0, 0, 0]).R for a in angles_deg]


def test_tilts_about_one_axis_or_of_one_amount_leave_a_plane_open() -> None:
    about_x: Turns = [(a, 0, z) for a, z in ((0, 0), (12, 30), (-18, -40), (25, 60), (-30, 10))]
    assert _said(_frames(about_x), Plane()).startswith(
        "one plane seen at tilts about one axis only: add poses that tilt"
    )
    ring = Pose.from_fixed_xyz_deg([20, 0, 0], [0, 0, 0]).R
    spins = [_about_z(a, b) for a, b in ((0, 0), (40, 70), (-30, 140), (80, 215), (-60, 290))]
    frames = tuple(
        replace(f, hand=Pose(PLACE.R @ before @ ring @ after @ X.R.T, f.at.t))
        for f, (before, after) in zip(_frames([(0, 0, 0)] * 5), spins, strict=True)
    )
    assert _said(frames, Plane()).startswith("one plane seen at tilts of one amount, or of two amounts about two axes")


def test_two_planes_need_four_tilts_and_three_planes_none() -> None:
    """Each plane seen at the same tilts: what the sensor sees of one it sees of the others."""
    tilts: Turns = [(0, 0, 0), (20, 0, 30), (0, 25, -40), (-20, -15, 10)]

    def said(count: int, turns: Turns) -> str:
        places = {
            n: Pose(Pose.from_fixed_xyz_deg([30.0 * i, 40.0 * i, 0], [0, 0, 0]).R, PLACE.t) for i, n in enumerate("ABC")
        }
        frames = [
            replace(f, location=n, hand=Pose(place.R @ f.at.R, f.at.t))
            for n, place in list(places.items())[:count]
            for f in _frames(turns)
        ]
        found = degenerate(frames, Plane(), X, places)
        return "" if found is None else found.text

    assert said(2, tilts[:3]).startswith(
        "2 planes seen at 3 different tilts of the sensor, and four or more in general"
    )
    assert said(2, tilts) == ""
    assert said(3, tilts[:3]) == ""


def test_advice_where_nothing_has_a_name() -> None:
    frames = _frames(SOUND)
    assert general_advice(Plane(), frames).startswith(
        "the tilts of the sensor against the plane are not in general pos"
    )
    assert general_advice({"A": BALL}, frames).startswith("add poses turned by 20° or more about two axes")


@pytest.mark.parametrize("name", SPOILT)
def test_every_kind_of_views_that_tells_too_little_has_its_name(name: str) -> None:
    """Of an arm as built, of which the table as given is known; few views, noise apart."""
    spoilt = SPOILT[name]
    cell = spoilt_cell(spoilt, np.random.default_rng(2), count=5 if spoilt.places > 1 else 10, most_places=2)
    frames = tuple(
        Frame(number=k, location=n, role="calibrate", hand=cell.robot.pose(q))
        for k, (n, q) in enumerate(zip(cell.location, cell.joints_rad, strict=True))
    )
    found = degenerate(frames, spoilt.target, TRUTH, cell.T_base_target)
    assert found is not None
    assert any(words in found.text for words in spoilt.words)
