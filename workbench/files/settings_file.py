"""Settings files: extraction's tables as `tune` saves them, and calibration's keys under [calib]."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from pydantic import BaseModel, Field, create_model

from calib import CalibConfig
from extraction import ExtractionConfig
from geometry import parse_toml, toml_value
from workbench.files.strict import FileSection, validate
from workbench.files.toml_text import TomlSource, read_toml


@dataclass(frozen=True)
class Settings:
    """What the two stages of the chain are told."""

    extraction: ExtractionConfig = field(default_factory=ExtractionConfig)
    calib: CalibConfig = field(default_factory=CalibConfig)


def settings_model() -> type[BaseModel]:
    """The strict model of a settings file: extraction's tables at its top and [calib] beside them."""
    tables: dict[str, Any] = {name: (f.annotation, f.get_default(call_default_factory=True)) for name, f in _tables()}
    return create_model(
        "SettingsFile", __base__=FileSection, calib=(CalibConfig, Field(default_factory=CalibConfig)), **tables
    )


def _tables() -> list[tuple[str, Any]]:
    return list(ExtractionConfig.model_fields.items())


def read_settings(paths: Sequence[Path], **calib: Any) -> Settings:
    """What extraction and calibration are told.

    Parameters
    ----------
    paths
        Settings files; a later one's tables stand over an earlier one's.
    **calib
        Keys of [calib] over all files; None leaves a key alone.

    Returns
    -------
    Settings
        Defaults where nothing is said.

    Raises
    ------
    InputError
        Naming file, line and key.

    """
    tables: dict[str, dict[str, Any]] = {}
    for path in paths:
        source = read_toml(path)
        validate(settings_model(), source)
        for name, table in source.data.items():
            if isinstance(table, dict):
                tables.setdefault(name, {}).update({k: v for k, v in table.items() if k != "name"})
    given = {k: v for k, v in calib.items() if v is not None}
    own = CalibConfig.model_validate({**tables.pop("calib", {}), **given})
    return Settings(ExtractionConfig.model_validate(tables), own)


def settings_text(settings: Settings) -> str:
    """The resolved settings as TOML; a key without a value is left out."""
    tables = {**settings.extraction.model_dump(), "calib": settings.calib.model_dump()}
    lines = ["# every parameter as it was used"]
    for name, table in tables.items():
        lines += _table(name, table)
    return "\n".join(lines) + "\n"


def settings_toml(config: BaseModel, carried: dict[str, Any] | None = None) -> str:
    """Extraction's parameters as TOML, defaults as well; ``carried``: [calib] of the file that is written over."""
    tables = config.model_dump(mode="json")
    if carried:
        tables |= {"calib": carried}
    lines = ["# extraction settings, written by `perceptron-emu tune`"]
    for name, table in tables.items():
        lines += ["", *_table(name, table)]
    return "\n".join(lines) + "\n"


def _table(name: str, table: dict[str, Any]) -> list[str]:
    """A table's lines, its inner tables behind its own keys; a key without a value is left out."""
    inner = {k: v for k, v in table.items() if isinstance(v, dict)}
    lines = [f"[{name}]"]
    lines += [f"{key} = {toml_value(v)}" for key, v in table.items() if v is not None and key not in inner]
    for key, value in inner.items():
        lines += ["", *_table(f"{name}.{key}", value)]
    return lines


def parse_settings(text: str, name: str) -> ExtractionConfig:
    """Extraction's parameters of a settings file's text; InputError names file, line and key."""
    data = parse_toml(text, name)
    validate(settings_model(), TomlSource(Path(name), text, data))
    tables = {k: v for k, v in data.items() if k in ExtractionConfig.model_fields}
    return ExtractionConfig.model_validate({k: _without_name(v) for k, v in tables.items()})


def carried_calib(text: str, name: str) -> dict[str, Any]:
    """The [calib] table of a settings file's text."""
    table = parse_toml(text, name).get("calib", {})
    return dict(table) if isinstance(table, dict) else {}


def _without_name(table: Any) -> Any:
    return {k: v for k, v in table.items() if k != "name"} if isinstance(table, dict) else table
