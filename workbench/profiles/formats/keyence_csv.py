"""keyence_csv: a grid of heights alone, or with x as its first column; decimal commas by locale; nines are missing."""

from __future__ import annotations

import re
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from geometry import InputError
from workbench.profiles.grid import Cells, cells_of, is_numeric
from workbench.profiles.resampled import on_grid
from workbench.profiles.scan_line import ScanLine, Told
from workbench.profiles.source import Source

Array = NDArray[np.float64]

NAME = "keyence_csv"
_NINES = re.compile(r"[-−]9+(?:\.9+)?0*")  # −999.999 and its kin
_ABOVE = -99.0  # nines down to here may be heights
_DIGITS = 4
_MISSING = "-999.9999"


def recognises(source: Source) -> bool:
    """By rows of numbers alone that are separated by commas, semicolons or tabs; blanks are a cloud's."""
    if source.is_binary:
        return False
    try:
        cells = cells_of("\n".join(source.text.splitlines()[:20]), source.path)
    except InputError as error:
        return "decimal" in str(error)
    if cells.separator == " " and any(len(row) > 1 for row in cells.rows):
        return False
    plain = Cells(cells.path, cells.lines, tuple(_without_missing(row) for row in cells.rows), cells.separator)
    return is_numeric(plain, 20) or all(not any(row) for row in plain.rows)


def read(source: Source, told: Told) -> tuple[ScanLine, ...]:
    """With a pitch told, a row is a profile, or a single column is; without, the first column is x."""
    cells = cells_of(source.text, source.path)
    rows = tuple(_without_missing(row) for row in cells.rows)
    numbers = Cells(cells.path, cells.lines, rows, cells.separator).numbers()
    width = max(map(len, numbers))
    ends_empty = all(len(row) == width and np.isnan(row[-1]) for row in numbers) and cells.rows[0][-1] == ""
    if ends_empty and width > 1:  # a separator ends each line
        numbers, width = [row[:-1] for row in numbers], width - 1
    grid = np.full((len(numbers), width), np.nan)
    for k, row in enumerate(numbers):
        grid[k, : len(row)] = row
    if _begins_with_x(grid, told):
        return tuple(ScanLine(grid[:, 0], grid[:, k], number=None if width == 2 else k - 1) for k in range(1, width))
    heights = grid.T if width == 1 else grid
    y = told.lateral(heights.shape[1], source.path)
    return tuple(ScanLine(y, row, number=None if len(heights) == 1 else k) for k, row in enumerate(heights))


def _begins_with_x(grid: Array, told: Told) -> bool:
    """A first column that rises or falls throughout: x, where no pitch is told or the rows are too short to be one."""
    if grid.shape[1] < 2 or len(grid) < 2 or not np.all(np.isfinite(grid[:, 0])):
        return False
    step = np.diff(grid[:, 0])
    one_way = bool(np.all(step > 0) or np.all(step < 0))
    return one_way and (told.pitch_mm is None or (grid.shape[1] == 2 and len(grid) > 2))


def _without_missing(row: list[str]) -> list[str]:
    return ["" if _NINES.fullmatch(c) and float(c.replace("−", "-")) < _ABOVE else c for c in row]


def write(lines: Sequence[ScanLine], told: Told) -> bytes:
    """With a pitch told, heights on that grid, a row a profile; else x and the heights of one profile."""
    if told.pitch_mm is None:
        if len(lines) > 1:
            raise InputError("heights of several profiles need one grid: give --pitch-mm and --start-mm")
        scan = lines[0]
        keep = np.isfinite(scan.y_mm)
        pairs = zip(scan.y_mm[keep], scan.z_mm[keep], strict=True)
        return ("".join(f"{y:.{_DIGITS}f},{_text(z)}\n" for y, z in pairs)).encode()
    rows = on_grid(lines, told)
    return ("".join(",".join(map(_text, row)) + "\n" for row in rows)).encode()


def _text(value: float) -> str:
    return f"{value:.{_DIGITS}f}" if np.isfinite(value) else _MISSING
