"""TOML files as data together with the line on which every key stands, for error messages that can be acted on."""

from __future__ import annotations

import re
import tomllib
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

from geometry import InputError

Location = tuple[str | int, ...]

MAX_TEXT_BYTES = 64 * 2**20  # a text file beyond this is not one of ours

_HEADER = re.compile(r"^\s*(\[\[?)\s*(.+?)\s*\]\]?\s*(#.*)?$")
_KEY = re.compile(r"""^\s*((?:"[^"]*"|'[^']*'|[A-Za-z0-9_\-]+)(?:\s*\.\s*(?:"[^"]*"|'[^']*'|[A-Za-z0-9_\-]+))*)\s*=""")


@dataclass(frozen=True)
class TomlSource:
    """A parsed TOML file: its path, its text and its data."""

    path: Path
    text: str
    data: dict[str, object]

    @cached_property
    def lines(self) -> dict[Location, int]:
        """Line number of every table and key, by its location; arrays of tables count from 0."""
        return _index(self.text)

    def where(self, location: Location) -> str:
        """``file, line n`` of the innermost part of ``location`` that stands in the text, else the file."""
        for length in range(len(location), 0, -1):
            line = self.lines.get(tuple(location[:length]))
            if line is not None:
                return f"{self.path}, line {line}"
        return str(self.path)


def read_text(path: Path) -> str:
    """The text of a UTF-8 file without byte-order mark; InputError where it is missing, empty or not text."""
    try:
        if path.is_dir():
            raise InputError(f"{path}: is a folder, a file is needed here")
        if path.stat().st_size > MAX_TEXT_BYTES:
            raise InputError(f"{path}: is larger than {MAX_TEXT_BYTES // 2**20} MB, which no file of this kind is")
        raw = path.read_bytes()
    except FileNotFoundError:
        raise InputError(f"{path}: no such file") from None
    except (OSError, ValueError) as error:
        raise InputError(f"{path}: can not be read ({getattr(error, 'strerror', None) or error})") from None
    if not raw.strip():
        raise InputError(f"{path}: the file is empty")
    try:
        return raw.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        line = raw[: error.start].count(b"\n") + 1
        raise InputError(f"{path}, line {line}: the file is not UTF-8 text (byte {error.start})") from None


def read_toml(path: Path) -> TomlSource:
    """Parse a TOML file; InputError with file and line where it can not be."""
    text = read_text(path)
    try:
        return TomlSource(path, text, tomllib.loads(text))
    except tomllib.TOMLDecodeError as error:
        found = re.search(r"line (\d+)", str(error))
        reason = re.sub(r"\s*\(at .*\)$", "", str(error))
        reason = reason[:1].lower() + reason[1:]
        if found:
            raise InputError(f"{path}, line {found[1]}: not valid TOML, {reason}") from None
        raise InputError(f"{path}, line {text.count(chr(10)) + 1}: not valid TOML, {reason}") from None


def _index(text: str) -> dict[Location, int]:
    out: dict[Location, int] = {}
    table: Location = ()
    counts: dict[Location, int] = {}
    for number, line in enumerate(text.splitlines(), start=1):
        header, key = _HEADER.match(line), _KEY.match(line)
        if key:
            location = (*table, *_parts(key[1]))
            for length in range(len(table) + 1, len(location) + 1):
                out.setdefault(location[:length], number)
        elif header:
            table = _parts(header[2])
            if header[1] == "[[":
                counts[table] = counts.get(table, -1) + 1
                out.setdefault(table, number)
                table = (*table, counts[table])
            out.setdefault(table, number)
    return out


def _parts(dotted: str) -> Location:
    found = re.findall(r"\"[^\"]*\"|'[^']*'|[^.\s]+", dotted)
    return tuple(part[1:-1] if part[0] in "\"'" else part for part in found)
