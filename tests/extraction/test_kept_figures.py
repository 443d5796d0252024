"""Boards and stripes on them kept as they are, where the laws beside look at places alone."""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np
import pytest

from extraction.board import BoardCorners, board_counts, find_board, stripe_on_board
from extraction.board.print_alone import print_alone
from extraction.board.stripe import as_lit, room_light_in_both, second_stripe
from geometry import Board
from tests.extraction import test_board_dots as dots
from tests.extraction import test_board_grid as grid
from tests.pinned import pinned

CHARUCO = Board("charuco", 5, 4, 12.0, marker_mm=9.0, dictionary="DICT_4X4_50")
LINE_DN, HALO_DN = 60.0, 4.0


def _charuco() -> np.ndarray:
    """A picture (300, 400) of a ChArUco board at a slant."""
    printed = cv2.aruco.CharucoBoard(
        (6, 5), 12.0, 9.0, cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_4X4_50)
    ).generateImage((720, 600))
    h = np.array([[0.48, 0.03, 20.0], [-0.02, 0.46, 15.0], [-5e-5, 8e-5, 1.0]])
    seen = cv2.warpPerspective(printed, h, (400, 300), flags=cv2.INTER_AREA, borderValue=200)
    soft = cv2.GaussianBlur(0.6 * seen.astype(float) + 30, None, 0.9)
    return np.clip(soft + np.random.default_rng(1).normal(0, 1, soft.shape), 0, 255).astype(np.uint8)


PICTURES = {
    "squares": lambda: (grid.squares()[0], grid.BOARD),
    "dots": lambda: (np.clip(np.round(dots.picture()), 0, 255).astype(np.uint8), dots.BOARD),
    "charuco": lambda: (_charuco(), CHARUCO),
}


def _found(name: str) -> tuple[np.ndarray, Board, BoardCorners]:
    image, board = PICTURES[name]()
    corners = find_board(image, board)
    assert isinstance(corners, BoardCorners), corners
    return image, board, corners


def _with_stripe(image: np.ndarray, at: float = 0.5, strength: float = LINE_DN) -> np.ndarray:
    """A line of light down the picture, brighter on white, with a faint halo."""
    v, u = np.mgrid[: image.shape[0], : image.shape[1]]
    away = u - (at * image.shape[1] + 0.08 * (v - image.shape[0] / 2))
    light = (strength * np.exp(-0.5 * (away / 1.4) ** 2) + HALO_DN * np.exp(-0.5 * (away / 8) ** 2)) * image / 170
    return np.clip(np.round(image + light), 0, 255).astype(np.uint8)


@pytest.mark.parametrize("name", PICTURES)
def test_a_board_and_the_stripe_on_it(name: str) -> None:
    image, board, corners = _found(name)
    pinned(corners)
    lit = _with_stripe(image)
    for off in (image, None):
        pinned(stripe_on_board(lit, off, board, corners))


@pytest.mark.parametrize("name", PICTURES)
def test_a_second_stripe_and_other_light(name: str) -> None:
    image, board, corners = _found(name)
    lit = _with_stripe(_with_stripe(image), 0.7, 25.0)
    first = stripe_on_board(_with_stripe(image), image, board, corners)
    dim = np.clip(np.round(0.8 * image + 3), 0, 255).astype(np.uint8)
    inside = np.zeros(image.shape, dtype=bool)
    inside[40:-40, 40:-40] = True
    alone = print_alone(lit, board, corners)
    pinned(
        {
            "second": second_stripe(lit, image, board, corners, first),
            "only one": second_stripe(_with_stripe(image), image, board, corners, first),
            "room": [
                room_light_in_both(lit, image, board, corners),
                room_light_in_both(lit, 0 * image, board, corners),
            ],
            "as lit": as_lit(lit, dim, inside),
            "print": [] if alone is None else list(alone),
        }
    )


def test_a_checkerboard_is_counted() -> None:
    image = grid.squares()[0]
    assert sorted(board_counts(image) or ()) == [4, 6]
    assert board_counts(np.full_like(image, 100)) is None


@pytest.mark.parametrize("name", PICTURES)
def test_what_is_said_of_no_board(name: str) -> None:
    image, board = PICTURES[name]()
    blank = np.full_like(image, 100)
    larger = replace(board, columns=board.columns + 3, rows=board.rows + 2)
    for picture, asked in ((blank, board), (image, larger), (image[:, : image.shape[1] // 2], board)):
        pinned({"said": find_board(picture, asked)})


def test_half_of_a_board_may_be_hidden_of_charuco_alone() -> None:
    image = _charuco()
    corners = find_board(image[:, :260], CHARUCO)
    pinned({"found": corners})
