"""What stands in a cell and must not be touched: the floor, and boxes to keep out of."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from geometry.errors import InputError

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Workspace:
    """Floor and keep-out boxes in the base frame.

    Parameters
    ----------
    floor_z_mm : float or None
        Height of the floor; None where there is none below.
    boxes_mm : Array
        Least and largest corners (B, 2, 3).
    names : tuple of str
        Of the boxes, as sentences call them.
    link_radius_mm : float or None
        Half the thickness of the arm's links; None where it is not known.

    Raises
    ------
    InputError
        Where a box has no volume.
    """

    floor_z_mm: float | None = 0.0
    boxes_mm: Array = field(default_factory=lambda: np.zeros((0, 2, 3)))
    names: tuple[str, ...] = ()
    link_radius_mm: float | None = None

    def __post_init__(self) -> None:
        for name, (low, high) in zip(self.names, self.boxes_mm, strict=True):
            for axis, a, b in zip("xyz", low, high, strict=True):
                if not a < b:
                    raise InputError(f"{name}: min_mm must lie below max_mm, and in {axis} it is {a:g} against {b:g}")
