"""csv: a header with y_mm and z_mm (or x_mm for y), optional intensity, σ and the profile's number."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from geometry import InputError
from workbench.files import read_table
from workbench.profiles.scan_line import ScanLine, Told
from workbench.profiles.source import MAX_POINTS, Source

Array = NDArray[np.float64]

NAME = "csv"
_NUMBERS = ("y_mm", "x_mm", "z_mm", "intensity", "sigma_y_mm", "sigma_z_mm")
# of what `perceptron-emu profile` writes beside
_IGNORED = [
    "section",
    "u_px",
    "v_px",
    "sigma_px",
    "normal_u",
    "normal_v",
    "amplitude_dn",
    "width_px",
    "background_dn",
    "chi2_per_dof",
    "cov_yz_mm2",
    "flag",
]
_DIGITS = 6  # after the point: a nanometre


def recognises(source: Source) -> bool:
    """By a header that names a coordinate in millimetres, or a column like it."""
    if source.is_binary:
        return False
    first = next((line for line in source.head.splitlines() if line.strip() and not line.startswith("#")), "")
    words = [w.strip().strip('"').casefold() for w in first.replace(";", ",").replace("\t", ",").split(",")]
    return len(words) > 1 and any(
        w[:1] in ("x", "y", "z") and w[1:].strip(" _[]()") in ("mm", "m", "um") for w in words
    )


def read(source: Source, told: Told) -> tuple[ScanLine, ...]:
    """One profile, or as many as the column ``profile`` tells apart."""
    table = read_table(source.path, (*_NUMBERS, "profile", *_IGNORED), ("z_mm",), remark=told.remark)
    where = f"{source.path}, line {table.header_line}"
    lateral = [c for c in ("y_mm", "x_mm") if c in table.columns]
    if not lateral:
        raise InputError(f"{where}: a profile needs the column y_mm (or x_mm, which is the same here) beside z_mm")
    lateral = lateral[:1] if len(lateral) == 1 else ["y_mm"]  # a cloud in {P}: x is 0 in the sheet
    columns = [c for c in (*lateral, "z_mm", "intensity", "sigma_y_mm", "sigma_z_mm") if c in table.columns]
    plain = None if "profile" in table.columns else table.plain_numbers(columns)
    if plain is not None and len(plain) <= MAX_POINTS:
        return (_scan_line(None, plain, columns),)
    points: dict[int | None, list[list[float]]] = {}
    for count, row in enumerate(table.rows):
        number = row.whole("profile") if "profile" in table.columns else None
        values = [row.measured(c) for c in columns]
        points.setdefault(number, []).append([float("nan") if v is None else v for v in values])
        if count >= MAX_POINTS:
            raise InputError(f"{source.path}: holds more than {MAX_POINTS} points")
    if not points:
        raise InputError(f"{source.path}: holds a header but no points")
    return tuple(_scan_line(number, np.array(rows), columns) for number, rows in points.items())


def _scan_line(number: int | None, rows: Array, columns: Sequence[str]) -> ScanLine:
    values = {name: rows[:, k] for k, name in enumerate(columns)}
    lateral = "y_mm" if "y_mm" in values else "x_mm"
    more = {k: v for k, v in values.items() if k not in (lateral, "z_mm")}
    return ScanLine(values[lateral], values["z_mm"], number=number, **more)


def write(lines: Sequence[ScanLine], told: Told) -> bytes:
    """A row a point; a missing point is an empty z."""
    more = [n for n in ("intensity", "sigma_y_mm", "sigma_z_mm") if all(getattr(s, n) is not None for s in lines)]
    several = len(lines) > 1
    out = [",".join([*(["profile"] if several else []), "y_mm", "z_mm", *more])]
    for i, scan in enumerate(lines):
        number = [str(i if scan.number is None else scan.number)] if several else []
        columns = [scan.y_mm, scan.z_mm, *(getattr(scan, name) for name in more)]
        out += [",".join([*number, *map(_text, row)]) for row in zip(*columns, strict=True)]
    return ("\n".join(out) + "\n").encode()


def _text(value: float) -> str:
    return f"{value:.{_DIGITS}f}" if np.isfinite(value) else ""
