"""jig.toml: what is read is what was written, and every fault names the file and the key."""

import tomllib
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from geometry import InputError
from jig_cad import STRINGS, Jig, jig_from_table, jig_text, read_jig, sample_tolerance, write_jig
from jig_cad.jig import FORBIDDEN
from tests.pinned import pinned
from workbench.files import read_jig_file

PAPER = "side_mm = 100.0\nheight_mm = 100\nstring_diameter_mm = 0.3\ntolerance_mm = 0.1\n"
SIZES = {"side_mm": 100, "height_mm": 100.0, "string_diameter_mm": 0.3, "tolerance_mm": 0.1}


def test_the_papers_jig_is_read(tmp_path: Path) -> None:
    path = tmp_path / "jig.toml"
    path.write_text('name = "ours" # a comment\n' + PAPER)
    jig = read_jig(path)
    assert (jig.name, jig.side_mm, jig.height_mm, jig.string_diameter_mm) == ("ours", 100, 100, 0.3)
    assert jig.strings == ("A", "B", "C", "B'", "C'")
    assert not jig.measured


@given(st.integers(0, 2**32 - 1), st.text(max_size=12), st.permutations(list(STRINGS)), st.integers(1, 6))
def test_what_is_written_is_read_back(seed: int, name: str, labels: list[str], count: int) -> None:
    """To the last bit, with measured anchors and any name."""
    jig = Jig.nominal(101.1, 99.9, 0.25, 0.07, tuple(labels[:count]), name=name)
    jig = replace(sample_tolerance(jig, np.random.default_rng(seed)), measured=True)
    with TemporaryDirectory() as folder:
        write_jig(jig, Path(folder) / "jig.toml")
        again = read_jig(Path(folder) / "jig.toml")
        assert [p.name for p in Path(folder).iterdir()] == ["jig.toml"]
    np.testing.assert_array_equal(again.anchors_mm, jig.anchors_mm)
    assert (again.strings, again.name, again.measured, again.tolerance_mm) == (jig.strings, name, True, 0.07)


def test_unused_anchors_need_no_measuring() -> None:
    anchors = {"Ab": [0.1, 0, 0], "At": [100.0, 0.02, 0]}
    jig = jig_from_table({**SIZES, "strings": ["A"], "anchors_mm": anchors})
    np.testing.assert_array_equal(jig.starts, [[0.1, 0, 0]])
    with pytest.raises(InputError, match="lacks Bb") as refused:
        jig_from_table({**SIZES, "anchors_mm": anchors})
    pinned(str(refused.value))


NAME = st.text("".join(c for c in map(chr, range(33, 127)) if c not in FORBIDDEN), min_size=1, max_size=12)


@given(st.lists(NAME, min_size=6, max_size=14, unique=True), st.integers(0, 2**32 - 1), st.booleans())
def test_any_lines_of_any_names_are_read_back(names: list[str], seed: int, measured: bool) -> None:
    """To the last bit: names, lines, anchors, and the symmetries that are found anew."""
    rng = np.random.default_rng(seed)
    anchors = {a: rng.uniform(-100, 100, 3) + np.array([300 * (i % 2), 0, 0]) for i, a in enumerate(names)}
    strings = {a[::-1] + a: (a, b) for a, b in pairwise(names)}
    jig = Jig.of_lines({a: tuple(p) for a, p in anchors.items()}, strings, 0.25, 0.07, measured, "ours")
    with TemporaryDirectory() as folder:
        write_jig(jig, Path(folder) / "jig.toml")
        again, also = read_jig(Path(folder) / "jig.toml"), read_jig_file(Path(folder) / "jig.toml")
    for one in (again, also):
        np.testing.assert_array_equal(one.anchors_mm, jig.anchors_mm)
        assert (one.anchors, one.strings, one.name, one.measured) == (jig.anchors, jig.strings, "ours", measured)
        np.testing.assert_array_equal(one.start_index, jig.start_index)
        np.testing.assert_array_equal(one.end_index, jig.end_index)
        assert [s.renaming for s in one.symmetries] == [s.renaming for s in jig.symmetries]


def test_a_made_jig_is_written_as_drawn() -> None:
    """What a user knows of a jig that was not measured is its drawing."""
    drawn = jig_from_table(tomllib.loads(LINES))
    made = sample_tolerance(drawn, np.random.default_rng(1))
    assert jig_text(made) == jig_text(drawn)


LINES = """\
kind = "strings"
string_diameter_mm = 0.3
tolerance_mm = 0.1
[anchors_mm]
name = "holes as drilled"
low = [0, 0, 0.0]
"far corner" = [95, 20, 60.5]
right = [90, -30, 10]
[strings]
front = ["low", "far corner"]
left-over = ["right", "low"]
"""


def test_lines_between_named_anchors_are_read() -> None:
    jig = jig_from_table(tomllib.loads(LINES))
    assert jig.strings == ("front", "left-over")
    np.testing.assert_array_equal(jig.ends, [[95, 20, 60.5], [0, 0, 0]])
    assert (jig.pillar, jig.measured, jig.height_mm) == (None, False, 95)


