"""Heights on an even lateral grid, for formats that hold nothing else."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from geometry import InputError
from workbench.profiles.scan_line import ScanLine, Told

Array = NDArray[np.float64]

_ON_GRID = 1e-3  # of a pitch: such points stand on the grid, nothing is interpolated
_MOST_COLUMNS = 200_000
_BRIDGED = 1.5  # steps of the finer of grid and profile: a wider gap stays one


def on_grid(lines: Sequence[ScanLine], told: Told) -> Array:
    """Heights (P, N) at start + i · pitch, N up to the last point of all; NaN where a profile has no neighbours.

    Points on the grid are taken as they are, between others z is interpolated linearly.
    """
    pitch = told.pitch_mm
    if pitch is None:
        raise InputError("a grid of heights needs --pitch-mm and --start-mm")
    points = [np.column_stack([s.y_mm, s.z_mm])[s.present] for s in lines]
    reach = [p[:, 0] for p in points if len(p)]
    laid = [s.y_mm[np.isfinite(s.y_mm)] for s in lines]
    low = min((float(y.min()) for y in laid if len(y)), default=0.0)
    high = max((float(y.max()) for y in laid if len(y)), default=0.0)
    start = told.start_mm if told.start_mm is not None else low
    columns = round((high - start) / pitch) + 1
    if reach and min(float(y.min()) for y in reach) < start - pitch / 2:
        raise InputError(f"--start-mm {start:g} lies inside the profile, which begins at {low:g} mm")
    if not 1 <= columns <= _MOST_COLUMNS:
        raise InputError(
            f"a grid from {start:g} mm by {pitch:g} mm has {columns} columns: check --pitch-mm, --start-mm"
        )
    return np.array([_heights(p, np.asarray(start + pitch * np.arange(columns), dtype=float), pitch) for p in points])


def _heights(points: Array, grid: Array, pitch: float) -> Array:
    out = np.full(len(grid), np.nan)
    if len(points) == 0:
        return out
    y, z = points[np.argsort(points[:, 0], kind="stable")].T
    column = (y - grid[0]) / pitch
    nearest = np.rint(column).astype(np.intp)
    if np.max(np.abs(column - nearest)) <= _ON_GRID:
        inside = (nearest >= 0) & (nearest < len(grid))
        out[nearest[inside]] = z[inside]
        return out
    if len(y) < 2:
        return out
    widest = _BRIDGED * max(pitch, float(np.median(np.diff(y))))
    after = np.clip(np.searchsorted(y, grid), 1, len(y) - 1)
    step = y[after] - y[after - 1]
    t = (grid - y[after - 1]) / np.where(step > 0, step, 1.0)
    good = (t >= 0) & (t <= 1) & (step <= widest)
    out[good] = (z[after - 1] + t * (z[after] - z[after - 1]))[good]
    return out
