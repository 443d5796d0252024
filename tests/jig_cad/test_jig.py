"""Strings, anchors, symmetry and tolerance of the jig, against docs/conventions.md spelled out in numbers."""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from geometry import InputError, Pose, exp_so3
from jig_cad import ANCHORS, DEFAULT_STRINGS, STRINGS, Jig, nominal_anchors, sample_tolerance
from tests.pinned import pinned

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
    (turn,) = jig.symmetries
    assert carries(jig, turn.pose, turn.renaming)
    np.testing.assert_allclose((turn.pose @ turn.pose).matrix, np.eye(4), rtol=0, atol=ATOL_MM)
    np.testing.assert_allclose(turn.pose @ np.array([1.0, 2, 3]), [height_mm - 1, -2, 3], rtol=0, atol=ATOL_MM)


def carries(jig: Jig, pose: Pose, renaming: Mapping[str, str], atol_mm: float = 1e-8) -> bool:
    """Whether the motion brings every string onto the one that the renaming names: a string has no direction."""
    for label, start, end in zip(jig.strings, jig.starts, jig.ends, strict=True):
        k = jig.strings.index(renaming[label])
        a, b = pose @ start, pose @ end
        ways = [np.maximum(np.abs(a - p).max(), np.abs(b - q).max()) for p, q in _both_ways(jig.starts[k], jig.ends[k])]
        if min(ways) > atol_mm:
            return False
    return True


def _both_ways(start: np.ndarray, end: np.ndarray) -> tuple[tuple[np.ndarray, np.ndarray], ...]:
    return (start, end), (end, start)


def test_the_half_turn_exchanges_names() -> None:
    (turn,) = Jig.nominal(strings=SIX).symmetries
    assert [turn.renaming[s] for s in SIX] == ["A", "C", "B", "C'", "B'", "D'"]
    assert [turn.relabelled(s) for s in SIX] == ["A", "C", "B", "C'", "B'", "D'"]


def test_strings_without_their_partners_have_no_half_turn() -> None:
    assert Jig.nominal(strings=("A", "B", "C", "B'")).symmetries == ()


NAMES = {"A": "front", "B": "left post", "C": "right post", "B'": "fall", "C'": "rise", "D'": "back"}
HOLES = dict(zip(ANCHORS, ("f0", "f1", "l0", "l1", "r0", "r1"), strict=True))


def renamed_pillar(strings: tuple[str, ...] = SIX, side_mm: float = 100.0, height_mm: float = 100.0) -> Jig:
    """The pillar as a set of lines between anchors of other names."""
    anchors = dict(zip(HOLES.values(), nominal_anchors(side_mm, height_mm).tolist(), strict=True))
    lines = {NAMES[s]: (HOLES[STRINGS[s][0]], HOLES[STRINGS[s][1]]) for s in strings}
    return Jig.of_lines(anchors, lines)


@given(st.floats(20, 500), st.floats(20, 500), st.sampled_from([SIX, DEFAULT_STRINGS]))
def test_a_pillar_of_other_names_is_known_as_one(side_mm: float, height_mm: float, strings: tuple[str, ...]) -> None:
    """To the last bit: sizes, lines, half turn; the paper's names of its strings are found."""
    jig, drawn = renamed_pillar(strings, side_mm, height_mm), Jig.nominal(side_mm, height_mm, strings=strings)
    assert jig.pillar is not None
    assert jig.pillar.strings == {s: NAMES[s] for s in strings}
    assert (jig.side_mm, jig.height_mm) == (drawn.side_mm, drawn.height_mm)
    np.testing.assert_array_equal(jig.starts, drawn.starts)
    np.testing.assert_array_equal(jig.ends, drawn.ends)
    (turn,), (its,) = jig.symmetries, drawn.symmetries
    np.testing.assert_array_equal(turn.pose.matrix, its.pose.matrix)
    assert turn.renaming == {NAMES[a]: NAMES[b] for a, b in its.renaming.items()}


def fan(n: int, twist: float = 30.0) -> dict[str, tuple[float, float, float]]:
    """Anchors of n strings around the x axis, each leaning by ``twist`` degrees about it: n-fold, without a mirror."""
    angle = 2 * np.pi * np.arange(n) / n
    out = {}
    for i, a in enumerate(angle):
        out[f"low {i}"] = (0.0, 50 * np.cos(a), 50 * np.sin(a))
        b = a + np.deg2rad(twist)
        out[f"high {i}"] = (80.0, 40 * np.cos(b), 40 * np.sin(b))
    return out


@pytest.mark.parametrize("n", [2, 3, 5])
def test_the_rotations_of_any_lines_are_found(n: int) -> None:
    """A fan of n strings, wider below than above: n - 1 turns about its axis and no other; they form a group."""
    anchors = fan(n)
    jig = Jig.of_lines(anchors, {f"s{i}": (f"low {i}", f"high {i}") for i in range(n)})
    assert jig.pillar is None
    assert len(jig.symmetries) == n - 1
    for turn in jig.symmetries:
        assert np.linalg.det(turn.pose.R) > 0
        np.testing.assert_allclose(turn.pose.R[0], [1, 0, 0], rtol=0, atol=1e-9)
        assert carries(jig, turn.pose, turn.renaming)
        assert {turn.relabelled(turn.renaming[s]) for s in jig.strings} == set(jig.strings)


