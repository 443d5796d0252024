"""wenglor: columns x, z, intensity, peak width; a point without light has x = z = 0."""

from __future__ import annotations

import re

import numpy as np

from geometry import InputError
from workbench.profiles.grid import Cells, cells_of, is_numeric
from workbench.profiles.scan_line import ScanLine, Told
from workbench.profiles.source import Source

NAME = "wenglor"
_FEWEST = 2
_COLUMNS = 4


def recognises(source: Source) -> bool:
    """By a header of x, z, intensity and a width, or by four columns of numbers that look so."""
    if source.is_binary:
        return False
    try:
        cells = cells_of("\n".join(source.text.splitlines()[:20]), source.path)
    except InputError:
        return False
    words = [_word(c) for c in cells.rows[0]]
    if words[:2] == ["x", "z"] and any("width" in w for w in words):
        return True
    return is_numeric(cells, 20) and all(len(row) == _COLUMNS for row in cells.rows) and _looks_so(source)


def _looks_so(source: Source) -> bool:
    """Whether four columns without a header are these: dark points are 0 throughout, x of the others goes one way."""
    try:
        rows = cells_of(source.text, source.path).numbers()
    except InputError:
        return False
    if any(len(row) != _COLUMNS for row in rows):
        return False
    numbers = np.array(rows)
    dark = np.all(numbers == 0, axis=1)
    lit = numbers[~dark]
    step = np.diff(lit[:, 0])
    one_way = len(step) > 0 and bool(np.all(step > 0) or np.all(step < 0))
    return bool(np.any(dark)) and one_way and bool(np.all(lit[:, 2:] >= 0))


def read(source: Source, told: Told) -> tuple[ScanLine, ...]:
    """One profile; with a header or, where the format was named, without."""
    cells = cells_of(source.text, source.path)
    head = [] if is_numeric(cells, 1) else [_word(c) for c in cells.rows[0]]
    if head and head[:2] != ["x", "z"]:
        raise InputError(f"{source.path}, line {cells.lines[0]}: columns x, z, intensity, peak width are right")
    start = 1 if head else 0
    numbers = Cells(cells.path, cells.lines[start:], cells.rows[start:], cells.separator).numbers()
    short = next((k for k, row in enumerate(numbers) if len(row) < _FEWEST), None)
    if short is not None:
        raise InputError(f"{source.path}, line {cells.lines[start + short]}: x and z are needed")
    if not numbers:
        raise InputError(f"{source.path}: holds a header but no points")
    light = next((k for k, w in enumerate(head) if "intensity" in w), 2 if not head else None)
    y, z = (np.array([row[k] for row in numbers]) for k in (0, 1))
    missing = (y == 0) & (z == 0)
    complete = light is not None and all(len(row) > light for row in numbers)
    intensity = np.array([row[light] for row in numbers]) if complete and light is not None else None
    return (ScanLine(np.where(missing, np.nan, y), np.where(missing, np.nan, z), intensity),)


def _word(cell: str) -> str:
    return re.sub(r"[\[(].*$|_?mm$|[_\s]", "", cell.strip().strip('"').casefold())
