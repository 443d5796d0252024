"""Files that no reader must choke on: bounded time and memory, one sentence."""

from __future__ import annotations

import os
import re
import time
from pathlib import Path

import pytest

from geometry import InputError, parse_toml, read_bytes, read_text
from tests.pinned import pinned

PATIENCE_S = 5.0

TEXTS = {
    "a header of many parts": ("[" + ".".join("a" * 100_000) + "]", "parts with dots"),
    "a key of many parts": (".".join("a" * 100_000) + " = 1", "parts with dots"),
    "quoted parts": ('"a".' * 50_000 + "b = 1", "parts with dots"),
    "inline": ("x = { " + ".".join("a" * 100_000) + " = 1 }", "parts with dots"),
    "nested lists": ("x = " + "[" * 3000 + "]" * 3000, "nested"),
    "nested tables": ("x = " + "{a = " * 3000 + "1" + "}" * 3000, "nested"),
    "many digits": ("x = " + "9" * 5000, "not valid TOML"),
    "a large number": ("x = " + "9" * 4000, "a whole number of "),
    "hexadecimal": ("x = 0x" + "f" * 100_000, "a whole number of"),
    "beyond": ("[a.b]\nx = [1, 1e300]", "1e+300"),
    "a date that is none": ("x = 2024-13-45", "not valid TOML"),
    "an open header": ("[" + " " * 1_000_000, "not valid TOML"),
    "too long": ("#" * (4 * 2**20 + 1), "larger than 4 MB"),
}


@pytest.mark.parametrize("case", TEXTS)
def test_one_sentence_in_bounded_time(case: str) -> None:
    text, message = TEXTS[case]
    start = time.process_time()
    with pytest.raises(InputError, match=re.escape(message)) as error:
        parse_toml(text, "a.toml")
    assert time.process_time() - start < PATIENCE_S
    assert str(error.value).startswith("a.toml")
    assert len(str(error.value)) < 300
    assert "\n" not in str(error.value)


def test_what_is_long_and_right_is_read() -> None:
    """Decimal numbers, rules of dots in comments and text, and keys of a few parts are no long keys."""
    text = f"# {'.' * 500}\na.b.c = [{', '.join(['0.125'] * 500)}]\nt = '{'.' * 300}'\ninfinite = inf\n"
    assert parse_toml(text, "a.toml")["a"]["b"]["c"][499] == 0.125


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="the system has no pipes in its file system")
def test_devices_pipes_and_folders_are_no_files(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe")
    for path, word in ((tmp_path / "pipe", "pipe"), (Path("/dev/zero"), "device"), (tmp_path, "folder")):
        with pytest.raises(InputError, match=word) as refused:
            read_text(path)
        pinned(str(refused.value).replace(str(tmp_path), ""))
    with pytest.raises(InputError, match="no such file") as refused:
        read_text(tmp_path / "none")
    pinned(str(refused.value).replace(str(tmp_path), ""))
    (tmp_path / "large").write_bytes(b"x" * 1001)
    with pytest.raises(InputError, match="larger than") as refused:
        read_bytes(tmp_path / "large", 1000)
    pinned(str(refused.value).replace(str(tmp_path), ""))
    (tmp_path / "empty").write_bytes(b"")
    with pytest.raises(InputError, match="empty") as refused:
        read_bytes(tmp_path / "empty", 1000)
    pinned(str(refused.value).replace(str(tmp_path), ""))


def test_endless_words_of_a_file_are_cut_in_a_sentence() -> None:
    told = str(InputError(f"a/b.toml: unknown key {'x' * 3000} in [{'[' * 2000}; known are side_mm"))
    assert len(told) < 300
    assert "xxx… in" in told
    assert "known are side_mm" in told
