"""jig.toml (docs/formats.md): read, validated, written."""

from __future__ import annotations

import os
import tempfile
import tomllib
from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, ValidationError

from geometry import InputError, did_you_mean
from jig_cad.jig import Jig
from jig_cad.pillar import ANCHORS, DEFAULT_STRINGS, STRINGS

Finite = Annotated[float, Field(allow_inf_nan=False)]
Point = Annotated[list[Finite], Field(min_length=3, max_length=3)]


class AnchorsTable(BaseModel):
    """[anchors_mm]: points [x, y, z] as measured in {J}; b is the bottom plate, t the top plate."""

    model_config = ConfigDict(extra="forbid", strict=True)

    name: str = ""
    Ab: Point | None = None
    At: Point | None = None
    Bb: Point | None = None
    Bt: Point | None = None
    Cb: Point | None = None
    Ct: Point | None = None


class JigTable(BaseModel):
    """The keys of jig.toml; the sizes' ranges are checked by Jig."""

    model_config = ConfigDict(extra="forbid", strict=True)

    name: str = ""
    side_mm: Finite
    height_mm: Finite
    string_diameter_mm: Finite
    tolerance_mm: Finite
    strings: list[str] = list(DEFAULT_STRINGS)
    anchors_mm: AnchorsTable | None = None


def read_jig(path: str | os.PathLike[str]) -> Jig:
    """The jig of a TOML file; InputError names the file and the key that is wrong."""
    where = Path(path)
    try:
        table = tomllib.loads(where.read_text(encoding="utf-8"))
    except OSError as error:
        raise InputError(f"{where}: can not be read ({error.strerror}); a jig.toml is needed") from error
    except UnicodeDecodeError as error:
        raise InputError(f"{where}: is not UTF-8 text, as TOML must be") from error
    except tomllib.TOMLDecodeError as error:
        raise InputError(f"{where}: is not valid TOML: {error}") from error
    return jig_from_table(table, str(where))


def jig_from_table(table: dict[str, Any], where: str = "jig.toml") -> Jig:
    """The jig of a parsed TOML table; ``where`` (the file's name) stands in every error."""
    try:
        keys = JigTable.model_validate(table)
    except ValidationError as error:
        raise InputError(f"{where}: {_explain(error)}") from error
    try:
        jig = Jig.nominal(
            keys.side_mm, keys.height_mm, keys.string_diameter_mm, keys.tolerance_mm, keys.strings, keys.name
        )
        if keys.anchors_mm is None:
            return jig
        return replace(jig, anchors_mm=_measured(jig.anchors_mm, keys.anchors_mm, keys.strings), measured=True)
    except InputError as error:
        raise InputError(f"{where}: {error}") from error


def jig_text(jig: Jig) -> str:
    """The jig as the text of a jig.toml; read back it is the same jig to the last bit."""
    keys = ("side_mm", "height_mm", "string_diameter_mm", "tolerance_mm")
    lines = ["# string jig; frame {J}: origin at the bottom hole of string A, x up the pillar, z into it"]
    lines += [f"name = {_quoted(jig.name)}"] if jig.name else []
    lines += [f"{key} = {float(getattr(jig, key))!r}" for key in keys]
    lines += [f"strings = [{', '.join(_quoted(s) for s in jig.strings)}]"]
    if jig.measured:
        lines += ["[anchors_mm] # b: bottom plate, t: top plate; [x, y, z] in {J}"]
        lines += [f"{a} = {[float(v) for v in p]}" for a, p in zip(ANCHORS, jig.anchors_mm, strict=True)]
    return "\n".join(lines) + "\n"


def write_jig(jig: Jig, path: str | os.PathLike[str]) -> None:
    """Write a jig.toml, whole or not at all."""
    write_atomic(path, jig_text(jig).encode())


def write_atomic(path: str | os.PathLike[str], data: bytes) -> None:
    """Write a file whole or not at all: beside it first, then renamed over it."""
    goal = Path(path)
    try:
        with tempfile.NamedTemporaryFile(dir=goal.parent, prefix=f".{goal.name}.", delete=False) as part:
            part.write(data)
        Path(part.name).chmod(0o644)
        Path(part.name).replace(goal)
    except OSError as error:
        raise InputError(f"{goal}: can not be written ({error.strerror})") from error


def _measured(anchors: np.ndarray[Any, np.dtype[np.float64]], table: AnchorsTable, strings: list[str]) -> Any:
    out = anchors.copy()
    used = {anchor for label in strings if label in STRINGS for anchor in STRINGS[label]}
    for i, anchor in enumerate(ANCHORS):
        point = getattr(table, anchor)
        if point is not None:
            out[i] = point
        elif anchor in used:
            raise InputError(f"[anchors_mm] lacks {anchor}, an end of a string: give [x, y, z] in mm for it")
    return out


def _explain(error: ValidationError) -> str:
    """The first fault of a validation in one sentence, with the key's name."""
    faults = error.errors()
    first = next((f for f in faults if f["type"] == "extra_forbidden"), faults[0])
    key = ".".join(str(part) for part in first["loc"])
    if first["type"] == "extra_forbidden":
        known = AnchorsTable.model_fields if len(first["loc"]) > 1 else JigTable.model_fields
        near = did_you_mean(str(first["loc"][-1]), known)
        return f'unknown key "{key}"{near or "; known are " + ", ".join(known)}'
    if first["type"] == "missing":
        return f'the key "{key}" is missing'
    return f'"{key}" = {first["input"]!r}: {first["msg"][0].lower() + first["msg"][1:]}'


def _quoted(text: str) -> str:
    """A TOML basic string."""
    escaped = text.replace("\\", "\\\\").replace('"', '\\"')
    return '"' + "".join(c if c.isprintable() else f"\\U{ord(c):08x}" for c in escaped) + '"'
