"""Profiles of standards by their equations: balls, a plane, whatever stands behind them, with white noise."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

PITCH_MM = 0.15
TABLE_MM = 90.0
Ball = tuple[float, float, float, float]  # x, y, z of the centre, radius


def across(
    balls: Sequence[Ball],
    x: float,
    half_mm: float = 25.0,
    noise_mm: float = 0.0,
    rng: np.random.Generator | None = None,
    *,
    table: bool = False,
) -> np.ndarray:
    """Points (y, z) of a sheet at x: the balls up to 64° of slope, and where asked a table behind them."""
    y = np.arange(-half_mm, half_mm, PITCH_MM)
    z = np.full_like(y, TABLE_MM)
    for cx, cy, cz, radius in balls:
        square = radius**2 - (x - cx) ** 2
        seen = (y - cy) ** 2 < 0.8 * square
        if square > 0.1 * radius**2:
            z[seen] = cz - np.sqrt(square - (y[seen] - cy) ** 2)
    if rng is not None:
        z = z + noise_mm * rng.standard_normal(len(y))
    out = np.column_stack([y, z])
    return out if table else out[out[:, 1] < TABLE_MM - 1]


def write(folder: Path, profiles: Sequence[np.ndarray]) -> Path:
    """A CSV file for each."""
    folder.mkdir()
    for k, yz in enumerate(profiles):
        rows = "\n".join(f"{y:.6f},{z:.6f}" for y, z in yz)
        (folder / f"p{k:03d}.csv").write_text(f"y_mm,z_mm\n{rows}\n", encoding="utf-8")
    return folder
