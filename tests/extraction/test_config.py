"""The settings refuse what is no number, and every reason has its words."""

from __future__ import annotations

from collections.abc import Iterator

import pytest
from pydantic import BaseModel, ValidationError

from extraction import ExtractionConfig, GapFlushConfig, Reason, Seen, StripeConfig, explain
from extraction.reasons import MEANINGS
from tests.pinned import pinned

CONFIGS = (ExtractionConfig, StripeConfig, GapFlushConfig)
SEEN = Seen(height_dn=12.0, noise_dn=1.5, length_px=30.0, width_px=9.0, mm_per_px=0.15, score=0.01)


def numbers(model: type[BaseModel], path: tuple[str, ...] = ()) -> Iterator[tuple[str, ...]]:
    """Paths of all settings that are real numbers."""
    for name, field in model.model_fields.items():
        inner = field.annotation
        if isinstance(inner, type) and issubclass(inner, BaseModel):
            yield from numbers(inner, (*path, name))
        elif "float" in str(inner):
            yield (*path, name)


@pytest.mark.parametrize("value", [float("nan"), float("inf"), float("-inf")])
@pytest.mark.parametrize("model", CONFIGS, ids=lambda m: m.__name__)
def test_no_setting_is_infinite_or_no_number(model: type[BaseModel], value: float) -> None:
    paths = list(numbers(model))
    assert len(paths) >= 8
    for path in paths:
        table: object = value
        for name in reversed(path):
            table = {name: table}
        with pytest.raises(ValidationError) as refused:
            model.model_validate(table)
        pinned(str(refused.value))


@pytest.mark.parametrize("reason", Reason)
def test_a_reason_has_a_sentence_and_names_a_setting_that_there_is(reason: Reason) -> None:
    sentence, key = explain(reason, SEEN, ExtractionConfig())
    assert len(sentence) > 20
    assert "{" not in sentence
    if key:
        table, name = key.split(".")
        assert hasattr(getattr(ExtractionConfig(), table), name)


def test_the_sentence_holds_the_limit_that_decided() -> None:
    """The number is the setting's own, whatever it is."""
    config = ExtractionConfig.model_validate({"doubt": {"max_move_sigma": 2.25}, "localise": {"max_spots": 7}})
    assert "2.25 spot widths" in explain("fit_wandered", SEEN, config)[0]
    assert "7 best spots" in explain("beyond_max_spots", SEEN, config)[0]
    assert explain("too_long", SEEN, config) == (
        "30 px long, at most 26.7 px are a string's spot here: a stripe piece or a reflection",
        "detect.max_length_mm",
    )


def test_every_reason_has_a_meaning_and_no_other_word_one() -> None:
    assert set(MEANINGS) == set(Reason)
    with pytest.raises(ValueError, match="no_reason") as refused:
        explain("no_reason", SEEN, ExtractionConfig())
    pinned(str(refused.value))
