"""gocator: the CSV export of LMI's emulator and web interface, sections that begin with a name and end with End."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from geometry import InputError
from workbench.profiles.grid import Cells, cells_of
from workbench.profiles.scan_line import ScanLine, Told
from workbench.profiles.source import Source, cell_value

Array = NDArray[np.float64]
Lines = list[tuple[int, list[str]]]

NAME = "gocator"
_SECTIONS = ("Profile", "RawProfile", "Part")
_COLUMNS = ("Frame", "Source", "Time", "Encoder", "Z Encoder", "Inputs", "Exposure", "Y", "Axis")
_DIGITS = 4  # after the point, as the maker writes


def recognises(source: Source) -> bool:
    """By its first section."""
    first = source.head.lstrip().splitlines()[:1]
    return not source.is_binary and bool(first) and first[0].rstrip(",;\t ").strip('"') in ("Info", "DeviceInfo")


def read(source: Source, told: Told) -> tuple[ScanLine, ...]:
    """All profiles of the file, of the first section that has them: Profile, RawProfile, Part."""
    cells = cells_of(source.text, source.path)
    sections = _sections(cells)
    reach = _ranges(sections.get("Ranges", []), cells)
    for name, reader in zip(_SECTIONS, (_profile, _raw, _part), strict=True):
        if name in sections:
            found = tuple(reader(sections[name], cells, reach))
            if not found:
                raise InputError(f"{source.path}: its section {name} holds no profile")
            return found
    raise InputError(f"{source.path}: holds none of the sections {', '.join(_SECTIONS)}, so no profile")


def _sections(cells: Cells) -> dict[str, Lines]:
    """Rows (their place in the file's rows, and cells) by section; the first of a name counts."""
    out: dict[str, Lines] = {}
    name = ""
    for i, row in enumerate(cells.rows):
        filled = [c for c in row if c]
        if not name and len(filled) == 1:
            name = filled[0]
            out.setdefault(name, [])
        elif name and filled[:1] == ["End"]:
            name = ""
        elif name:
            out[name].append((i, row))
    return out


def _ranges(section: Lines, cells: Cells) -> Array | None:
    """Least and largest X and Z (2, 2) of the section Ranges."""
    found = {row[0]: (i, row) for i, row in section if len(row) >= 3 and row[0] in ("X", "Z")}
    if set(found) != {"X", "Z"}:
        return None
    out = np.array([[cell_value(found[a][1][k], cells.where(found[a][0], k)) for k in (1, 2)] for a in ("X", "Z")])
    return out if np.all(np.isfinite(out)) and np.all(out[:, 0] < out[:, 1]) else None


def _header(section: Lines, cells: Cells, column: str) -> tuple[int, int]:
    """Which row of the section is its header, and the place of ``column`` in it."""
    for k, (_, row) in enumerate(section):
        if column in row:
            return k, row.index(column)
    raise InputError(f'{cells.path}: its section has no column "{column}"')


def _profile(section: Lines, cells: Cells, reach: Array | None) -> Iterator[ScanLine]:
    """Rows Axis = Z and I under a header of x."""
    at, axis = _header(section, cells, "Axis")
    head_row, head = section[at]
    y = _values(head, axis, head_row, cells)
    frame = head.index("Frame") if "Frame" in head else None
    rows: dict[str, dict[str, tuple[int, list[str]]]] = {}
    for k, (i, row) in enumerate(section[at + 1 :]):
        if axis < len(row):
            key = row[frame] if frame is not None else str(k)
            kinds = rows.setdefault(key, {})
            if row[axis] in kinds:
                raise InputError(f"{cells.where(i, axis)}: a second row {row[axis]} of profile {key}")
            kinds[row[axis]] = (i, row)
    for key, kinds in rows.items():
        if "Z" in kinds:
            z, light = (_padded(kinds, name, axis, len(y), cells) for name in ("Z", "I"))
            yield ScanLine(y, _given(z, len(y)), light, number=_number(key), range_mm=reach)


def _raw(section: Lines, cells: Cells, reach: Array | None) -> Iterator[ScanLine]:
    """Rows Axis = X, Z and I."""
    at, axis = _header(section, cells, "Axis")
    head = section[at][1]
    frame = head.index("Frame") if "Frame" in head else None
    rows: dict[str, dict[str, tuple[int, list[str]]]] = {}
    for i, row in section[at + 1 :]:
        if axis < len(row):
            rows.setdefault(row[frame] if frame is not None else "", {})[row[axis]] = (i, row)
    for key, kinds in rows.items():
        if "X" in kinds and "Z" in kinds:
            n = max(len(row) for _, row in kinds.values()) - axis - 1
            y, z, light = (_padded(kinds, name, axis, n, cells) for name in ("X", "Z", "I"))
            yield ScanLine(_given(y, n), _given(z, n), light, number=_number(key), range_mm=reach)


def _part(section: Lines, cells: Cells, reach: Array | None) -> Iterator[ScanLine]:
    """A grid of heights, x to the right, the travel downwards: a row is a profile."""
    corner = next((k for k, (_, row) in enumerate(section) if row and row[0].replace(" ", "") in ("Y\\X", "Y/X")), None)
    if corner is None:
        raise InputError(f"{cells.path}: its section Part has no grid that begins with Y\\X")
    i, head = section[corner]
    y = _values(head, 0, i, cells)
    for number, (k, row) in enumerate(section[corner + 1 :]):
        if not row or not _is_number(row[0]):
            break
        z = _fit(_values(row, 0, k, cells), len(y), cells.where(k, 0))
        yield ScanLine(y, z, number=number, range_mm=reach)


def _values(row: list[str], axis: int, line: int, cells: Cells) -> Array:
    """The numbers to the right of a column, empty cells at the row's end left out."""
    tail = row[axis + 1 :]
    while tail and not tail[-1]:
        tail = tail[:-1]
    return np.array([cell_value(c, cells.where(line, axis + 1 + k)) for k, c in enumerate(tail)], dtype=float)


def _padded(kinds: dict[str, tuple[int, list[str]]], name: str, axis: int, n: int, cells: Cells) -> Array | None:
    if name not in kinds:
        return None
    line, row = kinds[name]
    return _fit(_values(row, axis, line, cells), n, cells.where(line, axis))


def _fit(values: Array, n: int, where: str) -> Array:
    """Filled up with missing values to n."""
    if len(values) > n:
        raise InputError(f"{where}: {len(values)} values for {n} lateral coordinates")
    return np.concatenate([values, np.full(n - len(values), np.nan)])


def _given(values: Array | None, n: int) -> Array:
    return np.full(n, np.nan) if values is None else values


def _is_number(text: str) -> bool:
    try:
        return bool(np.isfinite(cell_value(text, "")))
    except InputError:
        return False


def _number(text: str) -> int | None:
    return int(text) if text.isascii() and text.isdigit() and len(text) < 10 else None


def write(lines: Sequence[ScanLine], told: Told) -> bytes:
    """As section Profile where all share their lateral coordinates, else as RawProfile."""
    same = all(np.array_equal(np.round(s.y_mm, _DIGITS), np.round(lines[0].y_mm, _DIGITS)) for s in lines)
    same = same and bool(np.all(np.isfinite(lines[0].y_mm)))
    present = np.concatenate([np.column_stack([s.y_mm, s.z_mm])[s.present] for s in lines])
    present = present if len(present) else np.zeros((1, 2))
    out = ["Info,", "Format Version,2", "End,", "", "DeviceInfo,", "Model,perceptron-emu", "End,", ""]
    out += ["Ranges,", "Axis,Min,Max"]
    out += [f"{a},{v.min() - 1e-3:.3f},{v.max() + 1e-3:.3f}" for a, v in zip("XZ", present.T, strict=True)]
    head = ",".join(_COLUMNS)
    out += ["End,", "", "Profile," if same else "RawProfile,"]
    out += [f"{head},{','.join(_text(v) for v in lines[0].y_mm)}" if same else head]
    for i, scan in enumerate(lines):
        axes = [("X", scan.y_mm)] if not same else []
        axes += [("Z", scan.z_mm)] + ([] if scan.intensity is None else [("I", scan.intensity)])
        start = f"{i if scan.number is None else scan.number},0,0,0,0,0,0,0"
        out += [f"{start},{axis},{','.join(_text(v) for v in values)}" for axis, values in axes]
    return ("\n".join([*out, "End,", ""])).encode()


def _text(value: float) -> str:
    return f"{value:.{_DIGITS}f}" if np.isfinite(value) else ""
