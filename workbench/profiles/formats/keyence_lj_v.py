"""keyence_lj_v: 20-bit signed counts of 0.01 µm in 32 bits, as .npy or raw; the lowest four are marks for missing."""

from __future__ import annotations

import numpy as np

from workbench.profiles.counts import as_rows, beside
from workbench.profiles.scan_line import ScanLine, Told
from workbench.profiles.source import Source

NAME = "keyence_lj_v"
_MM = 1e-5  # a count
_MARKS = np.array([-524288, -524287, -524286, -524285, *(-(2**31) + k for k in range(4))])  # none, dead zone, waiting


def recognises(source: Source) -> bool:
    """By an array of signed 32-bit numbers."""
    return source.data.startswith(b"\x93NUMPY") and source.array.dtype.kind == "i" and source.array.dtype.itemsize == 4


def read(source: Source, told: Told) -> tuple[ScanLine, ...]:
    """One profile a row; pitch and start as told, or of a .toml of the same name beside the file."""
    told = beside(source, told)
    counts = as_rows(source, told, np.dtype("<i4"))
    y = told.lateral(counts.shape[1], source.path)
    z = np.where(np.isin(counts, _MARKS), np.nan, counts.astype(float) * _MM)
    return tuple(ScanLine(y, row, number=None if len(z) == 1 else k) for k, row in enumerate(z))
