"""The laser sheet: the plane x = 0 of {P}, lit by a fan that opens about +z."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from geometry.errors import InputError

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Sheet:
    """The lit part of the plane x = 0.

    Parameters
    ----------
    origin_mm : Array
        The emitter, where the fan opens, in {P} (3,); its x is 0.
    fan_rad : float
        Full opening angle of the fan, halved by +z.

    Raises
    ------
    InputError
        Where the numbers can not be a fan in the plane x = 0.
    """

    origin_mm: Array = field(default_factory=lambda: np.zeros(3))
    fan_rad: float = float(np.deg2rad(45.0))

    def __post_init__(self) -> None:
        if self.origin_mm.shape != (3,) or not np.all(np.isfinite(self.origin_mm)):
            raise InputError("[laser] origin_mm must be three finite numbers [mm]")
        if abs(self.origin_mm[0]) > 1e-6:
            raise InputError(
                f"[laser] origin_mm has x = {self.origin_mm[0]:g}: the emitter lies in the laser plane, x must be 0"
            )
        if not 0 < self.fan_rad < np.pi:
            raise InputError(f"[laser] fan_deg = {np.rad2deg(self.fan_rad):g}: must lie between 0 and 180")
