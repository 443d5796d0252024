"""ply: Stanford's polygon format, ascii or binary; its vertices are the points."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from geometry import InputError
from workbench.profiles.cloud import profiles_of_cloud
from workbench.profiles.scan_line import ScanLine, Told
from workbench.profiles.source import MAX_POINTS, Source, cell_value

Array = NDArray[np.float64]

NAME = "ply"
_TYPES = {
    **{"char": "i1", "uchar": "u1", "short": "i2", "ushort": "u2", "int": "i4", "uint": "u4", "float": "f4"},
    **{"double": "f8", "int8": "i1", "uint8": "u1", "int16": "i2", "uint16": "u2", "int32": "i4", "uint32": "u4"},
    **{"float32": "f4", "float64": "f8"},
}
_MAX_HEADER = 65536


def recognises(source: Source) -> bool:
    """By its first word."""
    return source.data[:4] in (b"ply\n", b"ply\r")


def read(source: Source, told: Told) -> tuple[ScanLine, ...]:
    """One profile, or as many as a property ``profile`` or the travel tells apart."""
    header, start = _header(source)
    form, count, properties = _layout(header, source)
    if count * max(1, len(properties)) > MAX_POINTS:
        raise InputError(f"{source.path}: announces {count} points, more than this reads")
    reader = _ascii if form == "ascii" else _binary
    columns = reader(source, start, count, properties, form)
    for name in ("x", "y", "z"):
        if name not in columns:
            raise InputError(f'{source.path}: its vertices have no property "{name}"')
    xyz = np.column_stack([columns["x"], columns["y"], columns["z"]])
    return profiles_of_cloud(xyz, source.path, columns.get("intensity"), columns.get("profile"))


def _header(source: Source) -> tuple[list[str], int]:
    end = source.data.find(b"end_header", 0, _MAX_HEADER)
    line_end = source.data.find(b"\n", end) if end >= 0 else -1
    if line_end < 0:
        raise InputError(f"{source.path}: its header has no end_header")
    return source.data[:end].decode("latin-1").splitlines(), line_end + 1


def _layout(header: list[str], source: Source) -> tuple[str, int, list[tuple[str, str]]]:
    form, count, inside = "", -1, False
    properties: list[tuple[str, str]] = []
    for words in (line.split() for line in header):
        if words[:1] == ["format"] and len(words) > 1:
            form = words[1]
        elif words[:1] == ["element"] and len(words) > 2:
            if count < 0 and words[1] != "vertex":
                raise InputError(f"{source.path}: begins with the element {words[1][:40]}, vertex is right")
            inside = words[1] == "vertex"
            if inside and (not words[2].isascii() or not words[2].isdigit() or len(words[2]) > 9):
                raise InputError(f"{source.path}: has no count of vertices")
            count = int(words[2]) if inside else count
        elif words[:1] == ["property"] and inside:
            if len(words) != 3 or words[1] not in _TYPES or any(words[2] == name for name, _ in properties):
                raise InputError(
                    f"{source.path}: the property {' '.join(words[1:])[:40]} of its vertices is not one number"
                )
            properties.append((words[2], _TYPES[words[1]]))
    if form not in ("ascii", "binary_little_endian", "binary_big_endian") or count < 0:
        raise InputError(f"{source.path}: its header tells no format or no vertices")
    return form, count, properties


def _ascii(source: Source, start: int, count: int, properties: list[tuple[str, str]], form: str) -> dict[str, Array]:
    lines = source.data[start:].decode("latin-1").splitlines()
    rows = [(i, words) for i, line in enumerate(lines) if (words := line.split())][:count]
    if len(rows) < count:
        raise InputError(f"{source.path}: is cut short: {len(rows)} of {count} points")
    n = len(properties)
    bad = next((i for i, words in rows if len(words) < n), None)
    if bad is not None:
        raise InputError(f"{source.path}: point {bad + 1} has fewer than {n} values")
    return {
        name: np.array([cell_value(words[k], f"{source.path}, point {i + 1}") for i, words in rows], dtype=float)
        for k, (name, _) in enumerate(properties)
    }


def _binary(source: Source, start: int, count: int, properties: list[tuple[str, str]], form: str) -> dict[str, Array]:
    order = "<" if form.endswith("little_endian") else ">"
    dtype: Any = np.dtype([(name, order + kind) for name, kind in properties])
    if dtype.itemsize == 0 or count * dtype.itemsize > len(source.data) - start:
        raise InputError(f"{source.path}: is cut short: {count} points were announced")
    table = np.frombuffer(source.data, dtype, count, start)
    return {name: _finite(table[name].astype(float)) for name, _ in properties}


def _finite(values: Array) -> Array:
    return np.where(np.abs(np.nan_to_num(values, nan=np.inf)) < 1e30, values, np.nan)


def write(lines: Sequence[ScanLine], told: Told) -> bytes:
    """Points (0, y, z), missing ones as nan, with the profile's number where there are several."""
    several = len(lines) > 1
    light = all(scan.intensity is not None for scan in lines)
    names = ["x", "y", "z", *(["intensity"] if light else []), *(["profile"] if several else [])]
    header = ["ply", "format ascii 1.0", "comment laser line, sensor frame, mm"]
    header += [f"element vertex {sum(map(len, lines))}", *(f"property double {n}" for n in names[:3])]
    header += [f"property {'float' if n == 'intensity' else 'int'} {n}" for n in names[3:]] + ["end_header"]
    rows = []
    for k, scan in enumerate(lines):
        number = [str(k if scan.number is None else scan.number)] if several else []
        levels = scan.intensity if light and scan.intensity is not None else np.zeros(len(scan))
        for y, z, i in zip(scan.y_mm, scan.z_mm, levels, strict=True):
            rows.append(" ".join(["0", _text(y), _text(z), *([_text(i)] if light else []), *number]))
    return ("\n".join([*header, *rows]) + "\n").encode()


def _text(value: float) -> str:
    return f"{value:.9g}" if np.isfinite(value) else "nan"
