"""Strings, anchors, symmetry and tolerance of the jig, against docs/conventions.md spelled out in numbers."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from geometry import InputError
from jig_cad import ANCHORS, DEFAULT_STRINGS, STRINGS, Jig, half_turn_label, sample_tolerance

ATOL_MM = 1e-12
SIX = tuple(STRINGS)


def test_anchors_and_strings_are_where_the_design_says() -> None:
    jig = Jig.nominal(side_mm=80.0, height_mm=120.0, strings=SIX)
    depth = np.sqrt(3) / 2 * 80
    b, t = {"A": (0, 0, 0), "B": (0, -40, depth), "C": (0, 40, depth)}, (120, 0, 0)
    where = {f"{k}{e}": np.add(v, t if e == "t" else 0) for k, v in b.items() for e in "bt"}
    for i, anchor in enumerate(ANCHORS):
        np.testing.assert_allclose(jig.anchors_mm[i], where[anchor], rtol=0, atol=ATOL_MM)
    # B' from A's top to B's bottom, C' from A's bottom to C's top, D' from B's bottom to C's top
    ends = {"A": "Ab At", "B": "Bb Bt", "C": "Cb Ct", "B'": "At Bb", "C'": "Ab Ct", "D'": "Bb Ct"}
    for label, start, end in zip(jig.strings, jig.starts, jig.ends, strict=True):
        first, second = ends[label].split()
        np.testing.assert_allclose(start, where[first], rtol=0, atol=ATOL_MM)
        np.testing.assert_allclose(end, where[second], rtol=0, atol=ATOL_MM)
    np.testing.assert_allclose(jig.starts + jig.lengths[:, None] * jig.directions, jig.ends, rtol=0, atol=1e-12)
    assert Jig.nominal().strings == DEFAULT_STRINGS == ("A", "B", "C", "B'", "C'")


@given(st.floats(20, 500), st.floats(20, 500))
def test_the_half_turn_carries_the_jig_onto_itself(side_mm: float, height_mm: float) -> None:
    """As sets of two ends: a string has no direction. Twice the turn is nothing."""
    jig = Jig.nominal(side_mm, height_mm, strings=SIX)
    for label, start, end in zip(jig.strings, jig.starts, jig.ends, strict=True):
        k = jig.strings.index(half_turn_label(label))
        moved = {tuple(np.round(jig.half_turn @ p, 9) + 0.0) for p in (start, end)}
        assert moved == {tuple(np.round(p, 9) + 0.0) for p in (jig.starts[k], jig.ends[k])}
    np.testing.assert_allclose((jig.half_turn @ jig.half_turn).matrix, np.eye(4), rtol=0, atol=ATOL_MM)
    np.testing.assert_allclose(jig.half_turn @ np.array([1.0, 2, 3]), [height_mm - 1, -2, 3], rtol=0, atol=ATOL_MM)


def test_half_turn_labels() -> None:
    assert [half_turn_label(s) for s in SIX] == ["A", "C", "B", "C'", "B'", "D'"]
    with pytest.raises(InputError, match='did you mean "B\'"'):
        half_turn_label("b'")


def test_sampled_tolerance_is_uniform_in_y_and_z_alone() -> None:
    """10 000 jigs: within ± half the tolerance, the standard deviation of a uniform law, x untouched."""
    jig, rng = Jig.nominal(tolerance_mm=0.1), np.random.default_rng(1)
    shift = np.stack([sample_tolerance(jig, rng).anchors_mm for _ in range(10_000)]) - jig.anchors_mm
    assert np.all(shift[..., 0] == 0)
    assert 0.0499 < np.abs(shift).max() <= 0.05
    np.testing.assert_allclose(shift[..., 1:].std(axis=0), 0.1 / np.sqrt(12), rtol=0.03)
    np.testing.assert_allclose(shift[..., 1:].mean(axis=0), 0, atol=0.0015)
    sampled = sample_tolerance(jig, rng)
    assert not sampled.measured
    np.testing.assert_array_equal(sampled.nominal_anchors_mm, jig.anchors_mm)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"side_mm": 0.0}, "side_mm = 0: must be a positive"),
        ({"height_mm": np.inf}, "height_mm = inf"),
        ({"string_diameter_mm": np.nan}, "string_diameter_mm = nan"),
        ({"tolerance_mm": -0.1}, "tolerance_mm = -0.1"),
        ({"string_diameter_mm": 30.0}, "too large"),
        ({"tolerance_mm": 30.0}, "too large"),
        ({"strings": ()}, "no strings"),
        ({"strings": ("A", "A")}, "more than once"),
        ({"strings": ("A", "E")}, "known are A, B"),
        ({"strings": ("A", "c'")}, 'did you mean "C\'"'),
        ({"anchors_mm": np.zeros((5, 3))}, r"\(6, 3\)"),
        ({"anchors_mm": np.full((6, 3), np.nan)}, "anchor Ab"),
        ({"anchors_mm": np.zeros((6, 3))}, "Ab and At must lie"),
        ({"anchors_mm": Jig.nominal().anchors_mm / 1000}, "in millimetres"),
    ],
)
def test_numbers_that_are_no_jig_are_refused(change: dict[str, object], message: str) -> None:
    with pytest.raises(InputError, match=message):
        replace(Jig.nominal(), **change)  # type: ignore[arg-type]
