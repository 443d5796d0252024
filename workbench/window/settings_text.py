"""Parameters as the text of a settings file, the one that extract, validate and calibrate take."""

from __future__ import annotations

import json
import tomllib
from pathlib import Path
from typing import Any

from pydantic import BaseModel

from extraction import ExtractionConfig
from geometry import InputError
from workbench.files.settings_file import settings_model
from workbench.files.strict import validate
from workbench.files.toml_text import TomlSource


def settings_toml(config: BaseModel, carried: dict[str, Any] | None = None) -> str:
    """All parameters as TOML, default values as well; ``carried``: [calib] of the file that is written over."""
    tables = config.model_dump(mode="json")
    if carried:
        tables |= {"calib": carried}
    lines = ["# extraction settings, written by `perceptron-emu tune`"]
    for name, table in tables.items():
        lines += _table(name, table)
    return "\n".join(lines) + "\n"


def _table(name: str, table: dict[str, Any]) -> list[str]:
    inner = {k: v for k, v in table.items() if isinstance(v, dict)}
    lines = ["", f"[{name}]"]
    lines += [f"{key} = {_value(v)}" for key, v in table.items() if v is not None and key not in inner]
    for key, value in inner.items():
        lines += _table(f"{name}.{key}", value)
    return lines


def _value(value: Any) -> str:
    """A TOML value; JSON's spelling is TOML's for text, numbers, booleans and lists of them."""
    return json.dumps(value, ensure_ascii=False, allow_nan=False)


def parse_settings(text: str, name: str) -> ExtractionConfig:
    """Extraction's parameters of a settings file's text; InputError names file, line and key."""
    data = _data(text, name)
    source = TomlSource(Path(name), text, data)
    validate(settings_model(), source)
    tables = {k: v for k, v in data.items() if k in ExtractionConfig.model_fields}
    return ExtractionConfig.model_validate({k: _without_name(v) for k, v in tables.items()})


def carried_calib(text: str, name: str) -> dict[str, Any]:
    """The [calib] table of a settings file's text."""
    table = _data(text, name).get("calib", {})
    return dict(table) if isinstance(table, dict) else {}


def _data(text: str, name: str) -> dict[str, Any]:
    try:
        return tomllib.loads(text)
    except (tomllib.TOMLDecodeError, RecursionError) as error:
        raise InputError(f"{name}: not valid TOML, {error}") from None


def _without_name(table: Any) -> Any:
    return {k: v for k, v in table.items() if k != "name"} if isinstance(table, dict) else table
