"""The file that the window saves is the file that the other commands take."""

from __future__ import annotations

from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from extraction import ExtractionConfig
from geometry import InputError
from workbench.files import carried_calib, parse_settings, read_settings, settings_toml
from workbench.tune.space import space, with_values
from workbench.window import settings

DIMENSIONS = space(ExtractionConfig)


def drawn(numbers: list[float]) -> ExtractionConfig:
    values = {}
    for d, x in zip(DIMENSIONS, numbers, strict=True):
        value = d.low + x * (d.high - d.low)
        values[d.key] = round(value) if d.kind == "integer" else value
    found = with_values(ExtractionConfig(), values)
    assert isinstance(found, ExtractionConfig)
    return found


@given(st.lists(st.floats(0.001, 0.999), min_size=len(DIMENSIONS), max_size=len(DIMENSIONS)))
def test_any_parameters_survive_the_file_exactly(numbers: list[float]) -> None:
    config = drawn(numbers)
    assert parse_settings(settings_toml(config), "a.toml") == config


def test_the_commands_read_what_the_window_writes(tmp_path: Path) -> None:
    config = ExtractionConfig.model_validate({"detect": {"threshold": 9.25}, "localise": {"method": "fast"}})
    path = tmp_path / "a.toml"
    path.write_text(settings_toml(config, {"method": "paper"}), encoding="utf-8")
    found = read_settings([path])
    assert found.extraction == config
    assert found.calib.method == "paper"
    assert carried_calib(path.read_text(), "a.toml") == {"method": "paper"}


@pytest.mark.parametrize(
    ("text", "match"),
    [
        ("[detect]\nthreshhold = 5.0\n", "line 2.*did you mean"),
        ("[detect\n", "not valid TOML"),
        ("[detect]\nthreshold = nan\n", "line 2"),
        ("scp_initial = 1\n", "unknown key"),
    ],
)
def test_a_wrong_file_is_explained(text: str, match: str) -> None:
    with pytest.raises(InputError, match=match):
        parse_settings(text, "a.toml")


def test_names_lists_plain_toml_files_alone(tmp_path: Path) -> None:
    for name in ("b.toml", "a.toml", ".hidden.toml", "c.txt", "x y.toml"):
        (tmp_path / name).write_text("")
    (tmp_path / "folder.toml").mkdir()
    assert settings.names(tmp_path) == ["a.toml", "b.toml", "x y.toml"]


@pytest.mark.parametrize(("content", "match"), [(b"\xff\xfe\x00", "UTF-8"), (b" " * 100_000, "larger")])
def test_unreadable_settings(tmp_path: Path, content: bytes, match: str) -> None:
    (tmp_path / "a.toml").write_bytes(content)
    with pytest.raises(InputError, match=match):
        settings.read(tmp_path, "a.toml")
    with pytest.raises(InputError, match="no such file"):
        settings.read(tmp_path, "b.toml")
