"""Tables as people have them: separators, decimal marks and encodings recognised; errors name line and column."""

from __future__ import annotations

import codecs
import csv
import difflib
import math
import re
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from itertools import islice
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from geometry import InputError, Remark, no_remark, read_bytes
from workbench.files.strict import suggestion

MAX_TABLE_BYTES = 256 * 2**20  # a points.csv of 700,000 rows has some 90 MB
NEAR = 0.75  # likeness (difflib) from which on an unknown column is taken for a misspelt one
LARGEST_NUMBER = 1e9  # of any cell: beyond it no reading, length or pixel goes
SEPARATORS = ("\t", ";", ",")
_NAMES = {"\t": "tabs", ";": "semicolons", ",": "commas"}
_LINE = re.compile(r"([^\r\n]*)(\r\n|\r|\n|$)")
_WHOLE = re.compile(r"([0-9]{1,15})(?:[.,]0*)?")  # spreadsheets write 12 as 12.0 beside empty cells
_UNIT = re.compile(r"\s*[\[(]([^\[\]()]*[^\[\]()\s][^\[\]()]*)[\])]$")
_UNITS = {"°": "deg", "degrees": "deg", "mm²": "mm2", "mm^2": "mm2"}
_OTHER_UNITS = frozenset(("m", "cm", "um", "µm", "in", "inch", "rad", "mrad", "grad", "degree", "degrees", "pixel"))
_NINES = re.compile(r"-?(9{4,}(\.9*)?|999\.99+)0*")  # 999.9 may be a length
_WORKBOOKS = (b"PK\x03\x04", b"\xd0\xcf\x11\xe0")  # how .xlsx (and other archives) and .xls begin
_MARKS = frozenset((-32768.0, 32768.0, -2147483648.0, 2147483647.0))
_PLAIN = 999.0  # what is smaller is no mark for a missing value
_BEYOND = 1e37  # ± the largest numbers of float and double


Wrong = Callable[[InputError], None]  # told of a row that can not be used


def raised(error: InputError) -> None:
    """Raise it: the ``Wrong`` of who can not go on."""
    raise error


@dataclass
class _DecimalMark:
    """Which mark a file's numbers have, and the line that told."""

    mark: str = ""
    line: int = 0


@dataclass(frozen=True)
class Row:
    """One row of a table: its cells by column name, and where it stands."""

    path: Path
    line: int
    cells: dict[str, str]
    decimal: _DecimalMark = field(default_factory=_DecimalMark)

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
        """A finite number, with a decimal point or comma; a mark for a missing value (−9999 …) is none."""
        value = self.text(column)
        number = self._parsed(column, value)
        if math.isfinite(number) and is_mark_of_missing(value, number):
            raise self.fail(column, f'"{value[:40]}" is a mark for a missing value, not a number')
        if not math.isfinite(number):
            raise self.fail(column, f'"{value[:40]}" is not a finite number')
        if abs(number) > LARGEST_NUMBER:
            raise self.fail(column, f'"{value[:40]}" is beyond all that a cell can hold ({LARGEST_NUMBER:g})')
        return number

    def optional(self, column: str) -> float | None:
        """A finite number, or None where the cell is empty or the column is absent."""
        return self.number(column) if self.cells.get(column) else None

    def measured(self, column: str) -> float | None:
        """A measured value: None where the cell is empty or absent, NaN, or holds a mark for a missing value."""
        value = self.cells.get(column)
        if not value:
            return None
        number = self._parsed(column, value)
        if math.isnan(number) or (math.isfinite(number) and is_mark_of_missing(value, number)):
            return None
        return self.number(column)

    def whole(self, column: str) -> int:
        """A whole number ≥ 0."""
        value = self.text(column)
        if not (found := _WHOLE.fullmatch(value)):
            raise self.fail(column, f'"{value[:40]}" is not a whole number ≥ 0')
        return int(found[1])

    def choice(self, column: str, allowed: Sequence[str]) -> str:
        """One of ``allowed``."""
        value = self.text(column)
        if value not in allowed:
            raise self.fail(column, f'"{value[:40]}" must be {" or ".join(allowed)}{_near(value, allowed)}')
        return value

    def _parsed(self, column: str, value: str) -> float:
        mark = "," if "," in value else "." if "." in value else ""
        if mark and mark != self.decimal.mark:
            if self.decimal.mark:
                other, line = self.decimal.mark, self.decimal.line
                raise self.fail(column, f'"{value[:40]}" has "{mark}" where numbers from line {line} on have "{other}"')
            self.decimal.mark, self.decimal.line = mark, self.line
        plain = (value.replace(",", ".", 1) if mark == "," else value).replace("−", "-")
        try:
            if "_" in plain or not plain.isascii():
                raise ValueError
            return float(plain)
        except ValueError:
            raise self.fail(column, f'"{value[:40]}" is not a number') from None


