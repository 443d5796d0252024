"""What a sensor's file states of its laser's light and its lens."""

from __future__ import annotations

from dataclasses import dataclass, fields

import numpy as np

from geometry.errors import InputError


@dataclass(frozen=True)
class Optics:
    """Stated optics; None where the file is silent, for a default of the emulator is no knowledge of a real sensor.

    Parameters
    ----------
    wavelength_nm : float or None
        Of the laser.
    pixel_um : float or None
        Pitch of the chip's pixels.
    f_number : float or None
        Of the lens at infinity.
    focus_distance_mm : float or None
        From the camera's centre along the optical axis to what is in focus.

    Raises
    ------
    InputError
        Where a number is not positive and finite.
    """

    wavelength_nm: float | None = None
    pixel_um: float | None = None
    f_number: float | None = None
    focus_distance_mm: float | None = None

    def __post_init__(self) -> None:
        for f in fields(self):
            value = getattr(self, f.name)
            if value is not None and not 0 < value < np.inf:
                raise InputError(f"{f.name} = {value:g} of the optics: must be positive and finite")
