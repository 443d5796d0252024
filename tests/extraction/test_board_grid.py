"""Corners that a detector put on a grid: those of one board pass, those with some left out between do not."""

import cv2
import numpy as np
import pytest

from extraction.board.checkered import _Grid, _one_grid
from extraction.board.saddle import Saddles

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
