"""Counting against truth: what is found, missed, false, mislabelled; only visible strings count."""

from __future__ import annotations

import numpy as np
import pytest

from geometry import AxisPoints, SurfacePoints
from workbench.window.engine import Labels
from workbench.window.truth import GATE_PX, TrueString, compare, summarise

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


def labels(names: list[str], us: list[float], off_mm: float = 0.0) -> Labels:
    n, u = len(us), np.array(us)
    yz = np.column_stack([u / 10 + off_mm, np.full(n, 50.0)])
    axis = AxisPoints(tuple(names), np.arange(n), yz, np.tile(np.eye(2), (n, 1, 1)), ("",) * n)
    return Labels(axis, None)


def test_errors_are_found_minus_true() -> None:
    us = [100.0, 200.0, 400.0]
    s = summarise([compare(strings(), spots(us), labels(["A", "B", "B'"], us, off_mm=0.03))], labelled=True)
    assert (s.visible, s.found, s.missed, s.false, s.mislabelled) == (3, 3, 0, 0, 0)
    np.testing.assert_allclose(s.bias_mm, (0.03, 0.0), atol=ATOL_MM)
    np.testing.assert_allclose(s.scatter_mm, (0.0, 0.0), atol=1e-9)
    np.testing.assert_allclose(s.rms_mm, 0.03, atol=ATOL_MM)


def test_a_hidden_string_is_neither_missed_nor_false() -> None:
    """C is seen in part: with or without it the figures are the same."""
    with_c, without_c = [100.0, 200.0, 300.0, 400.0], [100.0, 200.0, 400.0]
    names = ["A", "B", "C", "B'"]
    a = summarise([compare(strings(), spots(with_c), labels(names, with_c))], True)
    b = summarise([compare(strings(), spots(without_c), labels(["A", "B", "B'"], without_c))], True)
    assert a == b


@pytest.mark.parametrize(("u", "false"), [(100.0 + 0.9 * GATE_PX, 0), (100.0 + 1.1 * GATE_PX, 1)])
def test_a_labelled_spot_away_from_every_string_is_false(u: float, false: int) -> None:
    s = summarise([compare(strings(), spots([u]), labels(["A"], [u]))], True)
    assert s.false == false
    assert s.missed == 2 + false


def test_a_swap_is_two_mislabels_and_no_measurement() -> None:
    us = [100.0, 200.0]
    s = summarise([compare(strings(), spots(us), labels(["B", "A"], us))], True)
    assert s.mislabelled == 2
    assert np.isnan(s.rms_mm)


def test_a_string_is_counted_once() -> None:
    """Of two spots at one string the nearer one shows it, the other is false."""
    us = [100.5, 102.0]
    found = compare(strings(), spots(us), labels(["A", "B"], us))
    assert found.false_spots == (1,)


def test_without_a_jig_the_lit_surface_is_measured_and_every_spot_counts() -> None:
    found = compare(strings(), spots([100.0, 250.0], off_mm=0.02), None)
    s = summarise([found], labelled=False)
    assert (s.found, s.false) == (1, 1)
    np.testing.assert_allclose(s.bias_mm, (0.02, 0.0), atol=ATOL_MM)


def test_nothing_found_has_no_figures() -> None:
    s = summarise([compare(strings(), SurfacePoints.empty(), None)], labelled=False)
    assert (s.visible, s.missed) == (3, 3)
    assert np.all(np.isnan([s.rms_mm, *s.bias_mm, *s.scatter_mm]))
