"""xyz: a point a line, x y z and what else there is, separated by blanks, commas, semicolons or tabs."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from geometry import InputError
from workbench.profiles.cloud import profiles_of_cloud
from workbench.profiles.grid import cells_of, is_numeric
from workbench.profiles.scan_line import ScanLine, Told
from workbench.profiles.source import Source

NAME = "xyz"


def recognises(source: Source) -> bool:
    """By lines of three numbers or more with blanks between them, or by its name."""
    if source.is_binary:
        return False
    try:
        cells = cells_of("\n".join(source.text.splitlines()[:20]), source.path)
    except InputError:
        return False
    named = source.path.suffix.lower() in (".xyz", ".asc", ".pts")
    if not (named or cells.separator == " ") or not all(3 <= len(row) <= 12 for row in cells.rows):
        return False
    return is_numeric(cells, 20)


def read(source: Source, told: Told) -> tuple[ScanLine, ...]:
    """One profile, or as many as the travel tells apart."""
    numbers = cells_of(source.text, source.path).numbers()
    short = next((k for k, row in enumerate(numbers) if len(row) < 3), None)
    if short is not None:
        raise InputError(f"{source.path}: row {short + 1} has fewer than three numbers")
    return profiles_of_cloud(np.array([row[:3] for row in numbers]), source.path)


def write(lines: Sequence[ScanLine], told: Told) -> bytes:
    """Points (0, y, z); of several profiles the first column is the profile's place."""
    rows = [
        f"{k} {_text(y)} {_text(z)}" for k, scan in enumerate(lines) for y, z in zip(scan.y_mm, scan.z_mm, strict=True)
    ]
    return ("\n".join(rows) + "\n").encode()


def _text(value: float) -> str:
    return f"{value:.9g}" if np.isfinite(value) else "nan"
