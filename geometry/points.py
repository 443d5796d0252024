"""Measured points of the laser plane, as extraction gives them and calibration takes them."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class SurfacePoints:
    """The lit spots of one image as points (0, y, z) of the laser plane, unlabelled, best score first.

    uv_px: spot as seen (N, 2). cov_uv_px2: its covariance (N, 2, 2).
    yz_mm: lit-surface point in {P} (N, 2). cov_yz_mm2: its covariance (N, 2, 2).
    score: in [0, 1], how much the spot looks like a lit string (N,).
    flag: "" for a spot to be trusted, else the reason for doubt (N,).
    axis_rad: direction of the spot's long axis in the image, in (-π/2, π/2], 0 along +u (N,).
    sigma_px: Gaussian widths of the spot along and across that axis (N, 2).
    amplitude_dn: peak above the local background [DN] (N,).
    """

    uv_px: Array
    cov_uv_px2: Array
    yz_mm: Array
    cov_yz_mm2: Array
    score: Array
    flag: tuple[str, ...]
    axis_rad: Array
    sigma_px: Array
    amplitude_dn: Array

    def __len__(self) -> int:
        """The number of spots."""
        return len(self.score)

    @staticmethod
    def empty() -> SurfacePoints:
        """No spots."""
        n2, n22 = np.zeros((0, 2)), np.zeros((0, 2, 2))
        return SurfacePoints(n2, n22, n2, n22, np.zeros(0), (), np.zeros(0), n2, np.zeros(0))


@dataclass(frozen=True, eq=False)
class AxisPoints:
    """Labelled points of one image where the strings' axes cross the laser plane.

    label: string names, "A", "B'" … (N,). spot: index into the frame's SurfacePoints (N,), -1 where none was given.
    yz_mm: axis point in {P} (N, 2). cov_yz_mm2: its covariance, surface model included (N, 2, 2).
    flag: "" for a point to be trusted, else the reason for doubt (N,).
    """

    label: tuple[str, ...]
    spot: NDArray[np.intp]
    yz_mm: Array
    cov_yz_mm2: Array
    flag: tuple[str, ...] = field(default=())

    def __len__(self) -> int:
        """The number of points."""
        return len(self.label)

    @property
    def xyz_mm(self) -> Array:
        """The points (0, y, z) in {P} (N, 3)."""
        return np.column_stack([np.zeros(len(self)), self.yz_mm])

    @staticmethod
    def empty() -> AxisPoints:
        """No points."""
        return AxisPoints((), np.zeros(0, dtype=np.intp), np.zeros((0, 2)), np.zeros((0, 2, 2)), ())
