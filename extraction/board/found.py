"""What is found of a board in a picture."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class BoardCorners:
    """Corners or dots of a board in a picture.

    Parameters
    ----------
    xy_mm : ndarray (N, 2)
        Where they lie on the board. Of a checkerboard seen in part the origin may be another corner than in other
        pictures: its corners have no names.
    uv_px : ndarray (N, 2)
        Where they are seen.
    covariance_px2 : ndarray (N, 2, 2)
        Of uv_px, by the pixels' noise.
    blur_px : float
        Gaussian σ of the edges' blur, the median of all.
    contrast_dn : float
        Step between dark and bright, the median of all.
    dot_radius_mm : float
        Of the dots, the median of all; 0 for corners of squares.
    markers_mm : ndarray (M, 2) or None
        The middles of a ChArUco board's markers, on the board.
    axes : bool
        Whether x and y are the board's own, up to a turn by 180°; of a checkerboard seen in part they may be turned by
        90°.
    named : bool
        Whether a place on the board is the same corner in every picture.
    """

    xy_mm: Array
    uv_px: Array
    covariance_px2: Array
    blur_px: float
    contrast_dn: float
    dot_radius_mm: float = 0.0
    markers_mm: Array | None = None
    axes: bool = False
    named: bool = False

    def __len__(self) -> int:
        """The number of corners."""
        return len(self.uv_px)


@dataclass(frozen=True)
class NoBoard:
    """Why no board was found, as a sentence's end."""

    reason: str
