"""What is known exactly about a rendered frame."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from geometry import Pose, Sensor
from geometry.compiled import kernel
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


def string_truths(parts: list[LitScene], shares: list[Array], now: LitScene, sensor: Sensor) -> tuple[StringTruth, ...]:
    """Truth of every string: sums over the parts of an exposure, axis points at its middle (``now``).

    shares: for each part the share of it that the chip's rows take (H,).
    """
    camera = sensor.require_camera()
    if now.strings is None:
        return ()
    axes, truths = now.strings.crossing[:, 1:], []
    for i, label in enumerate(now.strings.labels):
        sums, unhidden = np.zeros(5), 0.0
        for part, share in zip(parts, shares, strict=True):
            nodes = part.string_samples[i]
            uv = project(sensor, nodes.xyz_mm)
            taken = _add(sums, uv, nodes.xyz_mm, nodes.electrons, share, camera.width_px, camera.height_px)
            unhidden += taken * float(part.unhidden[i])
        truths.append(_string_truth(label, axes[i], sums, unhidden))
    return tuple(truths)


@kernel
def _add(sums, uv, xyz, electrons, share, width, height):  # type: ignore[no-untyped-def]
    """Add the electrons of the nodes inside the image, and these times y, z, u and v, to the sums (5,); returns the
    mean share (H,) of the rows of all nodes.
    """
    taken = 0.0
    for k in range(len(electrons)):
        u, v = uv[k, 0], uv[k, 1]
        row = 0 if not v > 0 else int(min(round(v), height - 1))
        taken += share[row]
        if -0.5 < u < width - 0.5 and -0.5 < v < height - 0.5:
            light = electrons[k] * share[row]
            sums[0] += light
            sums[1] += light * xyz[k, 1]
            sums[2] += light * xyz[k, 2]
            sums[3] += light * u
            sums[4] += light * v
    return taken / max(len(electrons), 1)


def _string_truth(label: str, axis: Array, sums: Array, unhidden: float) -> StringTruth:
    total = float(sums[0])
    if total == 0:
        return StringTruth(label, axis, np.full(2, np.nan), np.full(2, np.nan), 0.0)
    # a sum of parts over the sum of all: rounding alone could carry the fraction past 1
    fraction = min(1.0, total / unhidden)
    return StringTruth(label, axis, sums[1:3] / total, sums[3:] / total, fraction, total)
