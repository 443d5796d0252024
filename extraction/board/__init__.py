"""Calibration boards in pictures: corners or dots localised with covariance, and a laser's stripe on them."""

from extraction.board.charuco import dictionary
from extraction.board.find import board_counts, find_board
from extraction.board.found import BoardCorners, NoBoard
from extraction.board.stripe import room_light_in_both, second_stripe, stripe_on_board

__all__ = [
    "BoardCorners",
    "NoBoard",
    "board_counts",
    "dictionary",
    "find_board",
    "room_light_in_both",
    "second_stripe",
    "stripe_on_board",
]
