"""Joint readings of a ball in its sockets, one file a socket."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from calib.closure import Socket
from geometry import InputError


def read_sockets(paths: Sequence[Path], n_joints: int, *, degrees: bool) -> list[Socket]:
    """Sockets of CSV files without a header; the folder's name is the location, the file's the socket."""
    return [Socket(p.resolve().parent.name, p.stem, _read(p, n_joints, degrees=degrees)) for p in paths]


def _read(path: Path, n_joints: int, *, degrees: bool) -> np.ndarray:
    try:
        lines = path.read_text(encoding="utf-8").splitlines()
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(f"{path}: can not be read as text ({error})") from error
    rows = []
    for number, line in enumerate(lines, start=1):
        if not line.strip():
            continue
        try:
            row = [float(x) for x in line.split(",")]
        except ValueError as error:
            raise InputError(f"{path}, line {number}: a value is not a number ({error})") from error
        if len(row) != n_joints or not np.all(np.isfinite(row)):
            raise InputError(f"{path}, line {number}: {len(row)} values, where {n_joints} finite joint readings belong")
        rows.append(row)
    if not rows:
        raise InputError(f"{path}: holds no joint readings")
    return np.deg2rad(rows) if degrees else np.array(rows)
