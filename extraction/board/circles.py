"""Boards of dots: OpenCV finds the grid, moments tell place and size of each dot, and discs are fitted from there."""

from __future__ import annotations

from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from extraction.board.disc import FlatBoard, fit_discs
from extraction.board.found import BoardCorners, NoBoard
from extraction.board.plane import board_homography
from geometry import Board

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

WINDOW_SHARE = 0.5  # of the distance of neighbours: the next dots stay out
MIN_PIXELS = 20  # of a dot that has a middle worth the name
MIN_DOTS = 12
MAX_NOISE, MAX_AREA = 3.0, 0.1  # of a dot against the usual: beyond, a stripe or an edge of something lies across it
MAX_MISFIT, MAX_MOVE = 3.0, 0.2  # residual against the usual; from where moments have a dot, in its radius


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
    uv, area = table[:, :2], table[:, 2]
    flat = FlatBoard.of(xy, uv, image.shape)
    radius = float(np.sqrt(np.median(area / _areas(flat.homography, xy)) / np.pi))
    reach = WINDOW_SHARE * near[good][clear]
    fit = fit_discs(image, flat, xy, uv, radius, reach)
    alone = board.kind == "asymmetric_circles" and board.rows % 2 == 1  # else it looks the same turned by 180°
    fine = fit.misfit_dn < MAX_MISFIT * np.median(fit.misfit_dn)
    fine &= np.linalg.norm(fit.uv_px - uv, axis=1) < MAX_MOVE * np.sqrt(area / np.pi)
    if fine.sum() < MIN_DOTS:
        return NoBoard("too few dots are clear")
    return BoardCorners(
        xy[fine],
        fit.uv_px[fine],
        fit.covariance_px2[fine],
        float(np.median(fit.blur_px[fine])),
        float(np.median(np.abs(fit.step_dn[fine]))),
        float(np.median(fit.radius_mm[fine])),
        axes=alone or board.columns != board.rows,
        named=alone,
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
