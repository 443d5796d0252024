"""npy: an array of points (y, z) in mm, (N, 2), or (P, N, 2) of several profiles; NaN is missing."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from geometry import InputError
from workbench.profiles.counts import npy_bytes
from workbench.profiles.scan_line import ScanLine, Told
from workbench.profiles.source import Source

NAME = "npy"


def recognises(source: Source) -> bool:
    """By an array of floating-point pairs."""
    if not source.data.startswith(b"\x93NUMPY"):
        return False
    array = source.array
    return array.dtype.kind == "f" and array.ndim in (2, 3) and array.shape[-1] == 2


def read(source: Source, told: Told) -> tuple[ScanLine, ...]:
    """One profile, or the first axis' number of them."""
    if not recognises(source):
        raise InputError(f"{source.path}: an array of pairs (y, z), of shape (N, 2) or (P, N, 2), is right")
    array = source.array.astype(float)
    profiles = array[None] if array.ndim == 2 else array
    return tuple(
        ScanLine(p[:, 0].copy(), p[:, 1].copy(), number=None if array.ndim == 2 else k) for k, p in enumerate(profiles)
    )


def write(lines: Sequence[ScanLine], told: Told) -> bytes:
    """Shorter profiles are filled up with NaN."""
    n = max(map(len, lines))
    out = np.full((len(lines), n, 2), np.nan)
    for k, scan in enumerate(lines):
        out[k, : len(scan)] = np.column_stack([scan.y_mm, scan.z_mm])
    return npy_bytes(out[0] if len(lines) == 1 else out)
