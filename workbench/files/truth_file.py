"""truth.json (docs/formats.md): what an emulated recording knows of itself."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from pydantic import Field, ValidationError

from geometry import InputError, read_text, rounded
from workbench.files.atomic import write_text
from workbench.files.strict import FileSection, Matrix4, Real, Text, Vector3, Whole

Pair = tuple[Real, Real]


class TruthPoint(FileSection):
    """One string of one frame: axis and lit-surface point, ideal image centroid, visible fraction."""

    label: Text
    axis_mm: Pair | None
    surface_mm: Pair | None
    image_px: Pair | None
    visible_fraction: Real


class TruthFrame(FileSection):
    """One frame: the jig's pose in {P} and its strings."""

    frame: Whole
    T_sensor_jig: Matrix4
    points: tuple[TruthPoint, ...]


class Truth(FileSection):
    """The whole truth of a dataset; dh lists the true table, locations the jigs' poses in the base."""

    T_hand_sensor: Matrix4
    dh: Any = None
    anchors_mm: dict[str, Vector3] = Field(default_factory=dict)
    locations: dict[str, Any] = Field(default_factory=dict)
    frames: tuple[TruthFrame, ...] = ()


def read_truth(path: Path) -> Truth:
    """The truth of a dataset; InputError names the file and the key."""
    try:
        data = json.loads(read_text(path), parse_constant=_no_constant)
    except json.JSONDecodeError as error:
        raise InputError(f"{path}, line {error.lineno}: not valid JSON, {error.msg}") from None
    except (ValueError, RecursionError) as error:
        raise InputError(f"{path}: not valid JSON, {error}") from None
    try:
        return Truth.model_validate(data)
    except ValidationError as error:
        first = error.errors()[0]
        key = " → ".join(str(part) for part in first["loc"])
        raise InputError(f"{path}: {key or 'the file'}: {first['msg']}") from None


def write_truth(path: Path, truth: Truth) -> None:
    """Write a truth.json atomically, its numbers rounded so that every processor writes the same."""
    data = truth.model_dump(exclude={"frames": {"__all__": {"name": True, "points": {"__all__": {"name"}}}}})
    data["locations"] = {name: rounded(pose, "T_base_jig") for name, pose in data["locations"].items()}
    write_text(path, json.dumps(rounded(data), indent=1, allow_nan=False) + "\n")


def _no_constant(name: str) -> float:
    raise ValueError(f"{name} is not a JSON number")
