"""Measured points of the laser plane, as extraction gives them and calibration takes them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from geometry.errors import InputError

Array = NDArray[np.float64]
Index = NDArray[np.intp]
Mask = NDArray[np.bool_]

_SIGMA_FLOOR_MM = 1e-6  # exact points must not make the weights infinite


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
    offset_mm: the lit surface less the axis, which the string's stated diameter is a factor of (N, 2); None where the
    points were given as they are.
    """

    label: tuple[str, ...]
    spot: NDArray[np.intp]
    yz_mm: Array
    cov_yz_mm2: Array
    flag: tuple[str, ...]
    offset_mm: Array | None = None

    def __post_init__(self) -> None:
        """InputError where the columns differ in length."""
        offset: dict[str, tuple[int, ...]] = {} if self.offset_mm is None else {"offset_mm": (2,)}
        _check_columns(self, len(self.label), {"spot": (), "yz_mm": (2,), "cov_yz_mm2": (2, 2), **offset})

    def __len__(self) -> int:
        """The number of points."""
        return len(self.label)

    @property
    def xyz_mm(self) -> Array:
        """The points (0, y, z) in {P} (N, 3)."""
        return np.column_stack([np.zeros(len(self)), self.yz_mm])

    @property
    def sigma_yz_mm(self) -> Array:
        """σ of y and z (N, 2) [mm]."""
        return np.sqrt(np.diagonal(self.cov_yz_mm2, axis1=-2, axis2=-1))

    @staticmethod
    def empty() -> AxisPoints:
        """No points."""
        return AxisPoints((), np.zeros(0, dtype=np.intp), np.zeros((0, 2)), np.zeros((0, 2, 2)), ())


@dataclass(frozen=True, eq=False)
class SheetPoints:
    """Points of F frames in the laser plane, filled up to M a frame.

    Parameters
    ----------
    yz_mm : ndarray (F, M, 2)
        In {P} [mm].
    cov_mm2 : ndarray (F, M, 2, 2)
        Unit where absent.
    present : ndarray (F, M) of bool
    feature : ndarray (F, M) of int
        Which of the target's features each point lies on.
    offset_mm : ndarray (F, M, 2) or None
        The lit surface less the axis of a string, by its stated diameter; 0 where absent. None: of no point known.
    """

    yz_mm: Array
    cov_mm2: Array
    present: Mask
    feature: Index
    offset_mm: Array | None = None

    @staticmethod
    def of(frames: Sequence[AxisPoints], features: Sequence[str]) -> SheetPoints:
        """Labelled points of frames, side by side; the labels are names of ``features``."""
        number = {name: i for i, name in enumerate(features)}
        shape = (len(frames), max(1, max((len(f) for f in frames), default=0)))
        yz, present, feature = np.zeros((*shape, 2)), np.zeros(shape, dtype=bool), np.zeros(shape, dtype=np.intp)
        covariance = np.broadcast_to(np.eye(2), (*shape, 2, 2)).copy()
        offset = None if all(f.offset_mm is None for f in frames) else np.zeros((*shape, 2))
        for i, f in enumerate(frames):
            n = len(f)
            yz[i, :n], present[i, :n], feature[i, :n] = f.yz_mm, True, [number[label] for label in f.label]
            covariance[i, :n] = f.cov_yz_mm2 + np.eye(2) * _SIGMA_FLOOR_MM**2
            if offset is not None and f.offset_mm is not None:
                offset[i, :n] = f.offset_mm
        return SheetPoints(yz, covariance, present, feature, offset)

    def __len__(self) -> int:
        """The number of frames."""
        return len(self.yz_mm)

    def __getitem__(self, index: Index) -> SheetPoints:
        """The frames of ``index``."""
        offset = None if self.offset_mm is None else self.offset_mm[index]
        return SheetPoints(self.yz_mm[index], self.cov_mm2[index], self.present[index], self.feature[index], offset)

    @property
    def xyz_mm(self) -> Array:
        """The points (0, y, z) in {P} (F, M, 3)."""
        return np.concatenate([np.zeros((*self.present.shape, 1)), self.yz_mm], -1)


def _check_columns(points: SurfacePoints | AxisPoints, n: int, shapes: dict[str, tuple[int, ...]]) -> None:
    for name, shape in shapes.items():
        if np.shape(getattr(points, name)) != (n, *shape):
            raise InputError(f"{name} has shape {np.shape(getattr(points, name))}, {n} points need {(n, *shape)}")
    if len(points.flag) != n:
        raise InputError(f"{len(points.flag)} flags for {n} points: every point needs one, empty where it is trusted")
