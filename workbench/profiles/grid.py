"""Grids of numbers as text: separators and decimal marks recognised, ambiguous ones refused."""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from geometry import InputError
from workbench.profiles.source import MAX_POINTS, cell_value

Array = NDArray[np.float64]

_DECIMAL_COMMA = re.compile(r"[-+−]?\d+,\d+(?:[eE][-+]?\d+)?")
_WHOLE = re.compile(r"[-+−]?\d+")


@dataclass(frozen=True)
class Cells:
    """Rows of cells as text, each with its line; numbers have decimal points."""

    path: Path
    lines: tuple[int, ...]
    rows: tuple[list[str], ...]
    separator: str

    def where(self, row: int, column: int) -> str:
        """Where a cell stands, for a sentence."""
        return f"{self.path}, line {self.lines[row]}, column {column + 1}"

    def numbers(self) -> list[Array]:
        """Every row as numbers, NaN where a cell is missing; InputError naming the first that is neither."""
        return [
            np.array([cell_value(cell, self.where(i, k)) for k, cell in enumerate(row)])
            for i, row in enumerate(self.rows)
        ]


def cells_of(text: str, path: Path, *, separator: str | None = None) -> Cells:
    """The rows of a text, comments and blank lines left out.

    Tabs or semicolons separate where there are any, and numbers may then have decimal commas; else commas, else blanks.

    Raises
    ------
    InputError
        Where commas may be decimal marks or separators.

    """
    numbered = [(i, line.strip()) for i, line in enumerate(text.splitlines(), start=1)]
    numbered = [(i, line) for i, line in numbered if line and not line.startswith(("#", "//"))]
    if not numbered:
        raise InputError(f"{path}: holds no rows")
    sample = [line for _, line in numbered[:50]]
    mark = separator or next((m for m in ("\t", ";", ",") if any(m in line for line in sample)), " ")
    rows = [line.split() if mark == " " else [c.strip().strip('"') for c in line.split(mark)] for _, line in numbered]
    if mark == "," and _ambiguous(rows):
        raise InputError(
            f"{path}, line {numbered[0][0]}: its commas may be decimal marks or separate columns: numbers with decimal "
            "commas must be separated by semicolons or tabs"
        )
    if mark != ",":
        rows = [[c.replace(",", ".") if _DECIMAL_COMMA.fullmatch(c) else c for c in row] for row in rows]
    if sum(map(len, rows)) > MAX_POINTS:
        raise InputError(f"{path}: holds more than {MAX_POINTS} values")
    return Cells(path, tuple(i for i, _ in numbered), tuple(rows), mark)


def is_numeric(cells: Cells, first: int = 3) -> bool:
    """Whether the first rows hold numbers or missing ones alone, one number at least."""
    found = False
    for i, row in enumerate(cells.rows[:first]):
        for k, cell in enumerate(row):
            try:
                found |= bool(np.isfinite(cell_value(cell, cells.where(i, k))))
            except InputError:
                return False
    return found


def _ambiguous(rows: list[list[str]]) -> bool:
    """Whether all cells are whole numbers in pairs whose second halves look like decimals: 12,3456,13,4567."""
    sample = rows[:200]
    if any(len(row) % 2 or not row for row in sample):
        return False
    if not all(_WHOLE.fullmatch(cell) for row in sample for cell in row):
        return False
    halves = [row[k] for row in sample for k in range(1, len(row), 2)]
    long = [h for h in halves if len(h) >= 3 and h.isdigit()]
    return len(long) >= 0.5 * len(halves) and len({len(h) for h in halves if h.isdigit()}) <= 2
