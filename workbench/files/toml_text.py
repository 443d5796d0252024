"""TOML files as data together with the line on which every key stands, for error messages that can be acted on."""

from __future__ import annotations

import re
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

from geometry import parse_toml, read_text

Location = tuple[str | int, ...]

LONGEST_LINE = 2000  # whose key is looked for: beyond it no line of ours goes

# each character fits one part of a pattern only, so that hostile lines take no longer than others
_HEADER = re.compile(r"""^\s*(\[\[?)((?:"[^"]*"|'[^']*'|[^\]"'#])+)\]\]?\s*(#.*)?$""")
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


def read_toml(path: Path) -> TomlSource:
    """Parse a TOML file; InputError with file and line where it can not be."""
    text = read_text(path)
    return TomlSource(path, text, parse_toml(text, str(path)))


def _index(text: str) -> dict[Location, int]:
    out: dict[Location, int] = {}
    table: Location = ()
    counts: dict[Location, int] = {}
    for number, line in enumerate(text.splitlines(), start=1):
        if len(line) > LONGEST_LINE and line.lstrip().startswith("["):
            continue
        header, key = _HEADER.match(line), _KEY.match(line[:LONGEST_LINE])
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
