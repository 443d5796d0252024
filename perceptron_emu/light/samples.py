"""Points of lit surface with the light that each sends into the camera: what light transport hands to the image."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Samples:
    """Quadrature nodes of the lit and seen surface.

    xyz_mm: (N, 3) [mm] in {P}. electrons: (N,) mean signal that each node brings to the chip. group: (N,) numbers of
    what they belong to; nodes of a group are drawn in one piece of image.
    """

    xyz_mm: Array
    electrons: Array
    group: NDArray[np.int64]

    @staticmethod
    def none() -> Samples:
        """No light at all."""
        return Samples(np.zeros((0, 3)), np.zeros(0), np.zeros(0, dtype=np.int64))


def join(parts: list[Samples]) -> Samples:
    """All nodes of the parts."""
    if not parts:
        return Samples.none()
    return Samples(*(np.concatenate([getattr(p, f) for p in parts]) for f in ("xyz_mm", "electrons", "group")))
