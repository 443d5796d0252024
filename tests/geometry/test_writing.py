"""Files appear whole or not at all; TOML values are read back to the last bit."""

from __future__ import annotations

import tomllib
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from geometry import InputError, toml_value, write_bytes
from tests.pinned import pinned

values = st.recursive(
    st.booleans() | st.integers(-(2**63), 2**63 - 1) | st.floats(allow_nan=False) | st.text(),
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(st.text(), inner, max_size=3),
    max_leaves=12,
)


@given(values)
def test_a_value_comes_back(value: object) -> None:
    assert tomllib.loads(f"v = {toml_value(value)}")["v"] == value


def test_a_failed_write_leaves_what_stood_there_and_nothing_beside(tmp_path: Path) -> None:
    path = tmp_path / "a.toml"
    path.write_text("old")
    with pytest.raises(TypeError):
        write_bytes(path, "no bytes")  # type: ignore[arg-type]
    assert [p.name for p in tmp_path.iterdir()] == ["a.toml"]
    assert path.read_text() == "old"
    with pytest.raises(InputError, match="can not be written") as refused:
        write_bytes(tmp_path / "missing" / "b.toml", b"new")
    pinned(str(refused.value).replace(str(tmp_path), ""))


def test_an_interrupt_right_after_the_file_is_made_leaves_none(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    made = Path.open

    def interrupted(self: Path, mode: str) -> object:
        made(self, mode).close()
        raise KeyboardInterrupt

    monkeypatch.setattr(Path, "open", interrupted)
    with pytest.raises(KeyboardInterrupt):
        write_bytes(tmp_path / "a.toml", b"new")
    assert list(tmp_path.iterdir()) == []


def test_what_is_no_file_is_a_sentence(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("here")
    for goal in (tmp_path / "file" / "a.toml", tmp_path, Path("/")):
        with pytest.raises(InputError, match="can not be written") as refused:
            write_bytes(goal, b"new")
        pinned(str(refused.value).replace(str(tmp_path), ""))
