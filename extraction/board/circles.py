"""Boards of dots: OpenCV finds the grid, each dot is localised by its moments, and its perspective is taken off.

A circle's image is an ellipse, whose middle is not the image of the circle's middle: by the board's homography the
difference is known once the dots' radius is, which their area tells.
"""

from __future__ import annotations

from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from extraction.board.checkered import board_homography
from extraction.board.found import BoardCorners, NoBoard
from geometry import Board

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

WINDOW_SHARE = 0.5  # of the distance of neighbours: the next dots stay out
MIN_PIXELS = 20  # of a dot that has a middle worth the name
MIN_DOTS = 12
MAX_NOISE, MAX_AREA = 3.0, 0.1  # of a dot against the usual: beyond, a stripe or an edge of something lies across it
BLUR_PX = 0.8  # of an edge whose width moments do not tell


def find_circles(image: NDArray[np.uint8], board: Board, usable: Mask) -> BoardCorners | NoBoard:
    """The dots of a board in a picture of 8 bits (H, W), dark on bright or bright on dark."""
    kind = cv2.CALIB_CB_ASYMMETRIC_GRID if board.kind == "asymmetric_circles" else cv2.CALIB_CB_SYMMETRIC_GRID
    size = (board.columns, board.rows)
    for bright in (False, True):
        seen = 255 - image if bright else image
        for flags in (kind, kind | cv2.CALIB_CB_CLUSTERING):
            found, centres = cv2.findCirclesGrid(seen, size, flags=flags, blobDetector=_detector(image.shape))
            if found:
                return _localised(seen, board, centres.reshape(-1, 2).astype(float), usable)
    return NoBoard("no grid of dots was found (all of it must be seen)")


def _detector(shape: tuple[int, ...]) -> Any:
    parameters = cv2.SimpleBlobDetector.Params()
    parameters.minArea, parameters.maxArea = MIN_PIXELS, shape[0] * shape[1] / 50
    parameters.minDistBetweenBlobs = 4
    return cv2.SimpleBlobDetector.create(parameters)


def _localised(image: NDArray[np.uint8], board: Board, start: Array, usable: Mask) -> BoardCorners | NoBoard:
    xy = board.points_mm
    distance = np.linalg.norm(start[:, None] - start, axis=-1)
    np.fill_diagonal(distance, np.inf)
    near = distance.min(axis=1)
    measured = [_dot(image, at, WINDOW_SHARE * d, usable) for at, d in zip(start, near, strict=True)]
    good = np.array([m is not None for m in measured])
    if good.sum() < MIN_DOTS:
        return NoBoard("too few dots are clear")
    table, xy = np.array([m for m in measured if m is not None]), xy[good]
    clear = _alike(table, xy)
    if clear.sum() < MIN_DOTS:
        return NoBoard("too few dots are clear: something lies across most of them")
    table, xy = table[clear], xy[clear]
    uv, area, noise, contrast = table[:, :2], table[:, 2], table[:, 3], table[:, 4]
    h = board_homography(xy, uv)
    for _ in range(2):  # the homography of the middles, then with the middles set right
        radius = float(np.sqrt(np.median(area / _areas(h, xy)) / np.pi))
        h = board_homography(xy, uv - _eccentricity(h, xy, radius))
    return BoardCorners(
        xy,
        uv - _eccentricity(h, xy, radius),
        noise[:, None, None] ** 2 * np.eye(2),
        BLUR_PX,
        float(np.median(contrast)),
    )


def _alike(table: Array, xy: Array) -> Mask:
    """Which dots (N,) have the usual noise about them and the size that the board's pose gives."""
    h = board_homography(xy, table[:, :2])
    size = table[:, 2] / _areas(h, xy)
    usual = np.abs(size / np.median(size) - 1) < MAX_AREA
    return np.asarray(usual & (table[:, 3] < MAX_NOISE * np.median(table[:, 3])))


def _dot(
    image: NDArray[np.uint8], at: Array, reach: float, usable: Mask
) -> tuple[float, float, float, float, float] | None:
    """Middle (u, v), area [px²], σ [px], contrast [DN] of a dark dot, by moments of its darkness; None if unclear."""
    r = int(np.ceil(reach))
    u0, v0 = (round(float(x)) for x in at)
    if u0 - r < 0 or v0 - r < 0 or u0 + r >= image.shape[1] or v0 + r >= image.shape[0]:
        return None
    cut = image[v0 - r : v0 + r + 1, u0 - r : u0 + r + 1].astype(float)
    y, x = np.mgrid[-r : r + 1, -r : r + 1]
    inside = np.hypot(x, y) <= reach
    if not usable[v0 - r : v0 + r + 1, u0 - r : u0 + r + 1][inside].all():
        return None
    dark, bright = np.percentile(cut[inside], [5, 90])
    contrast = float(bright - dark)
    if contrast < 8:
        return None
    share = np.clip((bright - cut) / contrast, 0, 1) * inside
    core = share > 0.1
    weight = share * core
    area = float(weight.sum())
    if area < MIN_PIXELS or (core[0].any() and core[-1].any()):
        return None
    cu, cv = float((weight * x).sum() / area), float((weight * y).sum() / area)
    rim = inside & (np.hypot(x, y) > 0.9 * reach)
    spread = max(float(np.std(cut[rim])), 0.5) / contrast
    second = float((core * ((x - cu) ** 2)).sum())
    sigma = spread * np.sqrt(second) / area
    return u0 + cu, v0 + cv, area, float(max(sigma, 1e-3)), contrast


def _areas(h: Array, xy: Array) -> Array:
    """Area [px²] of a square millimetre of the board at points (N, 2)."""
    p = np.column_stack([xy, np.ones(len(xy))]) @ h.T
    return np.asarray(np.abs(np.linalg.det(h) / p[:, 2] ** 3))


def _eccentricity(h: Array, xy: Array, radius: float) -> Array:
    """Middle of the ellipse less image of the circle's middle (N, 2) [px]."""
    out = np.empty_like(xy)
    inverse = np.linalg.inv(h)
    for i, (x, y) in enumerate(xy):
        circle = np.array([[1, 0, -x], [0, 1, -y], [-x, -y, x * x + y * y - radius**2]])
        q = inverse.T @ circle @ inverse
        middle = np.linalg.solve(q[:2, :2], -q[:2, 2])
        p = h @ [x, y, 1.0]
        out[i] = middle - p[:2] / p[2]
    return out
