"""jig.toml, and target.toml of kind "strings" (docs/formats.md): read, validated, written."""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, ConfigDict, Field, ValidationError

from geometry import InputError, did_you_mean, parse_toml, read_text, toml_value, write_text
from jig_cad.jig import Jig
from jig_cad.pillar import ANCHORS, DEFAULT_STRINGS, STRINGS

Array = NDArray[np.float64]
Finite = Annotated[float, Field(allow_inf_nan=False)]
Point = Annotated[list[Finite], Field(min_length=3, max_length=3)]
Ends = Annotated[list[str], Field(min_length=2, max_length=2)]

KINDS = ("strings", "sphere", "balls", "plane", "edge", "wedge")  # of targets, as target.toml calls them


class AnchorsTable(BaseModel):
    """[anchors_mm]: points [x, y, z] as measured in {J}; b is the bottom plate, t the top plate."""

    model_config = ConfigDict(extra="forbid", strict=True)

    Ab: Point | None = None
    At: Point | None = None
    Bb: Point | None = None
    Bt: Point | None = None
    Cb: Point | None = None
    Ct: Point | None = None


class JigTable(BaseModel):
    """The keys of the pillar's jig.toml; the sizes' ranges are checked by Jig. kind: a target.toml says it."""

    model_config = ConfigDict(extra="forbid", strict=True)

    kind: Literal["strings"] = "strings"
    name: str = ""
    side_mm: Finite
    height_mm: Finite
    string_diameter_mm: Finite
    tolerance_mm: Finite
    strings: list[str] = list(DEFAULT_STRINGS)
    anchors_mm: AnchorsTable | None = None


class LinesTable(BaseModel):
    """The keys where [strings] is a table NAME = ["FROM", "TO"]: any lines between any named anchors.

    side_mm, height_mm: of a pillar whose anchors Ab … Ct are there beside those of [anchors_mm]. measured: whether the
    anchors were measured, so that no tolerance is left.
    """

    model_config = ConfigDict(extra="forbid", strict=True)

    kind: Literal["strings"] = "strings"
    name: str = ""
    side_mm: Finite | None = None
    height_mm: Finite | None = None
    string_diameter_mm: Finite
    tolerance_mm: Finite
    measured: bool = False
    anchors_mm: dict[str, Point] = Field(default_factory=dict)
    strings: dict[str, Ends]


def read_jig(path: str | os.PathLike[str]) -> Jig:
    """The jig of a TOML file.

    Parameters
    ----------
    path : str or path
        A jig.toml, or a target.toml of kind "strings".

    Returns
    -------
    Jig

    Raises
    ------
    InputError
        Naming the file and the key that is wrong.
    """
    where = Path(path)
    table = parse_toml(read_text(where), str(where))
    return jig_from_table(table, str(where))


def jig_from_table(table: Mapping[str, Any], where: str = "jig.toml") -> Jig:
    """The jig of a parsed TOML table.

    Parameters
    ----------
    table : mapping
        As of `tomllib`.
    where : str
        The file's name, which stands in every error.

    Returns
    -------
    Jig

    Raises
    ------
    InputError
        Naming ``where`` and the key that is wrong.
    """
    table = without_names(table)
    model = table_model(table, where)
    try:
        keys = model.model_validate(table)
    except ValidationError as error:
        raise InputError(f"{where}: {_explain(error, model)}") from error
    try:
        return _pillar(keys) if isinstance(keys, JigTable) else _lines(keys)
    except InputError as error:
        raise InputError(f"{where}: {error}") from error


def table_model(table: Mapping[str, Any], where: str) -> type[JigTable] | type[LinesTable]:
    """The model of a jig's file: lines where [strings] is a table; InputError where it is a target of another kind."""
    kind = table.get("kind", "strings")
    if kind in KINDS and kind != "strings":
        raise InputError(f'{where}: kind = "{kind}": a string jig is needed here')
    if kind not in KINDS:
        instead = did_you_mean(str(kind), KINDS) or f"; known are {', '.join(KINDS)}"
        raise InputError(f"{where}: kind = {kind!r}{instead}")
    return LinesTable if isinstance(table.get("strings"), Mapping) else JigTable


def without_names(table: Mapping[str, Any]) -> dict[str, Any]:
    """The tables without the ``name`` that is welcome in every one; an anchor or a string may have that name."""
    return {
        key: {k: v for k, v in value.items() if k != "name" or not isinstance(v, str)}
        if isinstance(value, Mapping)
        else value
        for key, value in table.items()
    }