def is_mark_of_missing(text: str, number: float) -> bool:
    """Whether a cell holds what loggers write for no value: nines from 999.99 on, or an integer's or float's limit."""
    plain = text.replace(",", ".").replace("−", "-")
    return _NINES.fullmatch(plain) is not None or number in _MARKS or abs(number) > _BEYOND


@dataclass(frozen=True)
class Table:
    """A file with a header and rows; blank rows and lines that start with # are left out.

    columns: the known ones, by their own names. text, names: what ``rows`` reads from, and the known name of every
    column or nothing; rows are made one at a time, so that long tables need little memory.
    """

    path: Path
    header_line: int
    columns: tuple[str, ...]
    separator: str
    text: str = field(repr=False)
    names: tuple[str, ...] = field(repr=False)

    @property
    def rows(self) -> Iterator[Row]:
        """The rows, read anew each time."""
        return self.rows_telling(raised)

    def rows_telling(self, wrong: Wrong) -> Iterator[Row]:
        """The same but those with more cells than columns, of which ``wrong`` is told."""
        decimal = _DecimalMark()
        keep = [(i, name) for i, name in enumerate(self.names) if name]
        n = len(self.names)
        for line, cells in _cells(self.path, self.text, self.separator):
            if line <= self.header_line or not any(cells):
                continue
            if len(cells) > n and any(cells[n:]):
                wrong(InputError(self._too_many(line, cells)))
                continue
            cells.extend([""] * (n - len(cells)))  # Excel leaves out empty cells at a row's end
            yield Row(self.path, line, {name: cells[i] for i, name in keep}, decimal)

    def plain_numbers(self, columns: Sequence[str]) -> NDArray[np.float64] | None:
        """All rows' numbers (N, columns) at once; None where any cell wants a closer look: then `rows` says what is."""
        body = "".join(m[0] for m in islice(_LINE.finditer(self.text), self.header_line, None))
        known = "0123456789.eE+- \t\r\n" + self.separator
        if not body.strip() or any(c not in known for c in set(body)):
            return None
        try:
            every = np.loadtxt(body.splitlines(), delimiter=self.separator, ndmin=2, comments=None)
        except ValueError:
            return None
        found = every[:, [self.names.index(c) for c in columns]] if every.shape[1] == len(self.names) else every[:0]
        return found if len(found) and bool(np.all(np.abs(found) < _PLAIN)) else None

    def _too_many(self, line: int, cells: list[str]) -> str:
        hint = ""
        if self.separator == "," and len(cells) >= 2 * len(self.names) - 4:
            hint = "; with decimal commas the columns must be separated by semicolons or tabs"
        return f"{self.path}, line {line}: {len(cells)} values for the {len(self.names)} columns of the header{hint}"


def read_table(
    path: Path,
    known: Sequence[str],
    required: Sequence[str],
    spelling: Callable[[str], str] | None = None,
    remark: Remark = no_remark,
) -> Table:
    """A table whose columns are recognised by name.

    Parameters
    ----------
    path
        A file with a header; comma, semicolon or tab; UTF-8, UTF-16 or, where it is none of them, Windows' Latin.
    known
        The names of columns that are read. Case and brackets around a unit do not matter: ``X [mm]`` is ``x_mm``.
    required
        Those that must be there.
    spelling
        Gives the known name of a column that is written in another way, or the column as it is.
    remark
        Told in a sentence of columns that nobody knows, which are ignored, and of a doubtful encoding.

    Returns
    -------
    Table
        Its rows have the known columns alone.

    Raises
    ------
    InputError
        Naming line and column; also for an unknown column that is nearly the name of a known one that is absent.

    """
    text = read_table_text(path, remark)
    line, header, separator = _header(path, text, (*known, *required), required, spelling)
    where = f"{path}, line {line}"
    names = tuple(_known_name(cell, known, spelling) for cell in header)
    for i, name in enumerate(names):
        if name in known and name in names[:i]:
            raise InputError(f'{where}: the column "{header[i][:60]}" stands there twice')
    for cell, name in zip(header, names, strict=True):
        if name and name not in known and (near := _nearly(name, [k for k in known if k not in names])):
            raise InputError(f'{where}: unknown column "{cell[:60]}", did you mean "{near}"?')
    for column in required:
        if column not in names:
            raise InputError(f'{where}: the column "{column}" is missing{_only(header, separator)}')
    ignored = [cell[:60] for cell, name in zip(header, names, strict=True) if name not in known]
    if ignored:
        remark(f"{where}: {_listed(ignored)} unknown and ignored")
    kept = tuple(name if name in known else "" for name in names)
    return Table(path, line, tuple(filter(None, kept)), separator, text, kept)


