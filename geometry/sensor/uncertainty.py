"""What is not known of a sensor: the standard deviations and correlations of its own calibration."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from geometry.errors import InputError, did_you_mean

Array = NDArray[np.float64]

SOURCES = ("calibrated", "data sheet", "drawing")
# of the camera [px, or the lens model's own units], in OpenCV's order
CAMERA_PARAMETERS = (
    *("fx_px", "fy_px", "cx_px", "cy_px"),
    *("k1", "k2", "p1", "p2", "k3", "k4", "k5", "k6", "s1", "s2", "s3", "s4", "tau_x", "tau_y"),
)
# of what any sensor measures: the laser plane turned about {P}'s y and z and shifted along x, and scales of y and z
SHEET_PARAMETERS = ("plane_tilt_y_rad", "plane_tilt_z_rad", "plane_shift_mm", "scale_y", "scale_z")
SENSOR_PARAMETERS = (*CAMERA_PARAMETERS, *SHEET_PARAMETERS)

RTOL_SYMMETRY = 1e-6  # files are written with as few as six digits
RTOL_EIGENVALUE = 1e-9  # rounding of a covariance that is as good as singular


@dataclass(frozen=True, eq=False)
class SensorUncertainty:
    """Covariance of a sensor's parameters.

    Parameters
    ----------
    parameters : tuple of str
        Names (P,) out of SENSOR_PARAMETERS, each once.
    covariance : Array
        (P, P), in the names' units.
    source : str or None
        Where the sensor's numbers come from, one of SOURCES; None where it is not said.

    Raises
    ------
    InputError
        Where a name is unknown or the matrix is no covariance of theirs.
    """

    parameters: tuple[str, ...]
    covariance: Array
    source: str | None = None

    def __post_init__(self) -> None:
        _check_names(self.parameters)
        _check_covariance(self.covariance, len(self.parameters))
        if self.source is not None and self.source not in SOURCES:
            shown = ", ".join(f'"{s}"' for s in SOURCES)
            raise InputError(f'[uncertainty] source = "{self.source}": must be one of {shown}')

    @classmethod
    def from_sigma(cls, sigma: Mapping[str, float], source: str | None = None) -> SensorUncertainty:
        """Independent parameters with the standard deviations ``sigma`` by name."""
        for name, value in sigma.items():
            if not 0 <= value < np.inf:
                raise InputError(f"[uncertainty] {name} = {value:g}: a standard deviation is finite and not negative")
        return cls(tuple(sigma), np.diag(np.square(np.array(list(sigma.values()), dtype=float))), source)

    @property
    def sigma(self) -> dict[str, float]:
        """Standard deviations by name."""
        return dict(zip(self.parameters, np.sqrt(np.diag(self.covariance)).tolist(), strict=True))


def _check_names(names: tuple[str, ...]) -> None:
    for name in names:
        if name not in SENSOR_PARAMETERS:
            near = did_you_mean(name, SENSOR_PARAMETERS) or f" (known: {', '.join(SENSOR_PARAMETERS)})"
            raise InputError(f'[uncertainty] "{name}" is no parameter of a sensor{near}')
        if names.count(name) > 1:
            raise InputError(f'[uncertainty] parameters: "{name}" stands there {names.count(name)} times')


def _check_covariance(covariance: Array, count: int) -> None:
    if covariance.shape != (count, count):
        raise InputError(f"[uncertainty] covariance must be {count} × {count}, a row and a column for each parameter")
    if not np.all(np.isfinite(covariance)):
        raise InputError("[uncertainty] covariance holds a number that is not finite")
    scale = np.sqrt(np.maximum(np.diag(covariance), 0.0))
    unit = np.where(scale > 0, scale, 1.0)
    correlation = covariance / np.outer(unit, unit)
    if np.any(np.abs(correlation - correlation.T) > RTOL_SYMMETRY):
        raise InputError("[uncertainty] covariance is not symmetric")
    if count and np.linalg.eigvalsh(correlation)[0] < -max(RTOL_EIGENVALUE, RTOL_SYMMETRY) * count:
        raise InputError("[uncertainty] covariance has a negative eigenvalue: no parameters can vary like that")
