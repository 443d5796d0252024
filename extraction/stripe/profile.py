"""A laser stripe as measured: peaks in the image, points of the laser plane, with their covariance."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, fields, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from geometry import Sensor
from geometry.sensor import calibration_covariance

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

# bits of a point's flag: clipped pixels; not one Gaussian; cut by border or neighbour; another of like light, or a
# stronger ridge that was refused, in the section; beyond an end of the stripe, in files alone
SATURATED, SHAPE, EDGE, AMBIGUOUS, TAIL = 1, 2, 4, 8, 16
_FLAG_NAMES = {SATURATED: "saturated", SHAPE: "shape", EDGE: "edge", AMBIGUOUS: "ambiguous", TAIL: "tail"}


@dataclass(frozen=True, eq=False)
class StripePeaks:
    """Points of a stripe in the image, ordered along it section by section.

    section: image column, or row, of each point (N,). uv_px: the point (N, 2). normal: unit vector (N, 2)
    along which it was localised. sigma_px: standard deviation along it (N,); across it the point is exact by
    definition: it lies on its section.
    amplitude_dn: peak above the background (N,). width_px: Gaussian σ of the stripe (N,). background_dn (N,).
    chi2_per_dof: of the section's fit (N,). flag: bits, see `flag_names` (N,).
    correlation_sections: length L of the neighbours' correlation. Errors of two points k sections apart on one stripe
    correlate as exp(-k / L); 0 where they are independent. It comes from speckle and texture that neighbours share.
    piece: which continuous piece of stripe each point is on, counted from 0 (N,); empty where nobody asked.
    refused: how many ridges and sections were not taken, by reason.
    tails: sections beyond the ends of pieces that still hold light of the stripe, where it was asked for; see
    `Profile`.
    """

    section: NDArray[np.int32]
    uv_px: Array
    normal: Array
    sigma_px: Array
    amplitude_dn: Array
    width_px: Array
    background_dn: Array
    chi2_per_dof: Array
    flag: NDArray[np.uint8]
    correlation_sections: float = 0.0
    piece: NDArray[np.int32] = field(default_factory=lambda: np.zeros(0, np.int32))
    refused: Mapping[str, int] = field(default_factory=dict)
    tails: StripePeaks | None = None

    def __len__(self) -> int:
        """The number of points."""
        return len(self.section)

    def __getitem__(self, chosen: NDArray[np.intp] | Mask) -> StripePeaks:
        """The chosen points, in that order."""
        columns = {f.name: getattr(self, f.name) for f in fields(self)}
        changed: dict[str, Any] = {
            name: v[chosen] for name, v in columns.items() if isinstance(v, np.ndarray) and len(v) == len(self)
        }
        return replace(self, **changed)

    def joined(self, others: StripePeaks) -> StripePeaks:
        """These points, then ``others``; the rest is of these."""
        changed: dict[str, Any] = {}
        for f in fields(self):
            own = getattr(self, f.name)
            if isinstance(own, np.ndarray):
                changed[f.name] = np.concatenate([own, getattr(others, f.name)])
        return replace(self, **changed, tails=None)

    @property
    def sections_per_independent(self) -> float:
        """How many neighbouring sections count as one: the variance of a mean of many is that much larger.

        Σ exp(-|k| / L) over all k; 1 where the points are independent.
        """
        if self.correlation_sections <= 0:
            return 1.0
        return float(1 / np.tanh(0.5 / self.correlation_sections))

    @property
    def cov_uv_px2(self) -> Array:
        """Covariance (N, 2, 2) of rank one: along the normal alone."""
        return (self.sigma_px**2)[:, None, None] * self.normal[:, :, None] * self.normal[:, None, :]


@dataclass(frozen=True, eq=False)
class Profile:
    """A stripe in the laser plane: peaks, their points (y, z) in {P} (N, 2) [mm] and covariance (N, 2, 2), rank one.

    sensor_cov_yz_mm2 (N, 2, 2): what the uncertainty of the sensor's own calibration adds, common to all points; None
    where its file states none. tails: points of sections beyond the ends of the stripe's pieces, where its light has
    fallen below half: on a surface that turns away, or by the lens's blur alone. They are none of the stripe's own,
    but tell where a rounded edge ends. None where nobody measured them.
    """

    peaks: StripePeaks
    yz_mm: Array
    cov_yz_mm2: Array
    sensor_cov_yz_mm2: Array | None = None
    tails: Profile | None = None

    def __len__(self) -> int:
        """The number of points."""
        return len(self.yz_mm)

    @staticmethod
    def of_points(yz_mm: Array, cov_yz_mm2: Array, intensity: Array | None = None) -> Profile:
        """Points (N, 2) [mm] of a sensor that gives no image, with their covariance (N, 2, 2)."""
        n = len(yz_mm)
        zero, two = np.zeros(n), np.zeros((n, 2))
        light = zero if intensity is None else np.nan_to_num(intensity)
        section, flag = np.arange(n, dtype=np.int32), np.zeros(n, dtype=np.uint8)
        return Profile(StripePeaks(section, two, two, zero, light, zero, zero, zero, flag), yz_mm, cov_yz_mm2)

    def __getitem__(self, chosen: NDArray[np.intp] | Mask) -> Profile:
        """The chosen points, in that order; with the tails."""
        own = self.sensor_cov_yz_mm2
        own = None if own is None else own[chosen]
        return Profile(self.peaks[chosen], self.yz_mm[chosen], self.cov_yz_mm2[chosen], own, self.tails)

    def with_sensor(self, sensor: Sensor) -> Profile:
        """The profile with what the uncertainty of ``sensor``'s own calibration adds to its points."""
        tails = None if self.tails is None else self.tails.with_sensor(sensor)
        return replace(self, sensor_cov_yz_mm2=calibration_covariance(sensor, self.yz_mm), tails=tails)

    def with_tails(self) -> Profile:
        """Its own points, then those of its tails; what the sensor's calibration adds is left out."""
        own, beyond = replace(self, sensor_cov_yz_mm2=None, tails=None), self.tails
        if beyond is None or len(beyond) == 0:
            return own
        return Profile(
            own.peaks.joined(beyond.peaks),
            np.concatenate([own.yz_mm, beyond.yz_mm]),
            np.concatenate([own.cov_yz_mm2, beyond.cov_yz_mm2]),
        )


def flag_names(flag: int) -> str:
    """The reasons for doubt of one point of a stripe.

    Parameters
    ----------
    flag
        Bits SATURATED (clipped pixels), SHAPE (not one Gaussian peak), EDGE (cut by the border or a neighbour),
        AMBIGUOUS (another ridge of like light, or a stronger one that was refused, shares the section), TAIL (beyond
        an end of the stripe: a row of a file that is none of the stripe's own points).

    Returns
    -------
    names
        Joined by "+", "" for none.
    """
    return "+".join(name for bit, name in _FLAG_NAMES.items() if flag & bit)


def flag_bits(names: str) -> int:
    """The inverse of `flag_names`.

    Parameters
    ----------
    names
        Joined by "+", "" for none.

    Returns
    -------
    flag
        The bits.

    Raises
    ------
    ValueError
        For a name that is none.
    """
    known = {name: bit for bit, name in _FLAG_NAMES.items()}
    unknown = [name for name in names.split("+") if name and name not in known]
    if unknown:
        raise ValueError(f"unknown flag {unknown[0]!r}, known are {', '.join(known)}")
    return sum(known[name] for name in names.split("+") if name)
