"""What is known exactly about a rendered frame."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from geometry import Pose

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class StringTruth:
    """One string of a frame.

    axis_mm: (y, z) (2,) where the string's axis crosses the laser plane. surface_mm: (y, z) (2,) of the centroid of
    its lit and seen surface, weighted
    by the light that reaches the camera. image_px: (u, v) (2,) of the noise-free spot's centroid. visible_fraction:
    the part of the spot's light,
    in [0, 1], that shadows, occluders and the image's border leave. Where nothing is seen, surface_mm and image_px
    are NaN. electrons: the spot's mean signal before noise.
    """

    label: str
    axis_mm: Array
    surface_mm: Array
    image_px: Array
    visible_fraction: float
    electrons: float = 0.0


@dataclass(frozen=True, eq=False)
class FrameTruth:
    """T_sensor_jig: the jig's pose in {P}, None without a jig. strings: one entry per string of the jig, in its
    order.
    """

    T_sensor_jig: Pose | None
    strings: tuple[StringTruth, ...] = ()


@dataclass(frozen=True, eq=False)
class Frame:
    """image: (H, W) uint8, or uint16 above 8 bits [DN]. truth: what is known of it."""

    image: NDArray[np.uint8] | NDArray[np.uint16]
    truth: FrameTruth
