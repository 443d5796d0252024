"""Pictures of boards by another road than the emulator's: every sub-pixel's ray by OpenCV meets the printed pattern."""

from __future__ import annotations

from functools import lru_cache

import cv2
import numpy as np

from geometry import Board, exp_so3

SIZE = (640, 512)
K = np.array([[1150.0, 0, 325.0], [0, 1148.0, 250.0], [0, 0, 1]])
LENS = np.array([-0.14, 0.11, 7e-4, -9e-4, 0.0])
FINE = 3  # sub-pixels along a side
DARK, WHITE = 25.0, 170.0
NORMAL = np.array([0.03, 0.93, 0.36]) / np.linalg.norm([0.03, 0.93, 0.36])
DISTANCE_MM = float(NORMAL @ [0, 0, 290.0])
STRIPE_MM = 0.35  # 1/e² half-width of the sheet
CHARUCO_PX = 40  # of a square, as OpenCV draws it


@lru_cache
def _rays() -> np.ndarray:
    """Rays (H·FINE, W·FINE, 3) of all sub-pixels."""
    u, v = np.meshgrid(*((np.arange(n * FINE) + 0.5) / FINE - 0.5 for n in SIZE))
    grid = np.stack([u, v], -1).reshape(-1, 1, 2)
    xy = cv2.undistortPointsIter(grid, K, LENS, None, None, (3, 20, 1e-10)).reshape(*u.shape, 2)
    return np.concatenate([xy, np.ones((*u.shape, 1))], -1)


@lru_cache
def _charuco(board: Board) -> np.ndarray:
    squares = (board.columns + 1, board.rows + 1)
    words = cv2.aruco.getPredefinedDictionary(getattr(cv2.aruco, board.dictionary))
    printed = cv2.aruco.CharucoBoard(squares, board.pitch_mm, board.marker_mm, words)
    return printed.generateImage((squares[0] * CHARUCO_PX, squares[1] * CHARUCO_PX))


def _is_dark(board: Board, x: np.ndarray, y: np.ndarray) -> np.ndarray:
    p = board.pitch_mm
    if board.kind == "checkerboard":
        on = (x > -p) & (x < board.columns * p) & (y > -p) & (y < board.rows * p)
        return on & ((np.floor(x / p) + np.floor(y / p)) % 2 == 0)
    if board.kind == "charuco":
        image = _charuco(board)
        i, j = (np.floor((a + p) / p * CHARUCO_PX).astype(int) for a in (y, x))
        on = (i >= 0) & (j >= 0) & (i < image.shape[0]) & (j < image.shape[1])
        return on & (image[np.clip(i, 0, image.shape[0] - 1), np.clip(j, 0, image.shape[1] - 1)] < 128)
    row = np.clip(np.round(y / p), 0, board.rows - 1)
    step, first = (2, row % 2) if board.kind == "asymmetric_circles" else (1, 0)
    column = np.clip(np.round((x / p - first) / step), 0, board.columns - 1)
    return (x - p * (step * column + first)) ** 2 + (y - p * row) ** 2 < radius_mm(board) ** 2


def radius_mm(board: Board) -> float:
    """Of a board's dots."""
    return 0.3 * board.pitch_mm * (1.4 if board.kind == "asymmetric_circles" else 1.0)


def pose_of(board: Board, tilt: tuple[float, float], turn: float, at: tuple[float, float, float]):
    """R and t of a board whose middle stands ``at``."""
    R = exp_so3(np.array([*tilt, 0.0])) @ exp_so3(np.array([0, 0, turn]))
    return R, np.array(at) - R @ [*board.points_mm.mean(axis=0), 0.0]


def pictured(board: Board, R: np.ndarray, t: np.ndarray, rng: np.random.Generator, stripe: str = "off") -> np.ndarray:
    """A picture of a board: "off" lit alone, "on" the stripe alone, "both"."""
    rays = _rays()
    n = R[:, 2]
    X = rays * ((n @ t) / (rays @ n))[..., None]
    xy = (X - t) @ R
    x, y = xy[..., 0], xy[..., 1]
    p = board.pitch_mm
    low, high = board.points_mm.min(axis=0) - 2 * p, board.points_mm.max(axis=0) + 2 * p
    paper = (x > low[0]) & (x < high[0]) & (y > low[1]) & (y < high[1])
    share = np.where(_is_dark(board, x, y), DARK / WHITE, 1.0) * np.where(paper, 1.0, 0.15)
    grey = np.zeros(share.shape)
    if stripe != "on":
        grey += WHITE * share
    if stripe != "off":
        across = (X @ NORMAL - DISTANCE_MM) / np.linalg.norm(np.cross(NORMAL, n))
        grey += 600 * share * np.exp(-2 * (across / STRIPE_MM) ** 2)
    grey = cv2.GaussianBlur(grey, None, 0.7 * FINE)
    coarse = grey.reshape(SIZE[1], FINE, SIZE[0], FINE).mean(axis=(1, 3)) + 3
    return np.clip(np.round(coarse + rng.normal(0, 1.0 + np.sqrt(coarse) / 12, coarse.shape)), 0, 255).astype(np.uint8)


def truth_px(board: Board, R: np.ndarray, t: np.ndarray) -> np.ndarray:
    """Where OpenCV projects the corners or dots (N, 2)."""
    xyz = np.column_stack([board.points_mm, np.zeros(len(board.points_mm))])
    return cv2.projectPoints(xyz, cv2.Rodrigues(R)[0], t, K, LENS)[0][:, 0]
