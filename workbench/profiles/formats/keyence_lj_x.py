"""keyence_lj_x: 16-bit counts of the LJ-X8000's simple array, as .npy or raw; 0 is missing.

z = (count − 32768) · unit / 100 µm, x = (start + i · pitch) / 100 µm (LJX8IF's ZUnit, lXStart, lXPitch).
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from geometry import InputError
from workbench.profiles.counts import as_rows, beside, npy_bytes
from workbench.profiles.resampled import on_grid
from workbench.profiles.scan_line import ScanLine, Told
from workbench.profiles.source import Source

NAME = "keyence_lj_x"
_ZERO = 32768
HUNDREDTH_UM = 1e-5  # in mm
_UNITS = (1, 2, 4, 5, 8, 10, 20, 40, 50, 80, 100, 160, 200, 400, 500, 800, 1000, 2000, 4000, 8000, 10000)


def recognises(source: Source) -> bool:
    """By an array of unsigned 16-bit numbers."""
    return source.data.startswith(b"\x93NUMPY") and source.array.dtype.kind == "u" and source.array.dtype.itemsize == 2


def read(source: Source, told: Told) -> tuple[ScanLine, ...]:
    """One profile a row; unit, pitch and start as told, or of a .toml of the same name beside the file."""
    told = beside(source, told)
    counts = as_rows(source, told, np.dtype("<u2"))
    if told.unit is None:
        raise InputError(
            f"{source.path}: the counts of this format need their unit (hundredths of a micrometre, the library's "
            "ZUnit): give --unit, or [profile] unit in sensor.toml"
        )
    y = told.lateral(counts.shape[1], source.path)
    z = np.where(counts == 0, np.nan, (counts.astype(float) - _ZERO) * told.unit * HUNDREDTH_UM)
    return tuple(ScanLine(y, row, number=None if len(z) == 1 else k) for k, row in enumerate(z))


def write(lines: Sequence[ScanLine], told: Told) -> bytes:
    """Counts on the grid that is told, in the unit told, else the finest that holds all heights."""
    heights = on_grid(lines, told)
    unit = told.unit or fitting_unit(heights)
    counts = np.rint(heights / (unit * HUNDREDTH_UM)) + _ZERO
    bad = np.isfinite(counts) & ((counts < 1) | (counts > 65535))
    if np.any(bad):
        raise InputError(f"z = {heights[bad][0]:g} mm is beyond what 16 bits hold in units of {unit / 100:g} µm")
    return npy_bytes(np.where(np.isfinite(counts), counts, 0).astype("<u2"))


def fitting_unit(heights: np.ndarray) -> int:
    """The finest usual unit that holds all heights (hundredths of a micrometre)."""
    reach = float(np.nanmax(np.abs(heights))) if np.any(np.isfinite(heights)) else 0.0
    for unit in _UNITS:
        if reach <= (_ZERO - 2) * unit * HUNDREDTH_UM:
            return unit
    raise InputError(f"z = {reach:g} mm is beyond what this format holds")
