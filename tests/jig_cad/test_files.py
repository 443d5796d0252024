"""jig.toml: what is read is what was written, and every fault names the file and the key."""

from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from geometry import InputError
from jig_cad import STRINGS, Jig, jig_from_table, read_jig, sample_tolerance, write_jig

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
    with pytest.raises(InputError, match="lacks Bb"):
        jig_from_table({**SIZES, "anchors_mm": anchors})


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
        ("", 'the key "side_mm" is missing'),
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
    with pytest.raises(InputError, match="can not be read"):
        read_jig(tmp_path / "none.toml")
    (tmp_path / "binary.toml").write_bytes(b"\xff\xfe\x00")
    with pytest.raises(InputError, match="UTF-8"):
        read_jig(tmp_path / "binary.toml")
    with pytest.raises(InputError, match="can not be written"):
        write_jig(Jig.nominal(), tmp_path / "no folder" / "jig.toml")