@given(st.integers(0, 2**32 - 1))
def test_lines_without_symmetry_have_none_and_turned_ones_the_same(seed: int) -> None:
    """Five lines at random; and a fan of four with both ends alike, however it lies: a half turn about its axis and
    two across it, as a square prism has them, less those that the lean of its strings forbids.
    """
    rng = np.random.default_rng(seed)
    ends = rng.uniform(-50, 50, (10, 3))
    ends[5:, 0] += 150
    lines = {f"s{i}": (str(i), str(i + 5)) for i in range(5)}
    assert Jig.of_lines({str(i): tuple(p) for i, p in enumerate(ends)}, lines).symmetries == ()
    angle = np.pi / 2 * np.arange(4)
    low = np.column_stack([np.zeros(4), 50 * np.cos(angle), 50 * np.sin(angle)])
    high = low @ exp_so3(np.array([0.4, 0, 0])).T + [90.0, 0, 0]
    pose = Pose(exp_so3(rng.uniform(-3, 3, 3)), rng.uniform(-200, 200, 3))
    prism = {str(i): tuple(p) for i, p in enumerate(pose @ np.concatenate([low, high]))}
    jig = Jig.of_lines(prism, {f"s{i}": (str(i), str(i + 4)) for i in range(4)})
    assert len(jig.symmetries) == 7  # the dihedral group of order eight
    assert all(carries(jig, turn.pose, turn.renaming) for turn in jig.symmetries)


def test_sizes_of_lines_are_their_extents() -> None:
    jig = Jig.of_lines({"a": (10, 0, 0), "b": (90, 5, 0), "c": (0, 0, 60)}, {"x": ("a", "b"), "y": ("a", "c")})
    assert jig.height_mm == 90
    np.testing.assert_allclose(jig.side_mm, np.hypot(5, 60), rtol=0, atol=ATOL_MM)
    assert jig.pillar is None
    with pytest.raises(InputError, match="the paper's method needs a triangular pillar") as refused:
        jig.require_pillar("the paper's method")
    pinned(str(refused.value))


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
    ],
)
def test_numbers_that_are_no_pillar_are_refused(change: dict[str, object], message: str) -> None:
    with pytest.raises(InputError, match=message) as refused:
        Jig.nominal(**change)  # type: ignore[arg-type]
    pinned(str(refused.value))


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"string_diameter_mm": np.nan}, "string_diameter_mm = nan"),
        ({"tolerance_mm": -0.1}, "tolerance_mm = -0.1"),
        ({"tolerance_mm": 30.0}, "too large"),
        ({"anchors_mm": np.zeros((5, 3))}, r"\(6, 3\)"),
        ({"anchors_mm": np.full((6, 3), np.nan)}, "anchor Ab"),
        ({"anchors_mm": np.zeros((6, 3))}, "Ab and At must lie"),
        ({"anchors_mm": Jig.nominal().anchors_mm / 1000}, "in millimetres"),
    ],
)
def test_numbers_that_are_no_jig_are_refused(change: dict[str, object], message: str) -> None:
    with pytest.raises(InputError, match=message) as refused:
        replace(Jig.nominal(), **change)  # type: ignore[arg-type]
    pinned(str(refused.value))


LINES: dict[str, Sequence[float]] = {"a": (0, 0, 0), "b": (100, 0, 0), "c": (0, 50, 0), "d": (90, 60, 10)}


@pytest.mark.parametrize(
    ("anchors", "strings", "message"),
    [
        (LINES, {"s": ("a", "a")}, "from anchor a to itself"),
        (LINES, {"s": ("a", "e")}, 'ends at an anchor "e" that is not given; known are a, b, c, d'),
        ({"left low": (0, 0, 0), "right": (100, 0, 0)}, {"s": ("left lo", "right")}, 'did you mean "left low"'),
        (LINES, {}, "no strings"),
        (LINES, {"": ("a", "b")}, "must not be empty"),
        (LINES, {" s": ("a", "b")}, "begin or end with a space"),
        (LINES, {"s,t": ("a", "b")}, "must hold none of"),
        (LINES, {'"s"': ("a", "b")}, "must hold none of"),
        (LINES, {"ä": ("a", "b")}, "printable ASCII"),
        (LINES, {"s\n": ("a", "b")}, "space"),
        (LINES, {"s" * 41: ("a", "b")}, "at most 40"),
        (LINES | {"b": (1.0, 0, 0)}, {"s": ("a", "b")}, "string s is only 1 mm long"),
        (LINES | {"b": (np.nan, 0, 0)}, {"s": ("a", "b")}, "anchor b holds a number that is not finite"),
    ],
)
def test_lines_that_are_no_jig_are_refused(
    anchors: dict[str, Sequence[float]], strings: dict[str, tuple[str, str]], message: str
) -> None:
    with pytest.raises(InputError, match=message) as refused:
        Jig.of_lines(anchors, strings)
    pinned(str(refused.value))


@pytest.mark.parametrize("way", [(1, 0, 0), (0, 1, 0), (0, 0, 1), (1, -5, -9), (0, 1, -9), (0.002, -1, 0)])
@pytest.mark.parametrize("sense", [1.0, -1.0])
def test_lines_run_in_the_sense_in_which_x_grows_or_else_y_or_z(way, sense):
    unit = np.array(way) / np.linalg.norm(way)
    side = np.linalg.svd(unit[None])[2][1:]
    starts = [a * side[0] + b * side[1] for a, b in ((0, 0), (30, 0), (0, 30), (30, 30))]
    ends = (("a", 0.0), ("b", sense))
    anchors = {f"{end}{k}": tuple(p + e * 100.0 * unit) for k, p in enumerate(starts) for end, e in ends}
    jig = Jig.of_lines(anchors, {f"line {k}": (f"a{k}", f"b{k}") for k in range(4)})
    np.testing.assert_allclose(jig.axis, unit, atol=1e-9)
    assert jig.height_mm > 0
