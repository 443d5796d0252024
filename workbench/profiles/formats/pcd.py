"""pcd: the Point Cloud Library's format, ascii, binary or compressed."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from geometry import InputError
from workbench.profiles.cloud import profiles_of_cloud
from workbench.profiles.scan_line import ScanLine, Told
from workbench.profiles.source import MAX_POINTS, Source, cell_value

Array = NDArray[np.float64]

NAME = "pcd"
_MAX_HEADER = 65536
_KINDS = {("F", 4): "<f4", ("F", 8): "<f8", ("U", 1): "u1", ("U", 2): "<u2", ("U", 4): "<u4", ("U", 8): "<u8",
          ("I", 1): "i1", ("I", 2): "<i2", ("I", 4): "<i4", ("I", 8): "<i8"}  # fmt: skip


def recognises(source: Source) -> bool:
    """By the words of its header."""
    return source.data.startswith(b"# .PCD") or (
        b"\nFIELDS " in source.data[:1024] and b"\nDATA " in source.data[:_MAX_HEADER]
    )


def read(source: Source, told: Told) -> tuple[ScanLine, ...]:
    """One profile, or as many as the travel tells apart."""
    header, start = _header(source)
    fields = _fields(header, source)
    count = _whole(header.get("POINTS", ["0"])[0], source)
    if count * len(fields) > MAX_POINTS:
        raise InputError(f"{source.path}: announces {count} points, more than this reads")
    form = header["DATA"][0]
    if form == "ascii":
        columns = _ascii(source, start, count, fields)
    elif form in ("binary", "binary_compressed"):
        columns = _binary(source, start, count, fields, compressed=form != "binary")
    else:
        raise InputError(f"{source.path}: DATA {form[:40]} is unknown")
    for name in ("x", "y", "z"):
        if name not in columns:
            raise InputError(f'{source.path}: has no field "{name}"')
    xyz = np.column_stack([columns["x"], columns["y"], columns["z"]])
    return profiles_of_cloud(xyz, source.path, columns.get("intensity"))


def _header(source: Source) -> tuple[dict[str, list[str]], int]:
    at = source.data.find(b"DATA ", 0, _MAX_HEADER)
    end = source.data.find(b"\n", at) if at >= 0 else -1
    if end < 0:
        raise InputError(f"{source.path}: its header has no line DATA")
    lines = (line.split() for line in source.data[: end + 1].decode("latin-1").splitlines())
    header = {words[0]: words[1:] for words in lines if len(words) > 1 and words[0] != "#"}
    if "DATA" not in header:
        raise InputError(f"{source.path}: its header has no line DATA")
    return header, end + 1


def _fields(header: dict[str, list[str]], source: Source) -> list[tuple[str, str, int]]:
    """Name, type and number of values of each field."""
    names = header.get("FIELDS", [])
    n = len(names)
    sizes, kinds = header.get("SIZE", ["4"] * n), header.get("TYPE", ["F"] * n)
    counts = header.get("COUNT", ["1"] * n)
    if n == 0 or not n == len(sizes) == len(kinds) == len(counts) or len(set(names) - {"_"}) != n - names.count("_"):
        raise InputError(f"{source.path}: FIELDS, SIZE, TYPE and COUNT do not go together")
    out = []
    for name, size, kind, count in zip(names, sizes, kinds, counts, strict=True):
        code = _KINDS.get((kind, _whole(size, source)))
        if code is None or not 1 <= _whole(count, source) <= 4096:
            raise InputError(
                f"{source.path}: the field {name[:40]} has SIZE {size[:9]}, TYPE {kind[:9]}, COUNT {count[:9]}"
            )
        out.append((name, code, _whole(count, source)))
    return out


def _whole(text: str, source: Source) -> int:
    if not (text.isascii() and text.isdigit()) or len(text) > 9:
        raise InputError(f'{source.path}: "{text[:20]}" in its header is no whole number')
    return int(text)


def _ascii(source: Source, start: int, count: int, fields: list[tuple[str, str, int]]) -> dict[str, Array]:
    lines = source.data[start:].decode("latin-1").splitlines()
    rows = [words for line in lines if (words := line.split())][:count]
    width = sum(c for _, _, c in fields)
    if len(rows) < count or any(len(words) < width for words in rows):
        raise InputError(f"{source.path}: is cut short: {count} points of {width} values were announced")
    out, at = {}, 0
    for name, _, values in fields:
        if values == 1 and name != "_":
            out[name] = np.array([cell_value(r[at], f"{source.path}, point {i + 1}") for i, r in enumerate(rows)])
        at += values
    return out


def _binary(
    source: Source, start: int, count: int, fields: list[tuple[str, str, int]], *, compressed: bool
) -> dict[str, Array]:
    size = sum(np.dtype(code).itemsize * c for _, code, c in fields)
    data = source.data[start:]
    if compressed:
        packed, plain = (int.from_bytes(data[k : k + 4], "little") for k in (0, 4))
        if len(data) < 8 or packed > len(data) - 8 or plain != size * count:
            raise InputError(f"{source.path}: is cut short, or its compressed part is of another size than announced")
        data = _decompressed(data[8 : 8 + packed], plain, source)
    if count * size > len(data):
        raise InputError(f"{source.path}: is cut short: {count} points were announced")
    out, at = {}, 0
    if compressed:  # field by field
        for name, code, values in fields:
            column = np.frombuffer(data, np.dtype(code), count * values, at)
            at += column.nbytes
            if values == 1 and name != "_":
                out[name] = column.astype(float)
    else:
        layout = [(f"{i}", code, (values,)) for i, (_, code, values) in enumerate(fields)]
        table: Any = np.frombuffer(data, np.dtype(layout), count)
        for i, (name, _, values) in enumerate(fields):
            if values == 1 and name != "_":
                out[name] = table[f"{i}"][:, 0].astype(float)
    return {n: np.where(np.abs(np.nan_to_num(v, nan=np.inf)) < 1e30, v, np.nan) for n, v in out.items()}


def _decompressed(packed: bytes, plain: int, source: Source) -> bytes:
    """LZF: literal runs below 32, else a copy of what stands some bytes before."""
    out, i = bytearray(), 0
    try:
        while i < len(packed) and len(out) <= plain:
            control = packed[i]
            i += 1
            if control < 32:
                out += packed[i : i + control + 1]
                i += control + 1
                continue
            length = control >> 5
            if length == 7:
                length += packed[i]
                i += 1
            back = len(out) - ((control & 31) << 8) - packed[i] - 1
            i += 1
            if back < 0:
                raise IndexError
            for k in range(back, back + length + 2):  # it may overlap what it writes
                out.append(out[k])
    except IndexError:
        raise InputError(f"{source.path}: its compressed part is broken") from None
    if len(out) != plain:
        raise InputError(f"{source.path}: its compressed part is broken")
    return bytes(out)
