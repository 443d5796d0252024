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

# σ by how the sensor was made known: focal length as a share of itself, principal point [px], first lens term, plane
# [deg, mm], scales. "calibrated": what a dozen board views leave; "data sheet": what makers print of lenses and mounts;
# "drawing": a lens's nominal focal length and a bracket's tolerances
SOURCE_SIGMA = {
    "calibrated": {"focal": 2e-4, "centre_px": 0.5, "k1": 2e-3, "tilt_deg": 0.01, "shift_mm": 0.02, "scale": 2e-4},
    "data sheet": {"focal": 3e-3, "centre_px": 5.0, "k1": 2e-2, "tilt_deg": 0.05, "shift_mm": 0.2, "scale": 1e-3},
    "drawing": {"focal": 1e-2, "centre_px": 10.0, "k1": 1e-1, "tilt_deg": 0.2, "shift_mm": 0.5, "scale": 1e-2},
}
AGAINST = " against one another"  # ends the name of what a correlation leaves beside the common part
SAME_FOCAL = 0.99  # correlation of fx and fy: one lens, square pixels

RTOL_SYMMETRY = 1e-6  # files are written with as few as six digits
_PART = 0.3  # of a unit vector: smaller components are not named
RTOL_EIGENVALUE = 1e-9  # rounding of a covariance that is as good as singular


@dataclass(frozen=True, eq=False)
class SensorUncertainty:
    """Covariance of a sensor's parameters, and of what points and poses take from them.

    Parameters
    ----------
    parameters : tuple of str
        Names (P,) out of SENSOR_PARAMETERS, each once.
    covariance : Array
        (P, P), in the names' units.
    source : str or None
        Where the sensor's numbers come from, one of SOURCES; None where it is not said.
    tangent_covariance : Array or None
        (P, P), what derivatives carry over to points, where the parameters that are possible lie on a curve (a tilted
        chip and its principal point): along the curve points move less than its sag by itself would make them. None
        where the covariance does for both.

    Raises
    ------
    InputError
        Where a name is unknown or the matrix is no covariance of theirs.
    """

    parameters: tuple[str, ...]
    covariance: Array
    source: str | None = None
    tangent_covariance: Array | None = None

    def __post_init__(self) -> None:
        _check_names(self.parameters)
        _check_covariance("covariance", self.covariance, len(self.parameters))
        if self.tangent_covariance is not None:
            _check_covariance("tangent_covariance", self.tangent_covariance, len(self.parameters))
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

    @classmethod
    def by_source(cls, source: str, focal_px: tuple[float, float] | None) -> SensorUncertainty:
        """What is usually not known of a sensor whose numbers come from ``source``.

        focal_px: fx and fy of its camera; None for a sensor that gives profiles.
        """
        usual = SOURCE_SIGMA[source]
        if focal_px is None:
            return cls.from_sigma({"scale_y": usual["scale"], "scale_z": usual["scale"]}, source)
        tilt = float(np.deg2rad(usual["tilt_deg"]))
        sigma = {"fx_px": usual["focal"] * focal_px[0], "fy_px": usual["focal"] * focal_px[1]}
        sigma |= {"cx_px": usual["centre_px"], "cy_px": usual["centre_px"], "k1": usual["k1"]}
        sigma |= {"plane_tilt_y_rad": tilt, "plane_tilt_z_rad": tilt, "plane_shift_mm": usual["shift_mm"]}
        independent = cls.from_sigma(sigma, source)
        covariance = independent.covariance.copy()
        covariance[0, 1] = covariance[1, 0] = SAME_FOCAL * sigma["fx_px"] * sigma["fy_px"]
        return cls(independent.parameters, covariance, source)

    def completed(self, focal_px: tuple[float, float] | None) -> SensorUncertainty:
        """These numbers, with the usual ones of the source for what it does not name; unchanged without a source."""
        if self.source is None:
            return self
        usual = SensorUncertainty.by_source(self.source, focal_px)
        more = [i for i, name in enumerate(usual.parameters) if name not in self.parameters]
        rest, tangent = usual.covariance[np.ix_(more, more)], self.tangent_covariance
        from scipy.linalg import block_diag  # a tenth of a second, and most commands need none of it

        return SensorUncertainty(
            (*self.parameters, *(usual.parameters[i] for i in more)),
            block_diag(self.covariance, rest),
            self.source,
            None if tangent is None else block_diag(tangent, rest),
        )

    @property
    def of_points(self) -> Array:
        """The covariance (P, P) that derivatives carry over to points and poses."""
        return self.covariance if self.tangent_covariance is None else self.tangent_covariance

    def independent(self) -> tuple[tuple[str, ...], Array]:
        """Independent errors of unit σ: their names (K,), and the parameters (P, K) that each moves by its one σ.

        Of what points take from the parameters.
        """
        covariance = self.of_points
        linked = (covariance != 0) | np.eye(len(self.parameters), dtype=bool)
        names, columns = list[str](), list[Array]()
        left = np.diag(covariance) > 0
        while np.any(left):
            group = _linked(linked, int(np.argmax(left)))
            left &= ~group
            index = np.flatnonzero(group)
            scale = np.sqrt(np.diag(covariance)[index])
            values, vectors = np.linalg.eigh(covariance[np.ix_(index, index)] / np.outer(scale, scale))
            for value, vector in zip(values[::-1], vectors.T[::-1], strict=True):
                if value <= RTOL_EIGENVALUE * len(index):
                    continue
                strongest = vector[int(np.argmax(np.abs(vector) > (1 - RTOL_SYMMETRY) * np.max(np.abs(vector))))]
                column = np.zeros(len(self.parameters))
                column[index] = np.sqrt(value) * vector * np.sign(strongest) * scale
                part = [self.parameters[i] for i, v in zip(index, vector, strict=True) if abs(v) > _PART]
                names.append(", ".join(part) if len(index) == 1 or value >= 1 else ", ".join(part) + AGAINST)
                columns.append(column)
        return tuple(names), np.array(columns).reshape(len(columns), len(self.parameters)).T

    @property
    def sigma(self) -> dict[str, float]:
        """Standard deviations by name."""
        return dict(zip(self.parameters, np.sqrt(np.diag(self.covariance)).tolist(), strict=True))


