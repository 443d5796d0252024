"""The panel is made of the configuration model's schema; wrong parameters are named by key."""

from __future__ import annotations

import hashlib
from typing import Literal

import pytest
from pydantic import BaseModel, Field

from extraction import ExtractionConfig
from geometry import InputError
from workbench.files import Recipe
from workbench.opened import panel
from workbench.opened.sliders import FILE_ONLY, SLIDERS
from workbench.window.parameters import ParameterError, parse


class Inner(BaseModel):
    """A section."""

    width_px: float = Field(2.0, gt=0, le=10, description="how wide [px]")
    gain_dn_per_e: float | None = Field(None, ge=0)
    kind: Literal["a", "b"] = "a"
    on: bool = True
    count: int = Field(3, ge=1, le=9)


class Model(BaseModel):
    """A configuration."""

    inner: Inner = Inner()


def control(key: str) -> dict[str, object]:
    return next(p for g in panel(Model) for p in g["parameters"] if p["key"] == key)


def test_sections_become_groups() -> None:
    assert [g["title"] for g in panel(Model)] == ["Inner"]


def test_a_number_has_range_unit_help_and_default() -> None:
    found = control("inner.width_px")
    assert (found["min"], found["max"], found["unit"], found["help"]) == (0, 10, "px", "how wide")
    assert (found["title"], found["default"], found["level"]) == ("Width", 2.0, "basic")


def test_other_kinds() -> None:
    assert control("inner.kind")["choices"] == ["a", "b"]
    assert control("inner.on")["kind"] == "boolean"
    assert control("inner.count")["kind"] == "integer"
    gain = control("inner.gain_dn_per_e")
    assert (gain["nullable"], gain["unit"], gain["title"], gain["level"]) == (True, "DN/e⁻", "Gain", "basic")


def test_every_parameter_of_the_recipe_can_be_shown() -> None:
    """Each has help and a title; numbers a range that holds the default; the basic ones are few."""
    controls = [p for g in panel(Recipe) for p in g["parameters"]]
    every = set(keys(Recipe().model_dump()))
    assert {p["key"] for p in controls} == {k for k in every if not {k, k.split(".")[0]} & set(FILE_ONLY)}
    assert set(SLIDERS) == {p["key"] for p in controls}
    for p in controls:
        assert p["help"], p["key"]
        assert p["title"], p["key"]
        if p["kind"] in ("number", "integer"):
            assert p["min"] < p["max"], p["key"]
            assert p["default"] is None or p["min"] <= p["default"] <= p["max"], p["key"]
    assert 4 <= sum(p["level"] == "basic" for p in controls) <= len(controls) / 2


def test_tables_of_the_file_alone_are_those_of_the_model() -> None:
    assert {key.split(".")[0] for key in FILE_ONLY} <= set(Recipe.model_fields)


def test_a_slider_is_narrower_than_the_model() -> None:
    """Its ends are settings that the model takes; that they are useful ones is not proved."""
    for key, slider in SLIDERS.items():
        for end in (slider.low, slider.high):
            if end is not None:
                table, name = key.split(".")
                given: dict[str, object] = {name: end}
                if key == "stripe.max_width_px":
                    given["min_width_px"] = 0.2
                if key == "stripe.min_width_px":
                    given["max_width_px"] = 40
                Recipe.model_validate({table: given})


def keys(table: dict[str, object], prefix: str = "") -> list[str]:
    out = []
    for key, value in table.items():
        out += keys(value, f"{prefix}{key}.") if isinstance(value, dict) else [prefix + key]
    return out


def test_the_hash_is_that_of_the_text() -> None:
    text = ExtractionConfig().model_dump_json()
    found = parse(ExtractionConfig, text)
    assert found.hash == hashlib.sha256(text.encode()).hexdigest()[:16]
    assert found.model == ExtractionConfig()


@pytest.mark.parametrize(
    ("text", "key"),
    [
        ('{"detect": {"threshold": -1}}', "detect.threshold"),
        ('{"detect": {"treshold": 5}}', "detect.treshold"),
        ('{"detect": {"threshold": NaN}}', "detect.threshold"),
        ('{"detect": {"max_length_mm": Infinity}}', "detect.max_length_mm"),
        ('{"detect": {"threshold": "high"}}', "detect.threshold"),
        ('{"localise": {"method": "magic"}}', "localise.method"),
        ("nonsense", "parameters"),
        ("[]", "parameters"),
    ],
)
def test_wrong_parameters_are_named(text: str, key: str) -> None:
    with pytest.raises(ParameterError) as caught:
        parse(ExtractionConfig, text)
    assert key in caught.value.problems


def test_too_much_text_is_refused() -> None:
    with pytest.raises(InputError, match="too long"):
        parse(ExtractionConfig, " " * 100_000)
