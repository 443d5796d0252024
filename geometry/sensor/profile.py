"""What a sensor without a camera of ours gives: profiles of points (y, z), in its maker's format."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from geometry.errors import InputError, did_you_mean

Array = NDArray[np.float64]

PROFILE_FORMATS = (
    "csv",
    "gocator",
    "keyence_csv",
    "keyence_lj_x",
    "keyence_lj_v",
    "genicam",
    "sick",
    "wenglor",
    "opencv_yaml",
    "ply",
    "pcd",
    "xyz",
    "npy",
)
AUTO = "auto"  # the format is recognised by its own signature


@dataclass(frozen=True, eq=False)
class ProfileOutput:
    """How a profile sensor tells what it measures.

    Parameters
    ----------
    format : str
        One of PROFILE_FORMATS, or "auto".
    sigma_y_mm, sigma_z_mm : float or None
        Standard deviation of a point; None: to be estimated from the profiles.
    field_of_view_mm : Array or None
        Polygon (N, 2) of (y, z) [mm] in {P}, in order around it.
    pitch_mm, start_mm : float or None
        Lateral step and start, for formats without lateral coordinates.
    unit, width : int or None
        Of Keyence LJ-X's counts, in hundredths of a micrometre; points of a profile in files without a header.
    z_towards_sensor : bool
        The maker counts z towards the sensor; {P} is then the maker's frame.

    Raises
    ------
    InputError
        Where the values can not be a profile sensor's.
    """

    format: str = AUTO
    sigma_y_mm: float | None = None
    sigma_z_mm: float | None = None
    field_of_view_mm: Array | None = None
    pitch_mm: float | None = None
    start_mm: float | None = None
    unit: int | None = None
    width: int | None = None
    z_towards_sensor: bool = False

    def __post_init__(self) -> None:
        known = (AUTO, *PROFILE_FORMATS)
        if self.format not in known:
            near = did_you_mean(self.format, known) or f" (known: {', '.join(known)})"
            raise InputError(f'[profile] format = "{self.format}" is unknown{near}')
        for name in ("sigma_y_mm", "sigma_z_mm", "pitch_mm"):
            value = getattr(self, name)
            if value is not None and not 0 < value < np.inf:
                raise InputError(f"[profile] {name} = {value:g}: must be positive and finite")
        for name in ("unit", "width"):
            value = getattr(self, name)
            if value is not None and not 0 < value < 10**6:
                raise InputError(f"[profile] {name} = {value}: must be 1 … 999999")
        if self.start_mm is not None and not np.isfinite(self.start_mm):
            raise InputError(f"[profile] start_mm = {self.start_mm:g}: must be finite")
        if self.field_of_view_mm is not None:
            _check_polygon(self.field_of_view_mm)

    def require_covariance(self) -> Array:
        """Covariance (2, 2) [mm²] of a point; InputError where its standard deviations are not stated."""
        for name in ("sigma_y_mm", "sigma_z_mm"):
            if getattr(self, name) is None:
                raise InputError(f"the profile sensor's noise is not known: give [profile] {name} in its sensor.toml")
        return np.diag(np.square(np.array([self.sigma_y_mm, self.sigma_z_mm], dtype=float)))

    def require_field_of_view(self) -> Array:
        """The polygon (N, 2) [mm]; InputError where it is not stated."""
        if self.field_of_view_mm is None:
            raise InputError(
                "the profile sensor's field of view is not known: give [profile] field_of_view_mm = [[y, z], …] in "
                "its sensor.toml"
            )
        return self.field_of_view_mm


def _check_polygon(polygon: Array) -> None:
    if polygon.ndim != 2 or polygon.shape[1] != 2 or len(polygon) < 3 or not np.all(np.isfinite(polygon)):
        raise InputError("[profile] field_of_view_mm must be three or more corners [y, z], all finite [mm]")
    y, z = polygon.T
    area_mm2 = abs(y @ np.roll(z, -1) - z @ np.roll(y, -1)) / 2
    if area_mm2 <= 0:
        raise InputError("[profile] field_of_view_mm encloses no area: its corners must go around the field in order")
