"""What is known exactly about a rendered frame."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from geometry import Pose, SensorModel
from perceptron_emu.lighting import LitScene
from perceptron_emu.projection import project

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class StringTruth:
    """One string of a frame.

    axis_mm: (y, z) (2,) where the string's axis crosses the laser plane. surface_mm: (y, z) (2,) of the centroid of
    its lit
    and seen surface, weighted by the light that reaches the camera. image_px: (u, v) (2,) of the noise-free spot's
    centroid. visible_fraction: the part of the spot's light, in [0, 1], that shadows, occluders and the image's border
    leave. Where nothing is seen, surface_mm and image_px are NaN. electrons: the spot's mean signal before noise.
    """

    label: str
    axis_mm: Array
    surface_mm: Array
    image_px: Array
    visible_fraction: float
    electrons: float = 0.0


@dataclass(frozen=True, eq=False)
class SheetCurve:
    """Where the sheet's middle plane first meets the solids, in straight pieces.

    yz_mm: ends (n, 2, 2) in the laser plane. uv_px: their images (n, 2, 2). solid: number of the solid in the scene
    (n,). seen: whether the camera sees the piece's middle (n,).
    """

    yz_mm: Array
    uv_px: Array
    solid: NDArray[np.int64]
    seen: NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class FrameTruth:
    """What a frame shows.

    T_sensor_jig: the jig's pose in {P} at mid-exposure, None without a jig. strings: one entry per string of the jig,
    in
    its order. labels: (H, W) uint8, which surface gives a pixel most of its laser light, an index into label_names
    (0: none); curve: where the sheet meets the solids; both only where render was asked for them.
    """

    T_sensor_jig: Pose | None
    strings: tuple[StringTruth, ...] = ()
    labels: NDArray[np.uint8] | None = None
    label_names: tuple[str, ...] = ()
    curve: SheetCurve | None = None


@dataclass(frozen=True, eq=False)
class Frame:
    """image: (H, W) uint8, or uint16 above 8 bits [DN]. truth: what is known of it."""

    image: NDArray[np.uint8] | NDArray[np.uint16]
    truth: FrameTruth


def string_truths(
    parts: list[LitScene], shares: list[Array], now: LitScene, sensor: SensorModel
) -> tuple[StringTruth, ...]:
    """Truth of every string: sums over the parts of an exposure, axis points at its middle (``now``).

    shares: for each part the share of it that the chip's rows take (H,).
    """
    if now.strings is None:
        return ()
    axes = now.strings.crossing[:, 1:]
    return tuple(_string_truth(i, label, axes[i], parts, shares, sensor) for i, label in enumerate(now.strings.labels))


def _string_truth(
    i: int, label: str, axis: Array, parts: list[LitScene], shares: list[Array], sensor: SensorModel
) -> StringTruth:
    xyz = np.concatenate([p.string_samples[i].xyz_mm for p in parts])
    uv = project(sensor, xyz)
    row = np.clip(np.nan_to_num(np.round(uv[:, 1])), 0, sensor.height_px - 1).astype(int)
    part = np.repeat(np.arange(len(parts)), [len(p.string_samples[i].electrons) for p in parts])
    share = np.stack(shares)[part, row]
    electrons = np.concatenate([p.string_samples[i].electrons for p in parts]) * share
    weight = np.bincount(part, share, len(parts)) / np.maximum(np.bincount(part, minlength=len(parts)), 1)
    unhidden = float(np.array([p.unhidden[i] for p in parts]) @ weight)
    inside = np.all((uv > -0.5) & (uv < np.array([sensor.width_px, sensor.height_px]) - 0.5), axis=1)
    xyz, uv, electrons = xyz[inside], uv[inside], electrons[inside]
    total = float(electrons.sum())
    if total == 0:
        return StringTruth(label, axis, np.full(2, np.nan), np.full(2, np.nan), 0.0)
    # a sum of parts over the sum of all: rounding alone could carry the fraction past 1
    fraction = min(1.0, total / unhidden)
    return StringTruth(label, axis, electrons @ xyz[:, 1:] / total, electrons @ uv / total, fraction, total)
