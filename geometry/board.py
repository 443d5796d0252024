"""A calibration board: what is printed on it, and where its corners or dots lie."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from geometry.errors import InputError, did_you_mean

Array = NDArray[np.float64]

BOARD_KINDS = ("checkerboard", "circles", "asymmetric_circles", "charuco")
FEWEST_CORNERS = 3  # along a side; fewer are no board that could be told from other things
MOST_CORNERS = 200


@dataclass(frozen=True)
class Board:
    """A flat board of corners or dots on a grid.

    Parameters
    ----------
    kind : str
        One of BOARD_KINDS.
    columns, rows : int
        Inner corners or dots along its two sides; of asymmetric circles as OpenCV counts them, the dots of a row and
        the number of rows. Of a ChArUco board the inner corners, one less than its squares.
    pitch_mm : float
        Side of a square, or distance of neighbouring dots of a row (of asymmetric circles: half of it).
    marker_mm : float
        Side of a ChArUco board's markers.
    dictionary : str
        Name of their dictionary, such as "DICT_4X4_50".
    sigma_flat_mm, sigma_print_mm : float or None
        How flat it is, as σ of its sag at half its diagonal, and σ of its corners' places; None where nobody says.

    Raises
    ------
    InputError
        Where no such board can be.
    """

    kind: str
    columns: int
    rows: int
    pitch_mm: float
    marker_mm: float = 0.0
    dictionary: str = ""
    sigma_flat_mm: float | None = None
    sigma_print_mm: float | None = None

    def __post_init__(self) -> None:
        if self.kind not in BOARD_KINDS:
            near = did_you_mean(self.kind, BOARD_KINDS) or f" (known: {', '.join(BOARD_KINDS)})"
            raise InputError(f'kind = "{self.kind}" is no board{near}')
        fewest = 2 if self.kind == "charuco" else FEWEST_CORNERS
        for name, count in (("columns", self.columns), ("rows", self.rows)):
            if not fewest <= count <= MOST_CORNERS:
                raise InputError(f"the board has {count} {name}: must lie in {fewest} … {MOST_CORNERS}")
        if not 0 < self.pitch_mm < np.inf:
            raise InputError(f"the board's pitch is {self.pitch_mm:g} mm: must be positive and finite")
        if self.kind == "charuco" and not 0 < self.marker_mm < self.pitch_mm:
            raise InputError(
                f"marker_mm = {self.marker_mm:g}: a marker is smaller than its square of {self.pitch_mm:g} mm"
            )

    @property
    def is_checkered(self) -> bool:
        """Whether the features are corners of squares (else dots)."""
        return self.kind in ("checkerboard", "charuco")

    @property
    def points_mm(self) -> Array:
        """Corners or dots (rows · columns, 2) on the board, row by row [mm]."""
        row, column = np.divmod(np.arange(self.rows * self.columns), self.columns)
        across = 2 * column + row % 2 if self.kind == "asymmetric_circles" else column
        return np.stack([across, row], -1) * self.pitch_mm