def _linked(linked: NDArray[np.bool_], first: int) -> NDArray[np.bool_]:
    """All parameters (P,) that hang together with the ``first``."""
    group = np.zeros(len(linked), dtype=bool)
    group[first] = True
    while np.any(more := np.any(linked[group], axis=0) & ~group):
        group |= more
    return group


def _check_names(names: tuple[str, ...]) -> None:
    for name in names:
        if name not in SENSOR_PARAMETERS:
            near = did_you_mean(name, SENSOR_PARAMETERS) or f" (known: {', '.join(SENSOR_PARAMETERS)})"
            raise InputError(f'[uncertainty] "{name}" is no parameter of a sensor{near}')
        if names.count(name) > 1:
            raise InputError(f'[uncertainty] parameters: "{name}" stands there {names.count(name)} times')


def _check_covariance(key: str, covariance: Array, count: int) -> None:
    if covariance.shape != (count, count):
        raise InputError(f"[uncertainty] {key} must be {count} × {count}, a row and a column for each parameter")
    if not np.all(np.isfinite(covariance)):
        raise InputError(f"[uncertainty] {key} holds a number that is not finite")
    scale = np.sqrt(np.maximum(np.diag(covariance), 0.0))
    unit = np.where(scale > 0, scale, 1.0)
    correlation = covariance / np.outer(unit, unit)
    if np.any(np.abs(correlation - correlation.T) > RTOL_SYMMETRY):
        raise InputError(f"[uncertainty] {key} is not symmetric")
    if count and np.linalg.eigvalsh(correlation)[0] < -max(RTOL_EIGENVALUE, RTOL_SYMMETRY) * count:
        raise InputError(f"[uncertainty] {key} has a negative eigenvalue: no parameters can vary like that")
