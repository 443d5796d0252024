"""A board's plane and its image: the homography between them."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


def board_homography(xy: Array, uv: Array) -> Array:
    """The map (3, 3) of points (N, 2) of a plane to their images; the identity where there is none."""
    h, _ = cv2.findHomography(xy.astype(np.float64), uv.astype(np.float64), 0)
    return np.eye(3) if h is None else np.asarray(h, dtype=float)


def mapped(h: Array, xy: Array) -> Array:
    """Images (N, 2) of points of a plane by a homography (3, 3)."""
    p = np.column_stack([xy, np.ones(len(xy))]) @ h.T
    return np.asarray(p[:, :2] / p[:, 2:])
