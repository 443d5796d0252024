"""Tables of a gauge study as people have them: a row a measurement, or a row a part and operator with trials beside."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from geometry import InputError, Remark, no_remark
from workbench.files import Row, read_table

Array = NDArray[np.float64]

PART, OPERATOR, TRIAL, VALUE, REFERENCE = "part", "operator", "trial", "value", "reference"
_WORDS = {
    PART: (
        "parts",
        "part no",
        "part no.",
        "part number",
        "part_id",
        "sample",
        "specimen",
        "teil",
        "teil-nr.",
        "prüfling",
    ),
    OPERATOR: ("operators", "appraiser", "inspector", "prüfer", "bediener", "operator name"),
    TRIAL: ("trials", "trial no", "trial no.", "replicate", "repeat", "run", "messung", "versuch", "wiederholung"),
    VALUE: ("values", "measurement", "measured", "result", "reading", "messwert", "wert", "value_mm", "measurement_mm"),
    REFERENCE: ("master", "reference value", "reference_mm", "true value", "referenz", "referenzwert", "sollwert"),
}
_SPELT = {word: name for name, words in _WORDS.items() for word in words}
_NUMBERED = re.compile(
    r"(?:trial|measurement|messung|versuch|value|m|t|x)?[\s_#.-]*([1-9][0-9]?)(?:_mm)?", re.IGNORECASE
)
_MOST_TRIALS = 50  # columns 1 … 50 are trials
LEAST_PARTS, LEAST_TRIALS = 2, 2
MOST_ROWS = 1_000_000


@dataclass(frozen=True)
class GaugeColumns:
    """How the columns are called in the file, where they are not called what they are."""

    part: str = PART
    operator: str = OPERATOR
    trial: str = TRIAL
    value: str = VALUE
    reference: str = REFERENCE


@dataclass(frozen=True, eq=False)
class GaugeTable:
    """A balanced study: values (parts, operators, trials), names in the file's order.

    operators: empty where the table has no such column; values then have one in that place. reference: the parts' own
    values (parts,), NaN where the table states none.
    """

    parts: tuple[str, ...]
    operators: tuple[str, ...]
    values: Array
    reference: Array


@dataclass(frozen=True)
class _Measured:
    row: Row
    part: str
    operator: str
    trial: str
    value: float


def read_gauge_table(path: Path, columns: GaugeColumns | None = None, remark: Remark = no_remark) -> GaugeTable:
    """The study of a table.

    Parameters
    ----------
    path
        A row a measurement with the columns part, operator, value and perhaps trial and reference; or a row a part and
        operator, the trials beside each other in columns 1, 2, … (``trial 1``, ``M1``).
    columns
        Other names of the columns.
    remark
        Told of columns that are ignored.

    Returns
    -------
    GaugeTable

    Raises
    ------
    InputError
        Naming line and column, or the cell of the study that is missing.

    """
    named = columns or GaugeColumns()
    numbered = tuple(f"trial {k}" for k in range(1, _MOST_TRIALS + 1))
    known = (PART, OPERATOR, TRIAL, VALUE, REFERENCE, *numbered)

    def spelling(cell: str) -> str:
        for name in (PART, OPERATOR, TRIAL, VALUE, REFERENCE):
            if cell.casefold() == getattr(named, name).casefold():
                return name
        plain = " ".join(cell.casefold().split())
        if plain in _SPELT:
            return _SPELT[plain]
        found = _NUMBERED.fullmatch(cell.strip())
        return f"trial {int(found[1])}" if found and int(found[1]) <= _MOST_TRIALS else cell

    table = read_table(path, known, (PART,), spelling, remark)
    wide = [name for name in numbered if name in table.columns]
    if VALUE not in table.columns and len(wide) < LEAST_TRIALS:
        asked = f'"{named.value}"'
        raise InputError(
            f"{path}, line {table.header_line}: the column {asked} is missing: a study has the columns part, operator "
            "and value, or the trials beside each other in columns 1, 2, …; --value NAME names another column"
        )
    if VALUE in table.columns and wide:
        raise InputError(
            f"{path}, line {table.header_line}: a column of values and columns of trials ({wide[0]}) stand side by "
            "side: only one of both can be meant"
        )
    with_operators = OPERATOR in table.columns
    cells, references = _measurements(path, table.rows, wide, with_operators)
    if not cells:
        raise InputError(f"{path}: holds no measurements, only a header")
    return _balanced(path, cells, references, with_operators)


def _measurements(
    path: Path, rows: Iterator[Row], wide: Sequence[str], with_operators: bool
) -> tuple[list[_Measured], dict[str, float]]:
    out: list[_Measured] = []
    references: dict[str, float] = {}
    for row in rows:
        part = row.text(PART)
        operator = row.text(OPERATOR) if with_operators else ""
        stated = row.optional(REFERENCE)
        if stated is not None and references.setdefault(part, stated) != stated:
            raise row.fail(REFERENCE, f'part "{part}" has the reference {references[part]:g} in a line before')
        if wide:
            out += [_Measured(row, part, operator, name, row.number(name)) for name in wide]
        else:
            out.append(_Measured(row, part, operator, row.cells.get(TRIAL, ""), row.number(VALUE)))
        if len(out) > MOST_ROWS:
            raise InputError(f"{path}: holds more than {MOST_ROWS:,} measurements")
    return out, references


def _balanced(path: Path, cells: Sequence[_Measured], references: dict[str, float], with_operators: bool) -> GaugeTable:
    """The values as an array; InputError where a cell is missing or has another number of trials than the rest."""
    parts = tuple(dict.fromkeys(m.part for m in cells))
    operators = tuple(dict.fromkeys(m.operator for m in cells))
    found: dict[tuple[str, str], list[float]] = {}
    seen: dict[tuple[str, str, str], int] = {}
    for m in cells:
        if m.trial:
            before = seen.setdefault((m.part, m.operator, m.trial), m.row.line)
            if before != m.row.line:
                raise m.row.fail(TRIAL, f'trial "{m.trial}" of {_cell(m.part, m.operator)} stands in line {before} too')
        found.setdefault((m.part, m.operator), []).append(m.value)
    if len(parts) < LEAST_PARTS:
        raise InputError(
            f'{path}: holds one part only ("{parts[0]}"): what parts differ by needs at least {LEAST_PARTS}, better '
            "ten; one part measured again and again is judged by accept repeat"
        )
    if with_operators and len(operators) < 2:
        raise InputError(
            f'{path}: the column operator names one operator only ("{operators[0]}"): what operators differ by (AV) '
            "needs at least two; leave the column out for a gauge that nobody handles (EV and PV alone)"
        )
    counts = [len(v) for v in found.values()]
    usual = max(set(counts), key=lambda n: (counts.count(n), n))
    for part in parts:
        for operator in operators:
            n = len(found.get((part, operator), ()))
            if n != usual:
                there = "is missing" if n == 0 else f"has {n} trial{'s' * (n != 1)}"
                raise InputError(
                    f"{path}: {_cell(part, operator)} {there}, where others have {usual}: analysis of variance "
                    "needs as many trials in every cell; measure what is missing, or leave that part out"
                )
    if usual < LEAST_TRIALS:
        raise InputError(
            f"{path}: every part was measured once{' by each operator' * with_operators}: repeatability needs at least "
            f"{LEAST_TRIALS} trials"
        )
    values = np.array([[found[part, operator] for operator in operators] for part in parts])
    _check_spread(path, values)
    reference = np.array([references.get(part, np.nan) for part in parts])
    return GaugeTable(parts, operators if with_operators else (), values, reference)


def _check_spread(path: Path, values: Array) -> None:
    if np.all(values == values.flat[0]):
        raise InputError(f"{path}: all {values.size} values are {values.flat[0]:g}: nothing can be told from constants")
    if np.all(values == values[:, :, :1]):
        raise InputError(
            f"{path}: the trials of every part agree to the last digit: either they were copied, or the gauge's step "
            "is coarser than its repeatability, which can then not be told"
        )


def _cell(part: str, operator: str) -> str:
    return f'part "{part[:40]}"' + (f' by operator "{operator[:40]}"' if operator else "")
