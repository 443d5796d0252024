"""Counting against truth: what is found, missed, false, mislabelled; only visible strings count.

That a count is what a person would say of the image is not tested, only that all who count say the same.
"""

from __future__ import annotations

import numpy as np
import pytest

from geometry import AxisPoints, Frame, SurfacePoints
from workbench.compare import (
    GATE_MM,
    GATE_PX,
    Comparison,
    NamedPoints,
    TrueString,
    match,
    named_points,
    summarise,
    true_strings,
)
from workbench.tune.cost import against_truth
from workbench.validate.measure import score
from workbench.window.truth import comparison_json

ATOL_MM = 1e-12
TRUE = [("A", 100.0, 1.0), ("B", 200.0, 1.0), ("C", 300.0, 0.5), ("B'", 400.0, 1.0)]


def strings() -> list[TrueString]:
    return [TrueString(n, (u / 10, 50.0), (u / 10, 49.9), (u, 60.0), visible) for n, u, visible in TRUE]


def spots(us: list[float], off_mm: float = 0.0) -> SurfacePoints:
    n, u = len(us), np.array(us)
    uv = np.column_stack([u, np.full(n, 60.0)])
    yz = np.column_stack([u / 10 + off_mm, np.full(n, 49.9)])
    cov = np.tile(np.eye(2), (n, 1, 1))
    return SurfacePoints(uv, cov, yz, cov, np.ones(n), ("",) * n, np.zeros(n), np.ones((n, 2)), np.ones(n))


def names(of: dict[int, str], us: list[float], off_mm: float = 0.0) -> AxisPoints:
    """Axis points of the spots with these numbers."""
    n, u = len(of), np.array(us)[list(of)]
    yz = np.column_stack([u / 10 + off_mm, np.full(n, 50.0)])
    return AxisPoints(tuple(of.values()), np.array(list(of)), yz, np.tile(np.eye(2), (n, 1, 1)), ("",) * n)


def compare(us: list[float], of: dict[int, str] | None, off_mm: float = 0.0) -> Comparison:
    axis = None if of is None else names(of, us, off_mm)
    return match(strings(), named_points(spots(us, off_mm), axis), labelled=axis is not None)


def named(*label: str) -> dict[int, str]:
    return dict(enumerate(label))


def test_errors_are_found_minus_true() -> None:
    s = summarise([compare([100.0, 200.0, 400.0], named("A", "B", "B'"), off_mm=0.03)])
    assert (s.visible, s.found, s.missed, s.false, s.mislabelled) == (3, 3, 0, 0, 0)
    np.testing.assert_allclose(s.bias_mm, (0.03, 0.0), atol=ATOL_MM)
    np.testing.assert_allclose(s.scatter_mm, (0.0, 0.0), atol=ATOL_MM)
    np.testing.assert_allclose(s.rms_mm, 0.03, atol=ATOL_MM)
    np.testing.assert_allclose(s.rms_yz_mm, (0.03, 0.0), atol=ATOL_MM)


def test_a_hidden_string_is_neither_missed_nor_false() -> None:
    """C is seen in part: with or without it the figures are the same."""
    a = summarise([compare([100.0, 200.0, 300.0, 400.0], named("A", "B", "C", "B'"))])
    b = summarise([compare([100.0, 200.0, 400.0], named("A", "B", "B'"))])
    assert a == b


@pytest.mark.parametrize(("u", "false"), [(100.0 + 0.9 * GATE_PX, 0), (100.0 + 1.1 * GATE_PX, 1)])
def test_a_labelled_spot_away_from_every_string_is_false(u: float, false: int) -> None:
    s = summarise([compare([u], named("A"))])
    assert s.false == false
    assert s.missed == 2 + false


def test_a_swap_is_two_mislabels_and_no_measurement() -> None:
    s = summarise([compare([100.0, 200.0], named("B", "A"))])
    assert (s.found, s.missed, s.false, s.mislabelled) == (0, 3, 0, 2)
    assert np.isnan(s.rms_mm)


