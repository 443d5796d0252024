"""Points of lit surface with the light that each sends into the camera: what light transport hands to the image."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from geometry.compiled import kernel

Array = NDArray[np.float64]
Index = NDArray[np.int64]
N = TypeVar("N", int, Index)

TILE_PX = 64  # stripes are drawn in tiles of this side
TILES_BEFORE = 8  # tiles left of and above the image that have a number: light near the border reaches into it
_FIRST_STRIPE = 1_000  # groups below are strings
_TILES_A_ROW = 2048  # images of up to 130,000 columns
_GROUPS_A_SOLID = _TILES_A_ROW**2


@dataclass(frozen=True, eq=False)
class LightNodes:
    """Quadrature nodes of the lit and seen surface: what light transport hands to the image.

    Parameters
    ----------
    xyz_mm : Array
        (N, 3) [mm] in {P}.
    electrons : Array
        (N,) mean signal that each node brings to the chip.
    group : NDArray
        (N,) numbers of what they belong to, `string_group` or `stripe_group`; nodes of a group are drawn in one piece
        of image.
    """

    xyz_mm: Array
    electrons: Array
    group: Index

    @staticmethod
    def none() -> LightNodes:
        """No light at all."""
        return LightNodes(np.zeros((0, 3)), np.zeros(0), np.zeros(0, dtype=np.int64))

    def surface(self, n_strings: int) -> Index:
        """Which surface each node (N,) lies on: the strings are counted first, then the solids."""
        solid = (self.group - _FIRST_STRIPE) // _GROUPS_A_SOLID
        return np.where(self.group < _FIRST_STRIPE, self.group, solid + n_strings)


def join(parts: list[LightNodes]) -> LightNodes:
    """All nodes of the parts.

    Parameters
    ----------
    parts : list of LightNodes
        Any number.

    Returns
    -------
    LightNodes
        In the order of the parts.
    """
    if not parts:
        return LightNodes.none()
    return LightNodes(*(np.concatenate([getattr(p, f) for p in parts]) for f in ("xyz_mm", "electrons", "group")))


def string_group(string: int) -> int:
    """The group of a string's nodes.

    Parameters
    ----------
    string : int
        Its number in the jig.

    Returns
    -------
    int
        Below all groups of stripes.
    """
    return string


@kernel(inline=True)
def stripe_group(solid: N, column: N, row: N) -> N:
    """The groups of nodes on solids whose images fall into tiles of TILE_PX.

    Parameters
    ----------
    solid : int or NDArray
        Number of the solid in the scene.
    column, row : int or NDArray
        Of the tile, that of the image's first pixel being 0; from −TILES_BEFORE on.

    Returns
    -------
    int or NDArray
        Ordered by solid, row, column.
    """
    return _FIRST_STRIPE + solid * _GROUPS_A_SOLID + (row + TILES_BEFORE) * _TILES_A_ROW + column + TILES_BEFORE
