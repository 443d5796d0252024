"""No setting of any room takes a number that is infinite or none."""

from __future__ import annotations

import importlib
import pkgutil
from collections.abc import Iterator
from typing import Any, get_args

import pytest
from pydantic import BaseModel, TypeAdapter, ValidationError

from tests.workbench.helpers import Cli

ROOMS = ("jig_cad", "perceptron_emu", "extraction", "calib", "workbench")
NOT_HERE = ("workbench.window.app", "workbench.window.serve", "workbench.__main__")  # need an extra, or run


def models() -> Iterator[type[BaseModel]]:
    """Every pydantic model of the packages."""
    for room in ROOMS:
        for module in pkgutil.walk_packages(importlib.import_module(room).__path__, f"{room}."):
            if module.name.endswith("__main__") or ".gl" in module.name or module.name in NOT_HERE:
                continue
            for value in vars(importlib.import_module(module.name)).values():
                if isinstance(value, type) and issubclass(value, BaseModel) and value.__module__ == module.name:
                    yield value


def takes_a_float(annotation: Any) -> bool:
    return annotation is float or any(takes_a_float(inner) for inner in get_args(annotation))


def wrapped(value: float) -> Iterator[Any]:
    """The value itself, and in lists of the lengths and depths that file models have."""
    yield value
    for n in (2, 3, 4, 6):
        yield [value] * n
        yield [[value] * n] * n
    yield {"X": value}
    yield {"X": [value] * 3}
    yield [value, [value]]


FIELDS = [
    pytest.param(model, name, id=f"{model.__module__}.{model.__name__}.{name}")
    for model in dict.fromkeys(models())
    for name, field in model.model_fields.items()
    if takes_a_float(field.annotation)
]


def test_there_are_models_to_look_at() -> None:
    assert len(FIELDS) > 150


@pytest.mark.parametrize(("model", "name"), FIELDS)
def test_a_setting_is_finite(model: type[BaseModel], name: str) -> None:
    """The field alone is validated, as the model's configuration and its own constraints say."""
    field = model.model_fields[name]
    adapter: TypeAdapter[Any] = TypeAdapter(field.rebuild_annotation(), config=model.model_config)
    for value in (float("inf"), float("-inf"), float("nan")):
        for given in wrapped(value):
            with pytest.raises(ValidationError):
                adapter.validate_python(given)


@pytest.mark.parametrize(
    "arguments",
    [
        ("plan", "cell.toml", "--tilt-deg", "nan"),
        ("plan", "cell.toml", "--mounting-deg", "nan"),
        ("render", "cell.toml", "--out", "x", "--mounting-mm", "nan"),
        ("report", "run", "--target-mm", "nan"),
        ("report", "run", "--target-mm", "inf"),
        ("report", "run", "--level", "nan"),
        ("closure", "a.csv", "--robot", "franka_panda", "--distance-mm", "inf"),
    ],
)
def test_an_option_is_finite(cli: Cli, arguments: tuple[str, ...]) -> None:
    result = cli(*arguments)
    assert result.code == 2
    assert "Invalid value" in result.err