def jig_text(jig: Jig) -> str:
    """The jig as the text of a jig.toml.

    Parameters
    ----------
    jig : Jig

    Returns
    -------
    str
        Read back it is the same jig to the last bit.
    """
    as_named = jig.pillar is not None and jig.anchors == ANCHORS
    pillar = as_named and all(role == name for role, name in (jig.pillar.strings if jig.pillar else {}).items())
    keys = ("side_mm", "height_mm") if pillar else ()
    about = "origin at the bottom hole of string A, x up the pillar, z into it"
    if not pillar:
        about = "x up, roughly along the strings, z away from the sensor's side"
    lines = [f"# string jig; frame {{J}}: {about}"]
    lines += [f"name = {toml_value(jig.name)}"] if jig.name else []
    lines += [f"{key} = {float(getattr(jig, key))!r}" for key in (*keys, "string_diameter_mm", "tolerance_mm")]
    if pillar:
        lines += [f"strings = [{', '.join(toml_value(s) for s in jig.strings)}]"]
    if pillar and jig.measured:
        lines += ["[anchors_mm] # b: bottom plate, t: top plate; [x, y, z] in {J}"]
        lines += [f"{a} = {[float(v) for v in p]}" for a, p in zip(ANCHORS, jig.anchors_mm, strict=True)]
    return "\n".join(lines if pillar else lines + _lines_text(jig)) + "\n"


def _lines_text(jig: Jig) -> list[str]:
    """The part of a jig's file that names anchors and lines."""
    points = jig.anchors_mm if jig.measured else jig.nominal_anchors_mm
    out = ["measured = true # the anchors: then the tolerance says nothing of them any more"] if jig.measured else []
    out += ["[anchors_mm] # [x, y, z] in {J}"]
    out += [f"{toml_value(a)} = {[float(v) for v in p]}" for a, p in zip(jig.anchors, points, strict=True)]
    out += ["[strings] # the anchors from which and to which each runs"]
    for k, label in enumerate(jig.strings):
        first, second = jig.anchors[jig.start_index[k]], jig.anchors[jig.end_index[k]]
        out += [f"{toml_value(label)} = [{toml_value(first)}, {toml_value(second)}]"]
    return out


def write_jig(jig: Jig, path: str | os.PathLike[str]) -> None:
    """Write a jig.toml, whole or not at all.

    Parameters
    ----------
    jig : Jig
    path : str or path
        What stood there is replaced.

    Raises
    ------
    InputError
        Where it can not be written.
    """
    write_text(path, jig_text(jig))


def _pillar(keys: JigTable) -> Jig:
    jig = Jig.nominal(keys.side_mm, keys.height_mm, keys.string_diameter_mm, keys.tolerance_mm, keys.strings, keys.name)
    if keys.anchors_mm is None:
        return jig
    return replace(jig, anchors_mm=_measured(jig.anchors_mm, keys.anchors_mm, keys.strings), measured=True)


def _measured(anchors: Array, table: AnchorsTable, strings: list[str]) -> Array:
    out = anchors.copy()
    used = {anchor for label in strings if label in STRINGS for anchor in STRINGS[label]}
    for i, anchor in enumerate(ANCHORS):
        point = getattr(table, anchor)
        if point is not None:
            out[i] = point
        elif anchor in used:
            raise InputError(f"[anchors_mm] lacks {anchor}, an end of a string: give [x, y, z] in mm for it")
    return out


def _lines(keys: LinesTable) -> Jig:
    anchors: dict[str, list[float]] = dict(keys.anchors_mm)
    if (keys.side_mm is None) != (keys.height_mm is None):
        given, lacking = ("height_mm", "side_mm") if keys.side_mm is None else ("side_mm", "height_mm")
        raise InputError(f'the key "{lacking}" is missing beside {given}: a pillar has both, other lines neither')
    if keys.side_mm is not None and keys.height_mm is not None:
        drawn = Jig.nominal(keys.side_mm, keys.height_mm, keys.string_diameter_mm, keys.tolerance_mm)
        used = {anchor for ends in keys.strings.values() for anchor in ends}
        pillar = {a: p for a, p in zip(ANCHORS, drawn.anchors_mm.tolist(), strict=True) if a in used}
        anchors = pillar | anchors
    return Jig.of_lines(
        anchors,
        {label: (ends[0], ends[1]) for label, ends in keys.strings.items()},
        keys.string_diameter_mm,
        keys.tolerance_mm,
        keys.measured,
        keys.name,
    )


def _explain(error: ValidationError, model: type[BaseModel]) -> str:
    """The first fault of a validation in one sentence, with the key's name."""
    faults = error.errors()
    first = next((f for f in faults if f["type"] == "extra_forbidden"), faults[0])
    key = ".".join(str(part) for part in first["loc"])
    if first["type"] == "extra_forbidden":
        known = AnchorsTable.model_fields if len(first["loc"]) > 1 else model.model_fields
        near = did_you_mean(str(first["loc"][-1]), known)
        return f'unknown key "{key}"{near or "; known are " + ", ".join(k for k in known if k != "kind")}'
    if first["type"] == "missing":
        return f'the key "{key}" is missing'
    return f'"{key}" = {first["input"]!r}: {first["msg"][0].lower() + first["msg"][1:]}'
