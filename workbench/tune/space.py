"""The search space: what the window's sliders may search, over their ranges."""

from __future__ import annotations

import copy
from dataclasses import dataclass
from typing import Any, Protocol, TypeVar

from pydantic import BaseModel

from workbench.opened import panel

M = TypeVar("M", bound=BaseModel)


@dataclass(frozen=True)
class Dimension:
    """One parameter that the search may move."""

    key: str
    kind: str  # "number" or "integer"
    low: float
    high: float
    log: bool


class Suggests(Protocol):
    """A trial, as far as the space needs it."""

    def suggest_float(self, name: str, low: float, high: float, *, log: bool = False) -> float:
        """A number between ``low`` and ``high``."""
        ...

    def suggest_int(self, name: str, low: int, high: int, *, log: bool = False) -> int:
        """A whole number between ``low`` and ``high``."""
        ...


def space(model: type[BaseModel]) -> tuple[Dimension, ...]:
    """Every parameter of the model whose slider the search may move, over its range."""
    controls = [p for group in panel(model) for p in group["parameters"]]
    return tuple(
        Dimension(p["key"], p["kind"], p["min"], p["max"], p["log"])
        for p in controls
        if p["search"] and p["kind"] in ("number", "integer")
    )


def suggest(trial: Suggests, dimensions: tuple[Dimension, ...], base: M) -> M:
    """``base`` with every dimension as the trial suggests it."""
    values: dict[str, float] = {}
    for d in dimensions:
        if d.kind == "integer":
            values[d.key] = trial.suggest_int(d.key, int(d.low), int(d.high), log=d.log)
        else:
            values[d.key] = trial.suggest_float(d.key, d.low, d.high, log=d.log)
    return with_values(base, steady(values))


def steady(values: dict[str, float]) -> dict[str, float]:
    """The values to nine digits: what a sampler draws hangs on the processor beyond them."""
    return {key: float(f"{v:.9g}") if isinstance(v, float) else v for key, v in values.items()}


def values_of(config: BaseModel, dimensions: tuple[Dimension, ...]) -> dict[str, float]:
    """Where ``config`` stands in the space, clipped to it."""
    table = config.model_dump()
    out = {}
    for d in dimensions:
        here: Any = table
        for part in d.key.split("."):
            here = here[part]
        clipped = min(max(float(here), d.low), d.high)
        out[d.key] = round(clipped) if d.kind == "integer" else clipped
    return out


def with_values(base: M, values: dict[str, float]) -> M:
    """``base`` with some parameters replaced, checked by the model."""
    table = copy.deepcopy(base.model_dump())
    for key, value in values.items():
        *path, last = key.split(".")
        here: Any = table
        for part in path:
            here = here[part]
        here[last] = value
    return type(base).model_validate(table)
