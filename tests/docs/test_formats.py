"""docs/formats.md names every key that a reader knows."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any, get_args

import numpy as np
import pytest
from pydantic import BaseModel

from calib import CalibConfig
from extraction import ExtractionConfig, GapFlushConfig, StripeConfig
from jig_cad.files import JigTable, LinesTable
from perceptron_emu import EmulatorConfig, SceneFile
from workbench.files import Truth
from workbench.files.board_file import BoardFile
from workbench.files.cell import CellFile
from workbench.files.robots.robot_file import RobotFile
from workbench.files.sensor_file import SensorFile
from workbench.files.tables.frames_csv import POSE_COLUMNS
from workbench.files.tables.points_csv import COLUMNS, SENSOR_COLUMNS
from workbench.validate import Thresholds

PAGE = (Path(__file__).parents[2] / "docs" / "formats.md").read_text(encoding="utf-8")
WORDS = set(re.findall(r"\w+", PAGE))
CELL = (CellFile, SensorFile, EmulatorConfig, JigTable, LinesTable, RobotFile, Truth)
SETTINGS = (ExtractionConfig, CalibConfig, StripeConfig, GapFlushConfig)
OTHERS = (SceneFile, Thresholds, BoardFile)


def models_within(annotation: Any) -> Iterator[type[BaseModel]]:
    """The models in an annotation."""
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        yield annotation
    for inner in get_args(annotation):
        yield from models_within(inner)


def keys(model: type[BaseModel]) -> Iterator[str]:
    """All keys of a file's model, those of its tables included."""
    for name, field in model.model_fields.items():
        yield name
        for inner in models_within(field.annotation):
            yield from keys(inner)


@pytest.mark.parametrize("model", [*CELL, *SETTINGS, *OTHERS], ids=lambda model: model.__name__)
def test_every_key_is_described(model: type[BaseModel]) -> None:
    assert not set(keys(model)) - WORDS


def test_every_column_is_described() -> None:
    assert {*POSE_COLUMNS, *COLUMNS, *SENSOR_COLUMNS} <= WORDS


def test_every_setting_and_column_of_a_campaign_is_described() -> None:
    pytest.importorskip("pyarrow")
    from workbench.campaign import Plan

    assert not set(keys(Plan)) - WORDS


def test_every_verdict_is_described() -> None:
    from calib.result import Code

    assert set(get_args(Code)) <= WORDS


def test_defaults_of_the_emulators_keys_are_those_of_the_page() -> None:
    """Where the page gives a number, a list of numbers, true or false; words are not compared."""
    told = 0
    page = (Path(__file__).parents[2] / "docs" / "formats.md").read_text(encoding="utf-8")
    config = EmulatorConfig()
    for section, row in re.findall(r"^\| `\[(\w+)\]` \|(.*)\|$", page, re.MULTILINE):
        part = getattr(config, section, None)
        for key, text in re.findall(r"`(\w+)` \(([^)`]*)\)", row):
            plain = text.replace(",", "") if re.fullmatch(r"\d{1,3}(,\d{3})+", text) else text
            if not hasattr(part, key) or not re.fullmatch(r"true|false|-?[\d.]+|\[[-\d., ]+\]", plain):
                continue
            default, said = getattr(part, key), json.loads(plain)
            assert np.all(np.asarray(default, dtype=float) == np.asarray(said, dtype=float)), (section, key)
            told += 1
    assert told >= 12
