"""A board in a picture: found by its kind, its corners localised to the pixels' noise."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from extraction.board.charuco import find_charuco
from extraction.board.checkered import counts_seen, find_checkerboard
from extraction.board.circles import find_circles
from extraction.board.found import BoardCorners, NoBoard
from extraction.image import Image
from geometry import Board

Mask = NDArray[np.bool_]


def find_board(
    image: Image, board: Board, usable: Mask | None = None, *, quick: bool = False
) -> BoardCorners | NoBoard:
    """Find a board in a picture and localise its corners or dots.

    Parameters
    ----------
    image
        Grey levels (H, W), uint8 or uint16.
    board
        What to look for; parts of it suffice.
    usable
        Pixels (H, W) that may be used, such as those away from a laser's stripe; all where None.
    quick
        Whether only the whole of a checkerboard is looked for, by the quick detector.

    Returns
    -------
    BoardCorners or NoBoard
        The corners with their covariance, or why there are none.

    References
    ----------
    OpenCV's detectors find the grid; corners are fitted by maximum likelihood (`saddle`), dots by their moments.
    """
    grey = _eight_bits(image)
    allowed = np.ones(grey.shape, dtype=bool) if usable is None else usable
    if board.kind == "checkerboard":
        return find_checkerboard(grey, board, allowed, quick)
    if board.kind == "charuco":
        return find_charuco(grey, board, allowed)
    return find_circles(grey, board, allowed)


def board_counts(image: Image) -> tuple[int, int] | None:
    """Inner corners along the two sides of the checkerboard in a picture (H, W), in either order; None without one."""
    return counts_seen(_eight_bits(image))


def _eight_bits(image: Image) -> NDArray[np.uint8]:
    """Pictures of more bits scaled to what they hold: OpenCV's detectors take eight."""
    if image.dtype == np.uint8:
        return np.ascontiguousarray(image)
    top = max(float(np.percentile(image[::4, ::4], 99.9)), 1.0)
    return np.asarray(np.clip(image * (255.0 / top), 0, 255), np.uint8)
