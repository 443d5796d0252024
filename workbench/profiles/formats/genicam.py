"""genicam: CoordinateA and CoordinateC with scale, offset and invalid mark (GenICam SFNC), .npy or csv.

What belongs to an axis may be named Scale[CoordinateC], Scan3dCoordinateScaleC, ScaleC …; in a .npy as fields of its
records, in a csv as columns or as lines "name, value" before the header.
"""

from __future__ import annotations

import re

import numpy as np
from numpy.typing import NDArray

from geometry import InputError
from workbench.profiles.counts import beside
from workbench.profiles.grid import cells_of
from workbench.profiles.scan_line import ScanLine, Told
from workbench.profiles.source import Source, cell_value

Array = NDArray[np.float64]

NAME = "genicam"
_SETTINGS = ("scale", "offset", "invaliddataflag", "invaliddatavalue")
_MANY = 10  # whole numbers: so many millimetres are never all whole
_TRUE = ("1", "true", "yes", "on")


def recognises(source: Source) -> bool:
    """By the name of the depth's coordinate."""
    if source.data.startswith(b"\x93NUMPY"):
        return any(_key(n) == ("c", "") for n in source.array.dtype.names or ())
    return not source.is_binary and re.search(r"coordinate_?c\b", source.head, re.IGNORECASE) is not None


def read(source: Source, told: Told) -> tuple[ScanLine, ...]:
    """One profile; without CoordinateA the lateral pitch must be told."""
    values, settings = _records(source) if source.data.startswith(b"\x93NUMPY") else _text(source)
    if "c" not in values:
        raise InputError(f"{source.path}: holds no CoordinateC")
    told = beside(source, told)
    rows = np.atleast_2d(_metric(values["c"], "c", settings, source))
    if "a" in values:
        lateral = np.atleast_2d(_metric(values["a"], "a", settings, source))
        if lateral.shape != rows.shape:
            raise InputError(f"{source.path}: CoordinateA has shape {lateral.shape}, CoordinateC {rows.shape}")
    else:
        lateral = np.broadcast_to(told.lateral(rows.shape[1], source.path), rows.shape)
    several = len(rows) > 1
    return tuple(
        ScanLine(np.array(y), z, number=k if several else None)
        for k, (y, z) in enumerate(zip(lateral, rows, strict=True))
    )


def _key(name: str) -> tuple[str, str] | None:
    """("c", "scale") for Scan3dCoordinateScale[CoordinateC], ("c", "") for CoordinateC, ("", "offset") for Offset."""
    plain = re.sub(r"[^a-z0-9]", "", name.casefold()).replace("scan3d", "")
    axis = ""
    if found := re.search(r"coordinate([abc])$", plain):
        axis, plain = found[1], plain[: found.start()]
    plain = plain.replace("coordinate", "")
    if plain == "" and axis:
        return axis, ""
    for setting in _SETTINGS:
        if plain == setting:
            return axis, setting
        if plain in (f"{setting}{a}" for a in "abc") or plain in (f"{a}{setting}" for a in "abc"):
            return plain.replace(setting, ""), setting
    return None


def _records(source: Source) -> tuple[dict[str, Array], dict[tuple[str, str], float]]:
    array = source.array
    if array.dtype.names is None or array.ndim > 2 or array.size == 0:
        raise InputError(f"{source.path}: records with a field CoordinateC are right")
    values, settings = {}, {}
    for name in array.dtype.names:
        key = _key(name)
        if key is None or array.dtype[name].kind not in "biuf":
            continue
        column = np.asarray(array[name], dtype=float)
        if key[1] == "":
            values[key[0]] = column[..., 0] if column.ndim > array.ndim and column.shape[-1] == 1 else column
        else:
            settings[key] = float(column.ravel()[0])
    return values, settings


def _text(source: Source) -> tuple[dict[str, Array], dict[tuple[str, str], float]]:
    cells = cells_of(source.text.replace("=", ","), source.path)
    settings: dict[tuple[str, str], float] = {}
    for i, row in enumerate(cells.rows):
        keys = [_key(c) for c in row]
        if ("c", "") in keys:
            columns = [(key, k) for k, key in enumerate(keys) if key is not None]
            break
        if len(row) >= 2 and keys[0] is not None and keys[0][1]:
            settings[keys[0]] = _setting(row[1], cells.where(i, 1))
    else:
        raise InputError(f"{source.path}: holds no column CoordinateC")
    body = list(enumerate(cells.rows))[i + 1 :]
    values: dict[str, Array] = {}
    for key, k in columns:
        if key[1] == "":
            values[key[0]] = np.array([cell_value(r[k] if k < len(r) else "", cells.where(j, k)) for j, r in body])
        elif body and k < len(body[0][1]):
            settings[key] = _setting(body[0][1][k], cells.where(body[0][0], k))
    if not body:
        raise InputError(f"{source.path}: holds a header but no points")
    return values, settings


def _setting(text: str, where: str) -> float:
    if text.casefold() in _TRUE:
        return 1.0
    return 0.0 if text.casefold() in ("false", "no", "off") else cell_value(text, where)


def _are_counts(values: Array) -> bool:
    """Whether numbers are a chip's counts: whole ones, many and not all alike. Millimetres never are."""
    return len(values) >= _MANY and bool(np.all(values == np.round(values))) and bool(np.ptp(values) > 0)


def _metric(raw: Array, axis: str, settings: dict[tuple[str, str], float], source: Source) -> Array:
    def of(setting: str, default: float) -> float:
        return settings.get((axis, setting), settings.get(("", setting), default))

    name = f"Coordinate{axis.upper()}"
    there = raw[np.isfinite(raw)]
    if (axis, "scale") not in settings and ("", "scale") not in settings and _are_counts(there):
        raise InputError(
            f"{source.path}: {name} holds whole numbers, such as {there[len(there) // 2]:.0f}, and nothing says how "
            f"many mm a count is: add Scan3dCoordinateScale[{name}] and Scan3dCoordinateOffset[{name}] as the camera "
            "told them, in a .npy as fields of its records, in a csv as lines before the header"
        )
    scale, offset = of("scale", 1.0), of("offset", 0.0)
    if not np.isfinite(scale) or scale == 0 or not np.isfinite(offset):
        raise InputError(f"{source.path}: scale {scale:g} and offset {offset:g} of {name} can not be")
    mark = of("invaliddatavalue", float("nan"))
    flagged = of("invaliddataflag", 1.0 if np.isfinite(mark) else 0.0) > 0
    missing = (raw == mark) if flagged and np.isfinite(mark) else np.zeros(raw.shape, dtype=bool)
    with np.errstate(over="ignore", invalid="ignore"):  # what overflows is refused as no length
        return np.where(missing, np.nan, raw * scale + offset)
