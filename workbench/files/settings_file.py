"""Settings files, the recipe of all tools: how an image is looked at, what is measured in it, how it is calibrated.

One file serves every command: each takes the tables of the tools that it runs, and all tables are checked.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal

from pydantic import BaseModel, ConfigDict, Field, create_model, model_validator

from calib import CalibConfig
from extraction import ExtractionConfig, FeatureConfig, GapFlushConfig, StripeConfig
from geometry import parse_toml, toml_value
from workbench.files.strict import FileSection, Positive, Real, validate
from workbench.files.toml_text import TomlSource, read_toml

What = Literal["strings", "stripe"]
FeatureKind = Literal["none", "sphere", "plane", "edge", "wedge"]


class _Section(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)


class MeasureConfig(_Section):
    """What is measured in a profile beside its points."""

    feature: FeatureKind = Field(default="none", description="what is looked for in the profile")
    diameter_mm: Positive | None = Field(default=None, description="the ball's diameter; estimated if absent [mm]")
    gap_and_flush: bool = Field(default=False, description="whether two panels' gap and flush are measured")


class Tolerance(_Section):
    """What a value may be."""

    min: Real | None = None
    max: Real | None = None

    @model_validator(mode="after")
    def _is_a_range(self) -> Tolerance:
        if self.min is None and self.max is None:
            raise ValueError("needs min, max or both")
        if self.min is not None and self.max is not None and self.min > self.max:
            raise ValueError(f"min {self.min:g} must not be above max {self.max:g}")
        return self

    def holds(self, value: float | None) -> bool:
        """Whether a value lies within; what was not measured does not."""
        if value is None or value != value:
            return False
        return (self.min is None or value >= self.min) and (self.max is None or value <= self.max)


class ToleranceConfig(_Section):
    """What the measured values may be; those without a tolerance are not judged."""

    clipped_px: Tolerance | None = Field(default=None, description="clipped pixels in the image")
    strings: Tolerance | None = Field(default=None, description="strings that were found and named")
    sigma_mm: Tolerance | None = Field(default=None, description="largest σ of a spot, median σ of a stripe's points")
    points: Tolerance | None = Field(default=None, description="points of the stripe")
    flagged: Tolerance | None = Field(default=None, description="points of the stripe in doubt")
    radius_mm: Tolerance | None = Field(default=None, description="radius of a ball's section")
    scatter_mm: Tolerance | None = Field(default=None, description="scatter of the feature's points about it")
    angle_deg: Tolerance | None = Field(default=None, description="slope of a line, angle between a wedge's faces")
    gap_mm: Tolerance | None = Field(default=None, description="gap of two panels")
    flush_mm: Tolerance | None = Field(default=None, description="flush of two panels")
    left_out_rms_mm: Tolerance | None = Field(default=None, description="point rms of what calibration left out")

    @property
    def given(self) -> dict[str, Tolerance]:
        """The tolerances that there are, by value."""
        return {name: value for name in type(self).model_fields if (value := getattr(self, name)) is not None}


class Recipe(ExtractionConfig):
    """All tools' settings, in the order in which they work on an image. what: None is told from the data."""

    what: What | None = Field(default=None, description="strings where a jig is known, else the stripe")
    stripe: StripeConfig = StripeConfig()
    measure: MeasureConfig = MeasureConfig()
    feature: FeatureConfig = FeatureConfig()
    gapflush: GapFlushConfig = GapFlushConfig()
    calib: CalibConfig = CalibConfig()
    tolerances: ToleranceConfig = ToleranceConfig()


