"""Pictures of a calibration board: its corners, and the laser's stripe on it."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from geometry import Board
from workbench.cell import Value
from workbench.files import Image, Recipe
from workbench.window.profile_view import ProfileView


@dataclass(frozen=True, eq=False)
class Boards:
    """A board and its pictures. board_of: for each picture with a stripe that which shows the board; one may be both.

    read: gives a picture (H, W) by its index.
    """

    board: Board
    board_of: Mapping[int, int]
    read: Callable[[int], Image]

    def view(self, index: int, image: Image, recipe: Recipe) -> ProfileView:
        """The corners, found in the picture's partner where it has one, and the stripe where there should be one."""
        from extraction.board import NoBoard, find_board, stripe_on_board

        shows = self.board_of.get(index, index)
        lit = image if shows == index else self.read(shows)
        corners = find_board(lit, self.board)
        if isinstance(corners, NoBoard):
            return ProfileView(board_text=corners.reason, reason=f"no board: {corners.reason}")
        if index not in self.board_of:
            return ProfileView(board=corners)
        off = None if shows == index else lit
        peaks = stripe_on_board(image, off, self.board, corners, recipe.stripe)
        return ProfileView(peaks, board=corners, reason="" if len(peaks) else "no stripe on the board")


def board_values(view: ProfileView) -> list[Value]:
    """How many corners and points there are, and how well they are known."""
    board, peaks = view.board, view.peaks
    if board is None:
        return [Value("corners", "board", 0, digits=0)]
    spread = np.sqrt(np.trace(board.covariance_px2, axis1=1, axis2=2) / 2)
    out = [
        Value("corners", "board", len(board), digits=0),
        Value("corner_sigma_px", "board", float(np.median(spread)), unit="px", digits=4),
        Value("blur_px", "board", board.blur_px, unit="px", digits=2),
        Value("contrast_dn", "board", board.contrast_dn, unit="DN", digits=0),
    ]
    if peaks is None:
        return out
    middle = float(np.median(peaks.sigma_px)) if len(peaks) else None
    return [*out, Value("points", "stripe", len(peaks), digits=0), Value("sigma_px", "stripe", middle, None, "px", 4)]