def read_table_text(path: Path, remark: Remark = no_remark) -> str:
    """The text of a table, by its byte-order mark, else as UTF-8, else as Windows' Latin, which a remark tells."""
    raw = read_bytes(path, MAX_TABLE_BYTES)
    if not raw.strip():
        raise InputError(f"{path}: the file is empty")
    if raw.startswith(_WORKBOOKS):
        raise InputError(f"{path}: is an Excel workbook, no table of text: save the sheet as CSV")
    encoding = "utf-8-sig"
    if raw.startswith((codecs.BOM_UTF32_LE, codecs.BOM_UTF32_BE)):
        encoding = "utf-32"
    elif raw.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)):
        encoding = "utf-16"
    elif b"\0" in raw[:64]:  # UTF-16 without a mark: every other byte of plain text is 0
        encoding = "utf-16-le" if raw[1:2] == b"\0" else "utf-16-be"
    try:
        text = raw.decode(encoding)
    except UnicodeDecodeError as error:
        if encoding != "utf-8-sig":
            raise InputError(f"{path}: the file is no text (byte {error.start} is not {encoding.upper()})") from None
        text = raw.decode("latin-1")  # Windows' own differs in quotes and dashes only
        line = raw[: error.start].count(b"\n") + 1
        remark(f"{path}, line {line}: is not UTF-8; the file is read as Latin-1")
    if "\0" in text:
        raise InputError(f"{path}: the file is no text (it holds zero bytes)")
    return text


def _header(
    path: Path, text: str, known: Sequence[str], required: Sequence[str], spelling: Callable[[str], str] | None
) -> tuple[int, list[str], str]:
    """Line, cells and separator of the header: the separator that gives most known columns, then most columns."""
    best: tuple[tuple[int, int], int, list[str], str] | None = None
    wrong: InputError | None = None
    for separator in _separators(text):
        rows = _cells(path, text, separator)
        while True:
            try:
                line, cells = next(rows)
            except StopIteration:
                break
            except InputError as error:  # quoted cells that another separator divides
                wrong = wrong or error
                break
            if not any(cells) or cells[0].casefold().startswith("sep="):
                continue
            while cells and not cells[-1]:
                cells.pop()
            score = (sum(_known_name(cell, known, spelling) in known for cell in cells), len(cells))
            if best is None or score > best[0]:
                best = score, line, cells, separator
            break
    if best is None:
        if wrong is not None:
            raise wrong
        raise InputError(f"{path}: holds no header line; it begins with {','.join(required)}")
    return best[1:]


def _separators(text: str) -> Sequence[str]:
    """Excel's first line ``sep=;`` says it."""
    told = re.match(r"sep=(.)", text, re.IGNORECASE)
    return (told[1],) if told and told[1] in SEPARATORS else SEPARATORS


def _cells(path: Path, text: str, separator: str) -> Iterator[tuple[int, list[str]]]:
    """Line number and cells of every line that is neither blank nor a comment."""
    for number, match in enumerate(_LINE.finditer(text), start=1):
        line = match[1]
        if not line.strip() or line.lstrip().startswith("#"):
            continue
        if '"' not in line:
            yield number, [cell.strip() for cell in line.split(separator)]
            continue
        try:
            cells = next(csv.reader([line], delimiter=separator, skipinitialspace=True, strict=True))
        except csv.Error as error:
            raise InputError(f"{path}, line {number}: not a line of a table ({error})") from None
        yield number, [cell.strip() for cell in cells]


def _known_name(cell: str, known: Sequence[str], spelling: Callable[[str], str] | None) -> str:
    """The known column that ``cell`` names, else the cell as it is."""
    if cell in known:
        return cell
    plain = _UNIT.sub(lambda m: f"_{_UNITS.get(m[1].strip().casefold(), m[1].strip())}", cell[:200])
    for tried in (plain, spelling(cell) if spelling else plain, spelling(plain) if spelling else plain):
        for name in known:
            if tried == name or tried.casefold() == name.casefold():
                return name
    return cell


def _nearly(name: str, absent: Sequence[str]) -> str:
    """The absent column that ``name`` is likely to mean, or nothing."""
    word = name.casefold()
    if len(word) > 60:
        return ""
    stem, _, unit = word.rpartition("_")
    stems = {word, stem} if unit in _OTHER_UNITS else {word}  # the unit left out or another is the commonest slip
    longer = [k for k in absent if any(k.casefold().startswith(f"{s}_") for s in stems)]
    near = longer[:1] or difflib.get_close_matches(word, [k.casefold() for k in absent], n=1, cutoff=NEAR)
    return next((k for k in absent if near and k.casefold() == near[0].casefold()), "")


def _only(header: Sequence[str], separator: str) -> str:
    if len(header) == 1:
        return ": the columns must be separated by commas, semicolons or tabs"
    shown = ", ".join(header[:12])[:200]
    return f" (separated by {_NAMES[separator]}: {shown})"


def _listed(columns: Sequence[str]) -> str:
    shown = ", ".join(f'"{c}"' if c else "one without a name" for c in columns[:6])
    more = f" and {len(columns) - 6} more" if len(columns) > 6 else ""
    return f"the column {shown} is" if len(columns) == 1 else f"the columns {shown}{more} are"


def _near(value: str, allowed: Sequence[str]) -> str:
    text = suggestion(value, allowed)
    return text if text.startswith(", did") else ""
