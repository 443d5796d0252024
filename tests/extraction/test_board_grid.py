"""Corners that a detector put on a grid: those of one board pass, those with some left out between do not."""

from collections.abc import Iterator

import cv2
import numpy as np
import pytest

from extraction.board import BoardCorners, checkered, find_board
from extraction.board.checkered import _Grid, _one_grid
from extraction.board.saddle import Saddles
from geometry import Board

CAMERA = np.array([[1000.0, 0, 640], [0, 1000.0, 480], [0, 0, 1]])


def grid(places: np.ndarray, tilt: tuple[float, float], k1: float) -> _Grid:
    xyz = np.column_stack([places[:, ::-1] * 10.0, np.zeros(len(places))]) - [40, 25, 0]
    turn = cv2.Rodrigues(np.array([*tilt, 0.1]))[0]
    uv = cv2.projectPoints(xyz, turn, np.array([0, 0, 150.0]), CAMERA, np.array([k1, 0, 0, 0]))[0][:, 0]
    fields = {name: np.zeros(len(uv)) for name in Saddles.__dataclass_fields__} | {"uv_px": uv}
    return _Grid(places, Saddles(**fields))


@pytest.mark.parametrize("tilt", [(0.0, 0.0), (0.7, 0.3), (-0.5, 0.7)])
@pytest.mark.parametrize("k1", [0.0, -0.25, 0.1])
def test_a_board_at_a_slant_through_a_bending_lens_is_one_grid(tilt: tuple[float, float], k1: float) -> None:
    places = np.argwhere(np.ones((6, 9), bool))
    assert _one_grid(grid(places, tilt, k1))


def test_a_grid_that_leaves_a_row_out_is_none() -> None:
    places = np.argwhere(np.ones((6, 9), bool))
    skipping = grid(places + np.array([1, 0]) * (places[:, :1] > 2), (0.4, 0.2), -0.1)
    assert not _one_grid(_Grid(places, skipping.fit))


def test_two_rows_are_no_grid() -> None:
    two = np.argwhere(np.ones((2, 9), bool))
    assert not _one_grid(grid(two, (0.4, 0.2), 0.0))
    assert _one_grid(grid(np.argwhere(np.ones((3, 9), bool)), (0.4, 0.2), 0.0))


BOARD = Board("checkerboard", 6, 4, 10.0)


def squares() -> tuple[np.ndarray, np.ndarray]:
    """A picture (240, 320) of the board, and its corners by row and column (4, 6, 2)."""
    h = np.array([[3.2, 0.5, 85], [-0.4, 3.2, 80], [4e-4, 1e-3, 1.0]])
    v, u = np.mgrid[0:960, 0:1280]
    p = np.stack([(u + 0.5) / 4 - 0.5, (v + 0.5) / 4 - 0.5, np.ones(u.shape)], -1) @ np.linalg.inv(h).T
    x, y = p[..., 0] / p[..., 2], p[..., 1] / p[..., 2]
    on = (x > -10) & (x < 60) & (y > -10) & (y < 40)
    grey = np.where(on & ((np.floor(x / 10) + np.floor(y / 10)) % 2 == 0), 30.0, 170.0)
    grey = cv2.GaussianBlur(grey, None, 3).reshape(240, 4, 320, 4).mean(axis=(1, 3))
    at = np.column_stack([BOARD.points_mm, np.ones(24)]) @ h.T
    noisy = grey + np.random.default_rng(0).normal(0, 1.0, grey.shape)
    return np.clip(noisy, 0, 255).astype(np.uint8), (at[:, :2] / at[:, 2:]).reshape(4, 6, 2)


def found_from(parts: list[tuple[np.ndarray, np.ndarray]], monkeypatch: pytest.MonkeyPatch) -> int:
    """How many corners come of parts: places (N, 2) and pixels (N, 2)."""

    def given(*_: object) -> Iterator[tuple[np.ndarray, np.ndarray]]:
        yield from parts

    monkeypatch.setattr(checkered, "_parts", given)
    found = find_board(squares()[0], BOARD)
    assert isinstance(found, BoardCorners)
    return len(found)


def test_a_part_grows_to_the_board_whichever_way_it_is_counted(monkeypatch: pytest.MonkeyPatch) -> None:
    uv = squares()[1]
    places = np.argwhere(np.ones((4, 4), bool))
    own = uv[places[:, 0], places[:, 1]]
    assert found_from([(places, own)], monkeypatch) == 24
    assert found_from([(places[:, ::-1], own)], monkeypatch) == 24


def test_a_part_that_does_not_grow_is_no_reason_to_stop(monkeypatch: pytest.MonkeyPatch) -> None:
    uv = squares()[1]
    places = np.argwhere(np.ones((4, 6), bool))
    few = [(places[places[:, 1] < 3], uv[:, :3].reshape(-1, 2))]
    monkeypatch.setattr(checkered, "_ROUNDS", 0)
    assert found_from(few, monkeypatch) == 12
    assert found_from([*few, (places, uv.reshape(-1, 2))], monkeypatch) == 24
