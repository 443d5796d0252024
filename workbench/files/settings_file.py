"""Settings files: extraction's tables as `tune` saves them, and calibration's keys under [calib]."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from pydantic import BaseModel, Field, create_model

from calib import CalibConfig
from extraction import ExtractionConfig
from workbench.files.sensor_file import toml_value
from workbench.files.strict import Section, validate
from workbench.files.toml_text import read_toml


@dataclass(frozen=True)
class Settings:
    """What the two stages of the chain are told."""

    extraction: ExtractionConfig = field(default_factory=ExtractionConfig)
    calib: CalibConfig = field(default_factory=CalibConfig)


def settings_model() -> type[BaseModel]:
    """The strict model of a settings file: extraction's tables at its top and [calib] beside them."""
    tables: dict[str, Any] = {name: (f.annotation, f.get_default(call_default_factory=True)) for name, f in _tables()}
    return create_model(
        "SettingsFile", __base__=Section, calib=(CalibConfig, Field(default_factory=CalibConfig)), **tables
    )


def _tables() -> list[tuple[str, Any]]:
    return list(ExtractionConfig.model_fields.items())


def read_settings(paths: Sequence[Path], **calib: Any) -> Settings:
    """Settings of files, later ones over earlier, and of ``calib`` keys over all; None leaves a key alone."""
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
    lines = ["# every parameter as it was used"]
    for name, table in {**settings.extraction.model_dump(), "calib": settings.calib.model_dump()}.items():
        lines.append(f"[{name}]")
        lines += [f"{key} = {toml_value(value)}" for key, value in table.items() if value is not None]
    return "\n".join(lines) + "\n"
