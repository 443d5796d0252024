"""Joint readings of a ball in its sockets, one file a socket."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from calib.closure import Socket
from geometry import InputError
from workbench.files.tables.table import read_table_text

MOST_RADIANS = 4 * np.pi  # two turns either way: no reading of an arm is larger
LEAST_ROWS = 3


def read_sockets(paths: Sequence[Path], n_joints: int, *, degrees: bool) -> list[Socket]:
    """Sockets of CSV files without a header; the folder's name is the location, the file's the socket."""
    return [Socket(p.resolve().parent.name, p.stem, _read(p, n_joints, degrees=degrees)) for p in paths]


def _read(path: Path, n_joints: int, *, degrees: bool) -> np.ndarray:
    text = read_table_text(path)
    separator = next((mark for mark in "\t;" if mark in text), ",")
    rows = []
    for number, line in enumerate(text.splitlines(), start=1):
        cells = [cell.strip() for cell in line.split(separator)]
        if not any(cells):
            continue
        while not cells[-1]:
            cells.pop()
        try:
            row = [float(cell if separator == "," else cell.replace(",", ".", 1)) for cell in cells]
        except ValueError as error:
            raise InputError(f"{path}, line {number}: a value is not a number ({str(error)[:80]})") from None
        if len(row) != n_joints or not np.all(np.isfinite(row)):
            raise InputError(f"{path}, line {number}: {len(row)} values, where {n_joints} finite joint readings belong")
        rows.append(row)
    if not rows:
        raise InputError(f"{path}: holds no joint readings")
    values = np.array(rows)
    largest = float(np.max(np.abs(values)))
    if not degrees and largest > MOST_RADIANS:
        raise InputError(
            f"{path}: reads up to {largest:.4g}, more than two turns in radians: say --degrees, if they are"
        )
    if degrees and len(values) >= LEAST_ROWS and 0.01 < largest <= 2 * np.pi:
        raise InputError(f"{path}: no joint reads more than {largest:.3g}°, as if in radians: leave --degrees away")
    return np.deg2rad(values) if degrees else values
