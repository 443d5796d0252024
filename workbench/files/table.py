"""Comma-separated files: header, rows with their line numbers, numbers checked, errors that name line and column."""

from __future__ import annotations

import csv
import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from geometry import InputError
from workbench.files.strict import suggestion
from workbench.files.toml_text import read_text


@dataclass(frozen=True)
class Row:
    """One row of a table: its cells by column name, and where it stands."""

    path: Path
    line: int
    cells: dict[str, str]

    def fail(self, column: str, what: str) -> InputError:
        """The error that ``column`` of this row is not right."""
        return InputError(f"{self.path}, line {self.line}, column {column}: {what}")

    def text(self, column: str) -> str:
        """A cell that must not be empty."""
        value = self.cells[column]
        if not value:
            raise self.fail(column, "is empty")
        return value

    def number(self, column: str) -> float:
        """A finite number."""
        value = self.text(column)
        try:
            number = float(value)
        except ValueError:
            raise self.fail(column, f'"{value}" is not a number') from None
        if not math.isfinite(number) or "_" in value:
            raise self.fail(column, f'"{value}" is not a finite number')
        return number

    def optional(self, column: str) -> float | None:
        """A finite number, or None where the cell is empty or the column is absent."""
        return self.number(column) if self.cells.get(column) else None

    def whole(self, column: str) -> int:
        """A whole number ≥ 0."""
        value = self.text(column)
        if not (value.isascii() and value.isdigit()) or len(value) > 15:
            raise self.fail(column, f'"{value}" is not a whole number ≥ 0')
        return int(value)

    def choice(self, column: str, allowed: Sequence[str]) -> str:
        """One of ``allowed``."""
        value = self.text(column)
        if value not in allowed:
            raise self.fail(column, f'"{value}" must be {" or ".join(allowed)}{_near(value, allowed)}')
        return value


@dataclass(frozen=True)
class CsvTable:
    """A comma-separated file: column names and rows; blank lines and lines that start with # are left out."""

    path: Path
    header_line: int
    columns: tuple[str, ...]
    rows: tuple[Row, ...]


def read_table(path: Path, known: Sequence[str], required: Sequence[str]) -> CsvTable:
    """Read a table whose columns all stand in ``known`` and include ``required``; InputError names line and column."""
    lines = _cells(path)
    header_line, header = next(lines, (0, []))
    if not header:
        raise InputError(f"{path}: holds no header line; it begins with {','.join(required)}")
    where = f"{path}, line {header_line}"
    if len(header) == 1 and any(mark in header[0] for mark in ";\t"):
        raise InputError(f"{where}: the columns must be separated by commas")
    for i, column in enumerate(header):
        if column in header[:i]:
            raise InputError(f'{where}: the column "{column}" stands there twice')
        if column not in known:
            raise InputError(f'{where}: unknown column "{column}"{suggestion(column, known)}')
    missing = [column for column in required if column not in header]
    if missing:
        raise InputError(f'{where}: the column "{missing[0]}" is missing')
    rows = tuple(Row(path, line, _fit(path, line, header, cells)) for line, cells in lines)
    return CsvTable(path, header_line, tuple(header), rows)


def _fit(path: Path, line: int, header: list[str], cells: list[str]) -> dict[str, str]:
    if len(cells) != len(header):
        raise InputError(f"{path}, line {line}: {len(cells)} values for the {len(header)} columns of the header")
    return dict(zip(header, cells, strict=True))


def _cells(path: Path) -> Iterator[tuple[int, list[str]]]:
    text = read_text(path)
    for number, line in enumerate(text.splitlines(), start=1):
        if not line.strip() or line.lstrip().startswith("#"):
            continue
        try:
            cells = next(csv.reader([line], skipinitialspace=True, strict=True))
        except csv.Error as error:
            raise InputError(f"{path}, line {number}: not a comma-separated line ({error})") from None
        yield number, [cell.strip() for cell in cells]


def _near(value: str, allowed: Sequence[str]) -> str:
    text = suggestion(value, allowed)
    return text if text.startswith(", did") else ""
