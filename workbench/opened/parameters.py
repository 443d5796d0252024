"""The parameters of a configuration model, generated from its JSON schema: name, kind, unit, range, help."""

from __future__ import annotations

import re
from typing import Any, cast

from pydantic import BaseModel

from workbench.opened.sliders import FILE_ONLY, SLIDERS, Slider

Schema = dict[str, Any]
UNITS = {"px": "px", "px2": "px²", "mm": "mm", "dn": "DN", "deg": "°", "rad": "rad", "s": "s", "ms": "ms", "e": "e⁻"}


def panel(model: type[BaseModel]) -> list[dict[str, Any]]:
    """Groups of controls in the model's order: ``{title, table, parameters: [{key, title, kind, unit, help, …}]}``.

    Tables of FILE_ONLY are left out; a setting without a slider has the bounds of its model.
    """
    schema = model.model_json_schema()
    definitions: Schema = schema.get("$defs", {})
    defaults = model().model_dump(mode="json")
    groups: dict[str, list[dict[str, Any]]] = {}
    _collect(schema, definitions, defaults, (), "Detection", groups)
    return [
        {"title": title, "table": controls[0]["key"].split(".")[0], "parameters": controls}
        for title, controls in groups.items()
        if controls
    ]


def _collect(
    schema: Schema, definitions: Schema, defaults: Any, path: tuple[str, ...], title: str, groups: dict[str, list[Any]]
) -> None:
    for name, field in schema.get("properties", {}).items():
        resolved, nullable = _resolve(field, definitions)
        here = (*path, name)
        if ".".join(here) in FILE_ONLY:
            continue
        if "properties" in resolved:
            inner = str(field.get("title") or _words(name))
            _collect(resolved, definitions, defaults[name], here, inner, groups)
        else:
            groups.setdefault(title, []).append(_control(here, resolved, nullable, defaults[name]))


def _resolve(field: Schema, definitions: Schema) -> tuple[Schema, bool]:
    """The field with references followed and an optional type unpacked; whether it may be null."""
    merged, nullable = dict(field), False
    options = [o for o in merged.pop("anyOf", []) if o.get("type") != "null" or (nullable := True)]
    options = [o for o in options if o.get("type") != "null"]
    if len(options) == 1:
        merged = {**options[0], **merged}
    whole = merged.pop("allOf", [])
    if len(whole) == 1:
        merged = {**whole[0], **merged}
    if "$ref" in merged:
        target = definitions[merged.pop("$ref").removeprefix("#/$defs/")]
        merged = {**target, **merged}
    return merged, nullable


def _control(path: tuple[str, ...], field: Schema, nullable: bool, default: Any) -> dict[str, Any]:
    """One control; ranges without bounds in the model are opened around the default."""
    kind, key = _kind(field), ".".join(path)
    slider = SLIDERS.get(key, Slider(basic=True, search=False))
    help_text, unit_in_help = _split_unit(str(field.get("description", "")))
    control: dict[str, Any] = {
        "key": key,
        "title": _title(path[-1], field),
        "kind": kind,
        "unit": unit_in_help or _unit(path[-1]),
        "help": help_text,
        "level": "basic" if slider.basic else "expert",
        "default": default,
        "nullable": nullable,
        "search": slider.search,
    }
    if kind in ("number", "integer"):
        control |= _range(field, slider, default, kind)
    if kind == "choice":
        control["choices"] = field.get("enum", [field.get("const")])
    return control


def _split_unit(text: str) -> tuple[str, str]:
    """A description without its bracketed unit, and that unit."""
    found = re.search(r"\s*\[([^\]]{1,12})\]", text)
    return (text.replace(found[0], "", 1), found[1]) if found else (text, "")


def _kind(field: Schema) -> str:
    if "enum" in field or "const" in field:
        return "choice"
    kind = cast("str", field.get("type", "string"))
    return kind if kind in ("number", "integer", "boolean", "array") else "string"


def _range(field: Schema, slider: Slider, default: Any, kind: str) -> dict[str, Any]:
    """Bounds of the slider, or of the model where it has none; its step, and whether it is logarithmic."""
    size = abs(float(default)) if isinstance(default, int | float) and default else 1.0
    low = _first(slider.low, field.get("minimum"), field.get("exclusiveMinimum"), 0.0)
    high = _first(slider.high, field.get("maximum"), field.get("exclusiveMaximum"), max(4 * size, low + 4 * size))
    wide = slider.low is None and low > 0 and high / low >= 1000
    step = 1 if kind == "integer" else _nice_step((high - low) / 200)
    return {"min": low, "max": high, "step": step, "log": (slider.log or wide) and low > 0}


def _first(*bounds: float | None) -> float:
    """The first bound that there is."""
    return next(float(bound) for bound in bounds if bound is not None)


def _nice_step(raw: float) -> float:
    return float(f"{10 ** _floor_log10(raw):.0e}") if raw > 0 else 0.01


def _floor_log10(x: float) -> int:
    return int(f"{x:e}".split("e")[1])


def _title(name: str, field: Schema) -> str:
    """The model's own title where it was given, else the key in words without its unit."""
    automatic = name.replace("_", " ").title()
    given = str(field.get("title", automatic))
    return given if given.casefold() != automatic.casefold() else _words(name)


def _words(name: str) -> str:
    """``max_length_mm`` → Max length, ``gain_dn_per_e`` → Gain."""
    ends = "|".join(UNITS)
    bare = re.sub(rf"_({ends})(_per_({ends}))?$", "", name)
    text = bare.replace("_", " ")
    return text[:1].upper() + text[1:]


def _unit(name: str) -> str:
    """The unit that a key's last word names; empty where it names none."""
    parts = name.split("_")
    if len(parts) > 3 and parts[-2] == "per" and parts[-1] in UNITS and parts[-3] in UNITS:
        return f"{UNITS[parts[-3]]}/{UNITS[parts[-1]]}"
    return UNITS.get(parts[-1], "") if len(parts) > 1 else ""
