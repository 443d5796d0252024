"""A profile as a maker's sensor delivers it, and what must be told beside a file that does not tell it."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from geometry import InputError, Remark, no_remark

Array = NDArray[np.float64]

# of the files that are written, by their format
SUFFIXES = {
    "csv": ".csv", "gocator": ".csv", "keyence_csv": ".csv", "ply": ".ply", "npy": ".npy", "keyence_lj_x": ".npy",
    "opencv_yaml": ".yml", "xyz": ".xyz",
}  # fmt: skip


@dataclass(frozen=True, eq=False)
class ScanLine:
    """One profile in its maker's frame: lateral y, depth z; NaN where a point is missing.

    Parameters
    ----------
    y_mm, z_mm : ndarray (N,)
        In the order of the file; z as the maker counts it.
    intensity : ndarray (N,) or None
        In the maker's units.
    sigma_y_mm, sigma_z_mm : ndarray (N,) or None
        Where the file states them.
    number : int or None
        As the file counts its profiles; None where it does not.
    range_mm : ndarray (2, 2) or None
        Least and largest y and z that the sensor measures, where the file says so.
    """

    y_mm: Array
    z_mm: Array
    intensity: Array | None = None
    sigma_y_mm: Array | None = None
    sigma_z_mm: Array | None = None
    number: int | None = None
    range_mm: Array | None = None

    def __post_init__(self) -> None:
        n = len(self.y_mm)
        for name in ("z_mm", "intensity", "sigma_y_mm", "sigma_z_mm"):
            value = getattr(self, name)
            if value is not None and np.shape(value) != (n,):
                raise InputError(f"a profile of {n} points has {name} of shape {np.shape(value)}")

    def __len__(self) -> int:
        """The number of points, missing ones too."""
        return len(self.y_mm)

    @property
    def present(self) -> NDArray[np.bool_]:
        """Which points (N,) are there."""
        return np.asarray(np.isfinite(self.y_mm) & np.isfinite(self.z_mm))


@dataclass(frozen=True)
class Told:
    """What the user tells of a file beside it.

    Parameters
    ----------
    format : str
        A name of READERS, or "auto".
    pitch_mm, start_mm : float or None
        Lateral step and start, for formats without lateral coordinates.
    unit : int or None
        Of Keyence LJ-X's counts, in hundredths of a micrometre, as its library says.
    width : int or None
        Points of a profile in a file without a header.
    remark : callable
        Told in one sentence what was noticed and not refused.
    """

    format: str = "auto"
    pitch_mm: float | None = None
    start_mm: float | None = None
    unit: int | None = None
    width: int | None = None
    remark: Remark = field(default=no_remark, compare=False)

    def lateral(self, n: int, path: Path) -> Array:
        """The y (n,) of evenly spaced points; InputError where their pitch is not told."""
        if self.pitch_mm is None:
            raise InputError(
                f"{path}: the format has no lateral coordinates: give --pitch-mm and --start-mm, or [profile] pitch_mm "
                "and start_mm in sensor.toml"
            )
        return np.asarray((self.start_mm or 0.0) + self.pitch_mm * np.arange(n))
