"""Profile files read and written: a format by its name or by its own signature."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from types import ModuleType

import numpy as np

from geometry import InputError, did_you_mean
from geometry.sensor import AUTO
from workbench.files import write_bytes
from workbench.profiles.formats import (
    csv_points,
    genicam,
    gocator,
    keyence_csv,
    keyence_lj_v,
    keyence_lj_x,
    npy_points,
    opencv_yaml,
    pcd,
    ply,
    sick,
    wenglor,
    xyz,
)
from workbench.profiles.scan_line import ScanLine, Told
from workbench.profiles.source import Source, open_source

# in the order in which they are tried: those with a signature of their own before those that are numbers alone
_FORMATS: tuple[ModuleType, ...] = (
    ply, pcd, sick, genicam, keyence_lj_x, keyence_lj_v, npy_points, gocator, opencv_yaml, wenglor, csv_points, xyz,
    keyence_csv,
)  # fmt: skip
_MARK = 1e30  # the limits of float and double are marks of missing points
_FARTHEST_MM = 1e5
_LONGEST_HEADER = 200  # characters that a sentence can repeat
Reader = Callable[[Source, Told], tuple[ScanLine, ...]]
READERS: dict[str, Reader] = {m.NAME: m.read for m in _FORMATS}
WRITERS: dict[str, Callable[[Sequence[ScanLine], Told], bytes]] = {
    m.NAME: m.write for m in _FORMATS if hasattr(m, "write")
}


def recognise(source: Source) -> str:
    """The format of a file by its own signature; InputError where none fits."""
    for module in _FORMATS:
        if module.recognises(source):
            return str(module.NAME)
    hint = " (an array of other numbers than a profile's)" if source.data.startswith(b"\x93NUMPY") else ""
    if source.data.startswith(b"PK\x03\x04"):
        raise InputError(f"{source.path}: is an Excel workbook or another archive, no profile: save the sheet as CSV")
    head = _header(source)
    if head:
        raise InputError(
            f"{source.path}: its first line, {head}, names no columns that are known: a csv of points needs a header "
            "with y_mm (or x_mm, which is the same here) and z_mm; a maker's own format is named by --format or "
            f"[profile] format, one of {', '.join(sorted(READERS))}"
        )
    raise InputError(
        f"{source.path}: is in no profile format that is recognised{hint}; name it by --format or [profile] format, "
        f"one of {', '.join(sorted(READERS))}"
    )


def _header(source: Source) -> str:
    """The first line of a text of several columns, where its cells are words; "" else."""
    if source.is_binary:
        return ""
    first = next((line.strip() for line in source.head.splitlines() if line.strip()), "")
    cells = [c for c in re.split(r"[,;\t]", first) if c.strip()]
    if len(cells) < 2 or len(first) > _LONGEST_HEADER or not all(c.strip().strip('"')[:1].isalpha() for c in cells):
        return ""
    return f'"{first}"'


def read_scan_lines(path: Path, told: Told | None = None) -> tuple[ScanLine, ...]:
    """The profiles of a file.

    Parameters
    ----------
    path
        The file.
    told
        What is known beside it.

    Returns
    -------
    tuple of ScanLine
        One or more, in the file's order; missing points are NaN.

    Raises
    ------
    InputError
        Where the format is unknown or the file is not of it, in one sentence.

    """
    told = told or Told()
    if told.format != AUTO:
        check_format(told.format, READERS)
    source = open_source(path)
    name = recognise(source) if told.format == AUTO else told.format
    found = tuple(_checked(scan, path) for scan in READERS[name](source, replace(told, format=name)))
    if not any(np.any(scan.present) for scan in found):
        raise InputError(f"{path}: all points of {'its profile' if len(found) == 1 else 'all profiles'} are missing")
    return found


def _checked(scan: ScanLine, path: Path) -> ScanLine:
    """A profile whose numbers can be lengths: the limits of float are marks of missing, other huge ones are refused."""
    y, z = (np.where(np.abs(v) < _MARK, v, np.nan) for v in (scan.y_mm, scan.z_mm))
    with np.errstate(invalid="ignore"):
        huge = (np.abs(y) > _FARTHEST_MM) | (np.abs(z) > _FARTHEST_MM)
    if np.any(huge):
        k = int(np.argmax(huge))
        raise InputError(
            f"{path}: {np.count_nonzero(huge)} of {len(scan)} points lie beyond all that a line sensor measures, "
            f"such as (y, z) = ({y[k]:.6g}, {z[k]:.6g}) mm: check the units and the marks of missing points"
        )
    return replace(scan, y_mm=y, z_mm=z)


def write_scan_lines(path: Path, lines: Sequence[ScanLine], told: Told) -> None:
    """Write profiles in the format told, whole or not at all; InputError where the format can not hold them."""
    check_format(told.format, WRITERS)
    write_bytes(path, WRITERS[told.format](lines, told))


def check_format(name: str, known: Mapping[str, object]) -> None:
    """InputError where a name is no format."""
    if name not in known:
        near = did_you_mean(name, list(known)) or f" (known: {', '.join(known)})"
        raise InputError(f'the profile format "{name}" is unknown{near}')
