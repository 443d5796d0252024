"""What the tests of the command line share."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any


@dataclass(frozen=True)
class Outcome:
    """What one call of the command line did."""

    code: int
    out: str
    err: str

    @property
    def json(self) -> Any:
        """Standard output as one JSON object without NaN."""

        def refuse(name: str) -> float:
            raise AssertionError(f"{name} in the JSON")

        return json.loads(self.out, parse_constant=refuse)


Cli = Callable[..., Outcome]


def edit(path: Path, old: str, new: str) -> None:
    """Replace text that stands in the file once or more."""
    text = path.read_text(encoding="utf-8")
    assert old in text
    path.write_text(text.replace(old, new, 1), encoding="utf-8")


def line_of(path: Path, part: str) -> int:
    """The number of the first line that holds ``part``."""
    return next(i for i, line in enumerate(path.read_text().splitlines(), start=1) if part in line)
