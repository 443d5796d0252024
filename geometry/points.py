"""Measured points of the laser plane, as extraction gives them and calibration takes them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from geometry.errors import InputError

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

    def __post_init__(self) -> None:
        """InputError where the columns differ in length."""
        shapes = {"uv_px": (2,), "cov_uv_px2": (2, 2), "yz_mm": (2,), "cov_yz_mm2": (2, 2), "sigma_px": (2,)}
        _check_columns(self, len(self.score), {**shapes, "axis_rad": (), "amplitude_dn": ()})

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
    flag: tuple[str, ...]

    def __post_init__(self) -> None:
        """InputError where the columns differ in length."""
        _check_columns(self, len(self.label), {"spot": (), "yz_mm": (2,), "cov_yz_mm2": (2, 2)})

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


def _check_columns(points: SurfacePoints | AxisPoints, n: int, shapes: dict[str, tuple[int, ...]]) -> None:
    for name, shape in shapes.items():
        if np.shape(getattr(points, name)) != (n, *shape):
            raise InputError(f"{name} has shape {np.shape(getattr(points, name))}, {n} points need {(n, *shape)}")
    if len(points.flag) != n:
        raise InputError(f"{len(points.flag)} flags for {n} points: every point needs one, empty where it is trusted")