@dataclass(frozen=True)
class Settings:
    """What the stages of the chain are told."""

    extraction: ExtractionConfig = field(default_factory=ExtractionConfig)
    calib: CalibConfig = field(default_factory=CalibConfig)
    stripe: StripeConfig = field(default_factory=StripeConfig)
    feature: FeatureConfig = field(default_factory=FeatureConfig)
    gapflush: GapFlushConfig = field(default_factory=GapFlushConfig)
    measure: MeasureConfig = field(default_factory=MeasureConfig)
    tolerances: ToleranceConfig = field(default_factory=ToleranceConfig)
    what: What | None = None

    @classmethod
    def of(cls, recipe: Recipe) -> Settings:
        """The settings that a recipe holds."""
        spots = {name: getattr(recipe, name) for name in ExtractionConfig.model_fields}
        own = {name: getattr(recipe, name) for name in Recipe.model_fields if name not in spots}
        return cls(extraction=ExtractionConfig(**spots), **own)

    @property
    def recipe(self) -> Recipe:
        """The settings as one recipe."""
        spots = {name: getattr(self.extraction, name) for name in ExtractionConfig.model_fields}
        own = {name: getattr(self, name) for name in Recipe.model_fields if name not in spots}
        return Recipe(**spots, **own)


def settings_model() -> type[BaseModel]:
    """The strict model of a settings file: a recipe's tables, each of which may have a ``name``."""
    fields: dict[str, Any] = {
        name: (f.annotation, f.get_default(call_default_factory=True)) for name, f in Recipe.model_fields.items()
    }
    return create_model("SettingsFile", __base__=FileSection, **fields)


def read_settings(paths: Sequence[Path], **calib: Any) -> Settings:
    """What the stages of the chain are told.

    Parameters
    ----------
    paths
        Settings files; a later one's keys stand over an earlier one's.
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
    tables: dict[str, Any] = {}
    for path in paths:
        source = read_toml(path)
        validate(settings_model(), source)
        tables = _over(tables, _without_names(source.data))
    given = {k: v for k, v in calib.items() if v is not None}
    if given:
        tables = _over(tables, {"calib": given})
    return Settings.of(Recipe.model_validate(tables))


def _over(lower: Mapping[str, Any], upper: Mapping[str, Any]) -> dict[str, Any]:
    """The tables of ``lower`` with the keys of ``upper`` in place of theirs."""
    out = dict(lower)
    for key, value in upper.items():
        below = out.get(key)
        out[key] = _over(below, value) if isinstance(below, dict) and isinstance(value, dict) else value
    return out


def settings_text(settings: Settings) -> str:
    """The resolved settings as TOML; a key without a value is left out."""
    return _text(settings.recipe, "every parameter as it was used")


def settings_toml(config: BaseModel) -> str:
    """Parameters as TOML, defaults as well."""
    return _text(config, "a recipe, written by `perceptron-emu tune`")


def _text(config: BaseModel, about: str) -> str:
    data = config.model_dump(mode="json")
    lines = [f"# {about}"]
    lines += [f"{k} = {toml_value(v)}" for k, v in data.items() if v is not None and not isinstance(v, dict)]
    for name, table in data.items():
        if isinstance(table, dict):
            lines += _table(name, table)
    return "\n".join(lines) + "\n"


def _table(name: str, table: dict[str, Any]) -> list[str]:
    """A table's lines, its inner tables behind its own keys; a key without a value is left out, an empty table too."""
    inner = {k: v for k, v in table.items() if isinstance(v, dict)}
    own = [f"{key} = {toml_value(v)}" for key, v in table.items() if v is not None and key not in inner]
    lines = ["", f"[{name}]", *own] if own else []
    for key, value in inner.items():
        lines += _table(f"{name}.{key}", value)
    return lines


def parse_settings(text: str, name: str) -> Recipe:
    """The recipe of a settings file's text; InputError names file, line and key."""
    data = parse_toml(text, name)
    validate(settings_model(), TomlSource(Path(name), text, data))
    return Recipe.model_validate(_without_names(data))


def _without_names(data: Mapping[str, Any]) -> dict[str, Any]:
    """The tables without the ``name`` that each may have."""
    tables = {k: v for k, v in data.items() if k != "name"}
    return {k: {i: w for i, w in v.items() if i != "name"} if isinstance(v, dict) else v for k, v in tables.items()}