def test_a_string_is_counted_once() -> None:
    """Of two spots at one string the nearer one shows it, the other is false."""
    assert compare([100.5, 102.0], named("A", "B")).false_points == (1,)


def test_a_spot_without_a_name_takes_no_string_from_one_that_has() -> None:
    """The nearer spot was left out by the labelling: the string is found all the same, by the other one."""
    found = compare([100.1, 101.0], {1: "A"})
    s = summarise([found])
    assert (s.found, s.false, s.mislabelled) == (1, 0, 0)
    assert found.matches[0].point == 1


def test_without_a_jig_the_lit_surface_is_measured_and_every_spot_counts() -> None:
    s = summarise([compare([100.0, 250.0], None, off_mm=0.02)])
    assert (s.found, s.false) == (1, 1)
    np.testing.assert_allclose(s.bias_mm, (0.02, 0.0), atol=ATOL_MM)


def test_nothing_found_has_no_figures() -> None:
    s = summarise([match(strings(), named_points(SurfacePoints.empty(), None), labelled=False)])
    assert (s.visible, s.missed) == (3, 3)
    assert np.all(np.isnan([s.rms_mm, *s.bias_mm, *s.scatter_mm]))


@pytest.mark.parametrize(("off_mm", "found"), [(0.9 * GATE_MM, 1), (1.1 * GATE_MM, 0)])
def test_a_point_without_a_pixel_is_matched_in_the_laser_plane(off_mm: float, found: int) -> None:
    """As of a points.csv that holds axis points alone."""
    points = NamedPoints(("A",), np.full((1, 2), np.nan), np.array([[10.0 + off_mm, 50.0]]))
    s = summarise([match(strings(), points, labelled=True)])
    assert (s.found, s.false) == (found, 1 - found)


def test_strings_without_an_image_are_left_out() -> None:
    nothing = np.full(2, np.nan)

    class Unseen:
        label, axis_mm, surface_mm, image_px, visible_fraction = "D'", np.ones(2), nothing, nothing, 0.0

    assert true_strings([*strings(), Unseen()]) == tuple(strings())


DISPUTED = [
    ([100.5, 102.0, 200.0, 400.0], {0: "A", 1: "B'", 2: "B"}),  # two named spots at one string
    ([100.1, 101.0, 200.0, 400.0], {1: "A", 2: "B", 3: "B'"}),  # a nearer one without a name
    ([100.0, 200.0, 300.0, 250.0], {0: "A", 1: "C", 2: "B'", 3: "B"}),  # mislabelled, also where a string is hidden
]


@pytest.mark.parametrize(("us", "of"), DISPUTED)
def test_validation_window_tuning_and_campaign_count_alike(us: list[float], of: dict[int, str]) -> None:
    """Frames on which a matcher of nearest strings and one of nearest pairs disagree."""
    points, axis = spots(us), names(of, us)
    _, counts = score(Frame(0, "", points=points, axis=axis), strings())
    validation = {k: counts[k] for k in ("visible", "found", "false", "mislabelled")}
    page = comparison_json(match(strings(), named_points(points, axis), labelled=True))["statistics"]
    assert {k: page[k] for k in validation} == validation
    only_named = NamedPoints(axis.label, points.uv_px[axis.spot], axis.yz_mm)  # what a campaign keeps of a frame
    campaign = summarise([match(true_strings(strings()), only_named, labelled=True)])
    assert (campaign.visible, campaign.found, campaign.false, campaign.mislabelled) == tuple(validation.values())
    cost = against_truth(match(strings(), named_points(points, axis), labelled=True))
    wrong = validation["false"] + validation["mislabelled"]
    assert (cost.wanted, cost.measured, cost.false) == (validation["visible"], validation["found"], wrong)
    assert cost.missed == page["missed"]
