"""The file that the window saves is the file that the other commands take."""

from __future__ import annotations

from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from extraction import ExtractionConfig
from geometry import InputError
from workbench.files import Recipe, parse_settings, read_settings, settings_toml
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
    recipe = Recipe(**dict(config))
    assert parse_settings(settings_toml(recipe), "a.toml") == recipe
    assert read_settings([]).recipe == Recipe()


def test_the_commands_read_what_the_window_writes(tmp_path: Path) -> None:
    recipe = Recipe.model_validate(
        {
            "what": "stripe",
            "detect": {"threshold": 9.25},
            "localise": {"method": "fast"},
            "region": {"keep": [[[10, 10], [200.5, 12], [100, 300]]], "leave_out": [[[0, 0], [5, 0], [5, 5]]]},
            "stripe": {"select": "all"},
            "measure": {"feature": "sphere", "diameter_mm": 40.0, "gap_and_flush": True},
            "gapflush": {"reference": "right"},
            "calib": {"method": "paper"},
            "tolerances": {"gap_mm": {"min": 3.0, "max": 4.0}, "clipped_px": {"max": 20.0}},
        }
    )
    path = tmp_path / "a.toml"
    path.write_text(settings_toml(recipe), encoding="utf-8")
    found = read_settings([path])
    assert found.recipe == recipe
    assert found.extraction == ExtractionConfig(**{n: getattr(recipe, n) for n in ExtractionConfig.model_fields})
    assert found.calib.method == "paper"
    assert settings_toml(found.recipe) == settings_toml(recipe)


def test_a_later_file_stands_over_an_earlier_one_key_by_key(tmp_path: Path) -> None:
    (tmp_path / "a.toml").write_text('[stripe]\nmin_snr = 3.0\nselect = "all"\n[calib.surface]\nknown = true\n')
    (tmp_path / "b.toml").write_text("[stripe]\nmin_snr = 4.0\n[calib]\nrelabel_rounds = 3\n")
    found = read_settings([tmp_path / "a.toml", tmp_path / "b.toml"])
    assert (found.stripe.min_snr, found.stripe.select) == (4.0, "all")
    assert (found.calib.surface.known, found.calib.relabel_rounds) == (True, 3)


@pytest.mark.parametrize(
    ("text", "match"),
    [
        ("[detect]\nthreshhold = 5.0\n", "line 2.*did you mean"),
        ("[detect\n", "not valid TOML"),
        ("[detect]\nthreshold = nan\n", "line 2"),
        ("scp_initial = 1\n", "unknown key"),
        ("[tolerances.gap]\nmax = 1.0\n", "unknown key.*did you mean"),
        ("[tolerances.gap_mm]\nmin = 2.0\nmax = 1.0\n", "min 2 must not be above max 1"),
        ("[region]\nkeep = [[[0, 0], [1, 1]]]\n", "keep"),
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
