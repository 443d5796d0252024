"""One profile file as another."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

from geometry import InputError, Remark, no_remark
from geometry.sensor import AUTO
from workbench.files import write_text
from workbench.profiles.files import WRITERS, check_format, read_scan_lines, write_scan_lines
from workbench.profiles.formats.keyence_lj_x import fitting_unit
from workbench.profiles.resampled import on_grid
from workbench.profiles.scan_line import ScanLine, Told

_BY_SUFFIX = {".csv": "csv", ".ply": "ply", ".npy": "npy", ".yml": "opencv_yaml", ".yaml": "opencv_yaml", ".xyz": "xyz"}


def convert(
    source: Path,
    out: Path,
    to_format: str | None = None,
    from_format: str = AUTO,
    pitch_mm: float | None = None,
    start_mm: float | None = None,
    unit: int | None = None,
    width: int | None = None,
    remark: Remark = no_remark,
) -> str:
    """Write the profiles of a file in another format; returns a sentence on what was done.

    Parameters
    ----------
    source, out
        The files; they must not be one.
    to_format, from_format
        Names of formats; by OUT's suffix and IN's own signature where they are not given.
    pitch_mm, start_mm
        Lateral step and start, of whichever of the two formats has no lateral coordinates.
    unit, width
        Of Keyence's counts, and of raw files.
    remark
        Told what was noticed.

    Raises
    ------
    InputError
        Where the input can not be read or the format not hold it.

    """
    if pitch_mm is not None and not 0 < pitch_mm < np.inf:
        raise InputError(f"--pitch-mm {pitch_mm:g}: must be positive and finite")
    if start_mm is not None and not np.isfinite(start_mm):
        raise InputError(f"--start-mm {start_mm:g}: must be finite")
    if unit is not None and not 0 < unit < 10**6:
        raise InputError(f"--unit {unit}: must be 1 … 999999 hundredths of a micrometre")
    name = to_format or _BY_SUFFIX.get(out.suffix.lower())
    if name is None:
        raise InputError(f"{out}: its name tells no format: give --format, one of {', '.join(WRITERS)}")
    check_format(name, WRITERS)
    if out.exists() and source.exists() and out.samefile(source):
        raise InputError(f"{out}: is the input itself; give another name")
    told = Told(from_format, pitch_mm, start_mm, unit, width, remark)
    lines = read_scan_lines(source, told)
    write = replace(told, format=name)
    if name == "keyence_lj_x":
        write = replace(write, unit=unit or fitting_unit(on_grid(lines, write)), start_mm=_start(lines, start_mm))
    write_scan_lines(out, lines, write)
    if name == "keyence_lj_x":
        tables = {"unit": write.unit, "pitch_mm": write.pitch_mm, "start_mm": write.start_mm}
        write_text(out.with_suffix(".toml"), "".join(f"{k} = {v}\n" for k, v in tables.items()))
    points = sum(int(np.count_nonzero(scan.present)) for scan in lines)
    several = "" if len(lines) == 1 else f"{len(lines)} profiles, "
    return f"{out}: {name}, {several}{points} points, {sum(map(len, lines)) - points} missing"


def _start(lines: tuple[ScanLine, ...], start_mm: float | None) -> float:
    laid = [scan.y_mm[np.isfinite(scan.y_mm)] for scan in lines]
    return start_mm if start_mm is not None else float(min(y.min() for y in laid if len(y)))
