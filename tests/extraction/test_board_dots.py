"""Dots of a board against where OpenCV's lens puts their middles, drawn by every sub-pixel's ray.

Proves that neither perspective nor the lens's bend nor slanting light draws them aside, and that their σ are true under
the camera's noise. It does not prove that the grid is found in every picture.
"""

from __future__ import annotations

from functools import lru_cache

import cv2
import numpy as np
import pytest
from scipy.ndimage import gaussian_filter

from extraction.board import BoardCorners, find_board
from extraction.board.stripe import _border_distance, _rim_distance
from geometry import Board, exp_so3

SIZE = (320, 256)
FINE = 4  # sub-pixels along a side, each dark by how far the rim goes across it
K = np.array([[420.0, 0, 157.0], [0, 418.0, 131.0], [0, 0, 1]])
LENS = np.array([-0.25, 0.05, 0.0, 0.0, 0.0])
BOARD = Board("circles", 5, 4, 12.0)
RADIUS_MM = 0.32 * BOARD.pitch_mm
R = exp_so3(np.array([0.5, -0.45, 0.0])) @ exp_so3(np.array([0, 0, 0.2]))
T = np.array([2.0, 2.0, 98.0]) - R @ [*BOARD.points_mm.mean(axis=0), 0.0]
BIAS_PX, BIAS_RMS_PX = 0.01, 0.004  # middles of ellipses lie 0.21 px aside here (rms)
NOISE_DN = 2.0


@lru_cache
def picture() -> np.ndarray:
    """Grey levels without noise: dots blurred by 0.7 px under light that falls off by a third across the image."""
    u, v = np.meshgrid(*((np.arange(n * FINE) + 0.5) / FINE - 0.5 for n in SIZE))
    xy = cv2.undistortPointsIter(np.stack([u, v], -1).reshape(-1, 1, 2), K, LENS, None, None, (3, 12, 1e-9))
    rays = np.concatenate([xy.reshape(-1, 2), np.ones((u.size, 1))], 1)
    on = (rays * ((R[:, 2] @ T) / (rays @ R[:, 2]))[:, None] - T) @ R
    p = BOARD.pitch_mm
    column, row = (np.clip(np.round(on[:, k] / p), 0, n - 1) for k, n in ((0, BOARD.columns), (1, BOARD.rows)))
    away = np.hypot(on[:, 0] - p * column, on[:, 1] - p * row).reshape(u.shape)
    across = (away - RADIUS_MM) / np.hypot(*np.gradient(away))  # distance from the rim in sub-pixels
    grey = (30.0 + 150.0 * np.clip(across + 0.5, 0, 1)) * (1 - 0.35 * u / SIZE[0])
    return gaussian_filter(grey, 0.7 * FINE).reshape(SIZE[1], FINE, SIZE[0], FINE).mean(axis=(1, 3))


def middles() -> np.ndarray:
    """Images (N, 2) of the dots' middles."""
    points = np.column_stack([BOARD.points_mm, np.zeros(len(BOARD.points_mm))])
    return cv2.projectPoints(points, cv2.Rodrigues(R)[0], T, K, LENS)[0][:, 0]


def found_in(image: np.ndarray) -> BoardCorners:
    """The dots in a picture of 8 bits."""
    found = find_board(np.clip(np.round(image), 0, 255).astype(np.uint8), BOARD)
    assert isinstance(found, BoardCorners)
    return found


def errors(image: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Seen less true (N, 2), and covariance."""
    found = found_in(image)
    truth = middles()
    nearest = np.argmin(np.linalg.norm(found.uv_px[:, None] - truth, axis=-1), axis=1)
    return found.uv_px - truth[nearest], found.covariance_px2


def test_dots_lie_where_the_lens_has_their_middles() -> None:
    rng = np.random.default_rng(3)
    off = np.mean([errors(picture() + rng.uniform(-0.5, 0.5, (SIZE[1], SIZE[0])))[0] for _ in range(4)], axis=0)
    assert len(off) == len(BOARD.points_mm)
    size = np.linalg.norm(off, axis=1)
    assert size.max() < BIAS_PX
    assert np.sqrt(np.mean(size**2)) < BIAS_RMS_PX


def test_the_sigma_of_dots_is_true() -> None:
    rng = np.random.default_rng(5)
    square = []
    for _ in range(6):
        off, covariance = errors(picture() + rng.normal(0, NOISE_DN, (SIZE[1], SIZE[0])))
        square.append(np.einsum("ni,nij,nj->n", off, np.linalg.inv(covariance), off))
    values = np.concatenate(square) / 2
    assert np.mean(values) == pytest.approx(1.0, abs=3 / np.sqrt(len(values)))


def test_distance_from_rims() -> None:
    board = Board("circles", 3, 3, 10.0)
    found = found_in(picture())
    assert found.dot_radius_mm == pytest.approx(RADIUS_MM, abs=0.02)
    at = np.array([[0.0, 0.0], [found.dot_radius_mm, 0.0], [5.0, 5.0]])
    assert _rim_distance(at, board, found) == pytest.approx(
        np.abs(np.array([0, found.dot_radius_mm, np.sqrt(50)]) - found.dot_radius_mm)
    )


def test_the_stripe_is_not_read_within_markers() -> None:
    board = Board("charuco", 5, 4, 12.0, 8.0, "DICT_4X4_50")
    four = np.array([[0.0, 0.0], [48.0, 0.0], [48.0, 36.0], [0.0, 36.0]])
    found = BoardCorners(four, four, np.tile(np.eye(2), (4, 1, 1)), 1.0, 100.0, markers_mm=np.array([[6.0, 6.0]]))
    at = np.array([[6.0, 7.0], [6.0, 11.0], [6.0, 18.0]])  # in a marker, beside it, in the middle of a dark square
    assert _border_distance(at, board, found) == pytest.approx([0.0, 1.0, 6.0])
