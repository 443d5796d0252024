"""A board's shape: a plate that is bent a little, and a print whose corners are not quite where they are stated.

A bent board is z = (a x² + 2 b x y + c y²) / 2 about its middle, with curvatures [1/mm] that plate and print share: the
stripe meets them too. Constant curvatures are the same from wherever they are counted, up to a shift and a turn that a
board's pose takes up: a part of a board, or one turned by 180°, has the same.

A print's corners have offsets of their own, in the plane (paper stretches, lines are fed unevenly) and across it (paper
that is not flat on its plate); the plate is where their mean is, and has none of them.

References
----------
Strobl & Hirzinger, ICCV Workshops 2011, 1068: a camera and the places of an imperfect target's corners in one bundle.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from calib.engine import Result
from calib.sensor.views import BoardViews

Array = NDArray[np.float64]
Index = NDArray[np.intp]

BEND, PRINT = "bend", "print"
BENDS = ("bend_x", "bend_xy", "bend_y")

# σ of a board of which nothing is told, of half its diagonal: a printed board bows by a millimetre in 200, its paper
# stretches by some tenths of a percent
FLAT_SHARE, PRINT_SHARE = 0.005, 0.002
MOST_CORNERS = 100  # whose offsets are asked for: three unknowns each, and time goes with their square
FEWEST_VIEWS = 4  # that show the corners: less the one that is left out, three as ever
_SAME_MM = 1e-3  # between places of one corner
_EXACT_MM = 1e-6  # across a plate that is said to be flat: as good as none


@dataclass(frozen=True, eq=False)
class BoardShape:
    """What is known of a board's shape before any picture.

    Parameters
    ----------
    extent_mm : ndarray (9, 2)
        The middle, the four ends and the middles of the four sides of what is seen of it.
    corners_mm : ndarray (P, 2)
        Where its corners are stated to be; none where no offsets are asked for.
    sigma_bend : ndarray (3,)
        Of the curvatures [1/mm]; 0 where no bend is asked for.
    sigma_print_mm : ndarray (3,)
        Of a corner's offsets along x, y and z.
    """

    extent_mm: Array
    corners_mm: Array
    sigma_bend: Array
    sigma_print_mm: Array

    @staticmethod
    def of(views: BoardViews, flat_mm: float | None = None, print_mm: float | None = None) -> BoardShape:
        """Of the board in views; flat_mm, print_mm: σ of its sag at half its diagonal and of its corners' places."""
        xy = views.corners.xy_mm
        low, high = xy.min(axis=0), xy.max(axis=0)
        half = max(float(np.linalg.norm(high - low)) / 2, 1e-9)
        flat = FLAT_SHARE * half if flat_mm is None else flat_mm
        within = PRINT_SHARE * half if print_mm is None else print_mm
        lie = sum(v.axes for v in views.views) >= FEWEST_VIEWS
        named = [v.corners.xy_mm for v in views.views if v.named]
        corners = np.zeros((0, 2))
        if len(named) >= FEWEST_VIEWS and within > 0:
            corners = np.unique(np.round(np.concatenate(named) / _SAME_MM), axis=0) * _SAME_MM
        if len(corners) > MOST_CORNERS:
            corners = corners[:0]
        bend = np.full(3, 2 * flat / half**2 if lie else 0.0)
        ways = np.array([[0, 0], [-1, -1], [-1, 0], [-1, 1], [0, -1], [0, 1], [1, -1], [1, 0], [1, 1]])
        return BoardShape(
            (low + high) / 2 + ways * (high - low) / 2, corners, bend, np.array([within, within, max(flat, _EXACT_MM)])
        )

    def place(self, xy_mm: Array) -> Index:
        """Which corner stands at each place (N, 2); -1 where none does."""
        if not len(self.corners_mm):
            return np.full(len(xy_mm), -1)
        away = np.abs(xy_mm[:, None] - self.corners_mm).max(axis=-1)
        nearest = np.argmin(away, axis=1)
        return np.where(away[np.arange(len(xy_mm)), nearest] < 2 * _SAME_MM, nearest, -1)

    def height(self, bend: Array, xy_mm: Array) -> Height:
        """The plate's heights at points (N, 2) of a board, for curvatures (3,)."""
        xy = xy_mm - self.extent_mm[0]
        x, y = xy[:, 0], xy[:, 1]
        a, b, c = bend
        by = np.stack([x**2 / 2, x * y, y**2 / 2], -1)
        return Height(by @ bend, np.stack([a * x + b * y, b * x + c * y], -1), by)


@dataclass(frozen=True, eq=False)
class Height:
    """Heights (N,) [mm] with their slopes (N, 2), and by the curvatures (N, 3)."""

    z_mm: Array
    slope: Array
    by_bend: Array


@dataclass(frozen=True, eq=False)
class FoundShape:
    """A board that is not as it is stated.

    Parameters
    ----------
    bend_per_mm, sigma_bend_per_mm : ndarray (3,) or None
        Its curvatures a, b, c (``BENDS``); None where it is taken to be flat.
    sag_mm : float
        Between the plate's highest and lowest corner.
    corners_mm : ndarray (P, 2)
        Where its corners are stated to be; none where they are taken to be there.
    offset_mm, sigma_offset_mm : ndarray (P, 3)
        How far from there they stand, along x, y and z of the board.
    """

    bend_per_mm: Array | None
    sigma_bend_per_mm: Array | None
    sag_mm: float
    corners_mm: Array
    offset_mm: Array
    sigma_offset_mm: Array

    @property
    def stretch(self) -> Array:
        """How much longer the print is along x and along y (2,) than stated, as a share."""
        if not len(self.offset_mm):
            return np.zeros(2)
        about = self.corners_mm - self.corners_mm.mean(axis=0)
        return np.asarray(np.sum(about * self.offset_mm[:, :2], axis=0) / np.sum(about**2, axis=0))

    @property
    def sigma_scale(self) -> float:
        """Of all lengths, as a share: half of what columns and rows differ by, for no view tells which is as stated.

        Of two independent stretches of one σ, the mean is off by half of what they differ by, root mean square.
        """
        along, across = self.stretch
        return abs(float(along - across)) / 2


def found_shape(shape: BoardShape, result: Result, covariance: Array) -> FoundShape | None:
    """The shape of a solution, with the covariance (C, C) of all its common unknowns; None of a board as stated."""
    u, sigma = result.unknowns, np.sqrt(np.maximum(np.diag(covariance), 0.0))
    if BEND not in u and PRINT not in u:
        return None
    bend = result.state.vector(BEND) if BEND in u else None
    corners = shape.corners_mm if PRINT in u else np.zeros((0, 2))
    height = np.zeros(1) if bend is None else shape.height(bend, shape.extent_mm).z_mm
    return FoundShape(
        bend,
        sigma[u[BEND]] if BEND in u else None,
        float(np.ptp(height)),
        corners,
        result.state.vector(PRINT).reshape(-1, 3) if PRINT in u else np.zeros((0, 3)),
        sigma[u[PRINT]].reshape(-1, 3) if PRINT in u else np.zeros((0, 3)),
    )
