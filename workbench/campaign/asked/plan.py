"""The plan file of a campaign: factors, how they are sampled, repeats, what to run and what to keep."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, Field, ValidationError, model_validator

from geometry import InputError
from workbench.campaign.asked.named import check_named
from workbench.campaign.asked.settings import TrialSettings, leaf_paths, with_values
from workbench.files import FileSection, Real, Text, TomlSource, read_toml, sentence, suggestion, validate

RESULTS_VERSION = 5  # raised when rows or trials change, so that a half-done run of another version is not continued
MAX_TRIALS = 10_000_000  # a year of a hundred cores: more is a slip of the pen

Value = bool | Annotated[int, Field(strict=True)] | Real | Text


class Range(BaseModel):
    """A factor between two numbers; ``steps`` of them on a grid, ``log`` for equal ratios in place of equal steps."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False, defer_build=True)

    low: Real
    high: Real
    steps: Annotated[int, Field(strict=True, ge=2, le=10_000)] | None = None
    log: bool = False

    @model_validator(mode="after")
    def _ordered(self) -> Range:
        if self.high <= self.low:
            raise ValueError(f"high = {self.high:g} must be above low = {self.low:g}")
        if self.log and self.low <= 0:
            raise ValueError(f"low = {self.low:g} must be positive where log = true")
        return self


class Plan(FileSection):
    """What a campaign runs. ``factors`` maps a setting's dotted name to its values or range."""

    seed: Annotated[int, Field(strict=True, ge=0)] = 0
    run: Literal["extract", "pose", "calibrate"] = "calibrate"
    design: Literal["grid", "random", "latin_hypercube", "sobol"] = "grid"
    samples: Annotated[int, Field(strict=True, ge=1, le=MAX_TRIALS)] | None = None
    repeats: Annotated[int, Field(strict=True, ge=1, le=MAX_TRIALS)] = 1
    shard_trials: Annotated[int, Field(strict=True, ge=1, le=1000)] = 8
    keep_images: Annotated[float, Field(ge=0, le=1)] = 0.0
    base: TrialSettings = TrialSettings()
    factors: dict[str, Annotated[list[Value], Field(min_length=1)] | Range] = Field(default_factory=dict)

    @property
    def fingerprint(self) -> str:
        """Hash of everything that decides the results; comments and order of the file do not count."""
        resolved = {"version": RESULTS_VERSION, **self.model_dump(mode="json", exclude={"name"})}
        return hashlib.sha256(json.dumps(resolved, sort_keys=True).encode()).hexdigest()


def read_plan(path: Path) -> Plan:
    """Read and check the plan of a campaign.

    Parameters
    ----------
    path
        The file.

    Returns
    -------
    Plan
        Every factor names a setting, every value is one that the setting takes.

    Raises
    ------
    InputError
        Naming file, line and key.

    """
    source = read_toml(path)
    _check_factor_shapes(source)
    plan = validate(Plan, source)
    for name, factor in plan.factors.items():
        _check_factor(source, plan, name, factor)
    if plan.design == "grid" and plan.samples is not None:
        raise InputError(f"{source.where(('samples',))}: samples goes with a random design; a grid has its own size")
    if plan.design != "grid" and plan.samples is None:
        raise InputError(f'{path}: design = "{plan.design}" needs samples = the number of design points')
    check_named(plan, source)
    return plan


def plan_of(data: Mapping[str, Any]) -> Plan:
    """The plan of a resolved dictionary, as stored beside a run's results."""
    return Plan.model_validate(data)


def _check_factor_shapes(source: TomlSource) -> None:
    """Say of a factor's value what it must be before the union of the model speaks of all its members."""
    factors = source.data.get("factors", {})
    if not isinstance(factors, dict):
        raise InputError(f"{source.where(('factors',))}: factors must be a table of names and values")
    for name, value in factors.items():
        where = source.where(("factors", name))
        if isinstance(value, dict) and not {"low", "high"} & value.keys():
            raise InputError(
                f'{where}: write the factor\'s name in quotes, as in "jig.string_diameter_mm" = [0.2, 0.3]'
            )
        if isinstance(value, list) and not value:
            raise InputError(f"{where}: the factor {name} has no values, the grid would be empty")
        if not isinstance(value, dict | list):
            raise InputError(f"{where}: the factor {name} must be a list of values or {{ low = …, high = … }}")
        if isinstance(value, dict):
            try:
                Range.model_validate(value)
            except ValidationError as error:
                text = sentence(error, Range, source, {}).split(": ", 1)[-1]
                raise InputError(f"{where}: the factor {name}: {text}") from None


def _check_factor(source: TomlSource, plan: Plan, name: str, factor: list[Any] | Range) -> None:
    where = source.where(("factors", name))
    known = leaf_paths(TrialSettings)
    if name not in known:
        raise InputError(f"{where}: unknown factor {name}{suggestion(name, known)}")
    if isinstance(factor, Range):
        if plan.design == "grid" and factor.steps is None:
            raise InputError(f"{where}: on a grid the range of {name} needs steps = the number of values")
        if plan.design != "grid" and factor.steps is not None:
            raise InputError(f"{where}: steps goes with a grid, not with design = {plan.design!r}")
    for value in [factor.low, factor.high] if isinstance(factor, Range) else factor:
        try:
            with_values(plan.base, {name: value})
        except InputError as error:
            raise InputError(f"{where}: {error}") from None