def test_further_lines_between_a_pillars_anchors() -> None:
    lines = '[strings]\nA = ["Ab", "At"]\nE = ["At", "Ct"]\nF = ["Ab", "mid"]\n'
    text = PAPER + lines + "[anchors_mm]\nmid = [50, 10, 40]\n"
    jig = jig_from_table(tomllib.loads(text))
    assert jig.anchors == ("Ab", "At", "Ct", "mid")
    np.testing.assert_array_equal(jig.starts[1], [100, 0, 0])


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (LINES.replace("tolerance", "tolerence"), r'unknown key "tolerence_mm": did you mean "tolerance_mm"'),
        (LINES.replace("tolerance_mm = 0.1\n", ""), 'the key "tolerance_mm" is missing'),
        (LINES.replace('"strings"', '"sphere"'), 'kind = "sphere": a string jig is needed here'),
        (LINES.replace('"strings"', '"string"'), 'did you mean "strings"'),
        (LINES.replace('"strings"', "3"), "kind = 3; known are strings, sphere"),
        (LINES.replace('["right", "low"]', '["right", "lo"]'), 'string "left-over" ends at an anchor "lo"'),
        (LINES.replace('["right", "low"]', '["low"]'), "strings.left-over"),
        (LINES.replace('["right", "low"]', '["low", "low"]'), "string left-over runs from anchor low to itself"),
        (LINES.replace("[90, -30, 10]", "[1, 1, 0]"), "string left-over is only 1.4"),
        (LINES.replace("[90, -30, 10]", "[90, -30]"), "anchors_mm.right"),
        (LINES.replace("[90, -30, 10]", "[90, -30, inf]"), "anchors_mm.right.2"),
        (LINES.replace("left-over", '"a,b"'), "must hold none of"),
        (LINES.replace("tolerance_mm", "side_mm = 100\ntolerance_mm"), 'the key "height_mm" is missing beside side_mm'),
        (LINES.replace('front = ["low", "far corner"]\nleft-over = ["right", "low"]\n', ""), "no strings"),
    ],
)
def test_faults_of_lines_name_the_file_and_the_key(tmp_path: Path, text: str, message: str) -> None:
    """By both readers, the one that knows lines of the text too."""
    path = tmp_path / "target.toml"
    path.write_text(text)
    with pytest.raises(InputError, match=message) as caught:
        read_jig(path)
    assert str(path) in str(caught.value)
    assert "\n" not in str(caught.value)
    with pytest.raises(InputError) as other:
        read_jig_file(path)
    assert str(path) in str(other.value)
    assert "\n" not in str(other.value)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (PAPER.replace("height", "heigth"), r'jig\.toml: unknown key "heigth_mm": did you mean "height_mm"'),
        (PAPER + "[anchors]\n", r'unknown key "anchors": did you mean "anchors_mm"'),
        (PAPER + "zebra = 1\n", r"known are name, side_mm"),
        (PAPER + "[anchors_mm]\nab = [0, 0, 0]\n", r'unknown key "anchors_mm.ab": did you mean "Ab"'),
        (PAPER + "[anchors_mm]\nAb = [0, 0]\n", r"anchors_mm\.Ab"),
        (PAPER + "[anchors_mm]\nAb = [0, 0, nan]\n", r"anchors_mm\.Ab\.2"),
        (PAPER.replace("100.0", '"100"'), "side_mm"),
        (PAPER.replace("100.0", "nan"), "side_mm"),
        (PAPER.replace("100.0", "-1"), "side_mm = -1: must be a positive"),
        (PAPER.replace("side_mm", "#"), 'the key "side_mm" is missing'),
        (PAPER + 'strings = ["A", "Q"]\n', 'name "Q"'),
        (PAPER + "strings = 5\n", "strings"),
        ("side_mm = \n", "not valid TOML"),
        ("", "the file is empty"),
    ],
)
def test_faults_name_the_file_and_the_key(tmp_path: Path, text: str, message: str) -> None:
    path = tmp_path / "jig.toml"
    path.write_text(text)
    with pytest.raises(InputError, match=message) as caught:
        read_jig(path)
    assert str(path) in str(caught.value)
    assert "\n" not in str(caught.value)


def test_files_that_can_not_be_read_or_written(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="no such file") as refused:
        read_jig(tmp_path / "none.toml")
    pinned(str(refused.value).replace(str(tmp_path), ""))
    (tmp_path / "binary.toml").write_bytes(b"\xff\xfe\x00")
    with pytest.raises(InputError, match="UTF-8") as refused:
        read_jig(tmp_path / "binary.toml")
    pinned(str(refused.value).replace(str(tmp_path), ""))
    with pytest.raises(InputError, match="can not be written") as refused:
        write_jig(Jig.nominal(), tmp_path / "no folder" / "jig.toml")
    pinned(str(refused.value).replace(str(tmp_path), ""))
