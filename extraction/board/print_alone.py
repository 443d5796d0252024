"""What a picture of a board with the stripe on it would show without the laser, where no such picture was taken.

Squares or dots with blurred borders, whose bright and dark levels change slowly over the board: what they are is told
by all pixels but the few that the stripe lights.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from extraction.board.found import BoardCorners
from extraction.board.plane import board_homography, mapped
from extraction.image import Image
from geometry import Board
from geometry.special import erf

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

CLEAR_WIDTHS = 3.0  # Gaussian σ of the edges' blur from a border, beyond which levels are those of one colour
LEVEL_ORDER = 2  # of the polynomial that levels follow: room light falls off, no more
LENS_ORDERS = ((3, 20), (2, 12))  # of the polynomial beside a homography, and the corners that it needs
ROUNDS, SIGMAS, LEAST_DN = 6, 3.0, 1.5  # of a level's fit: pixels that lie off by more are the stripe's
FEWEST = 100  # pixels of a colour


def print_alone(image: Image, board: Board, corners: BoardCorners) -> tuple[Image, Mask] | None:
    """The print without the laser.

    Parameters
    ----------
    image
        Grey levels (H, W) of the board with the stripe on it.
    board, corners
        The board and where it was found.

    Returns
    -------
    picture, known
        Levels (H, W) as the picture's, and where they are known: about the corners that were found, but not on markers.
        None where the picture tells too little.
    """
    low, high = np.floor(corners.uv_px.min(axis=0)), np.ceil(corners.uv_px.max(axis=0))
    beyond = (high - low) / 2 + 2
    u0, v0 = np.maximum(low - beyond, 0).astype(int)
    u1, v1 = np.minimum(high + beyond + 1, image.shape[::-1]).astype(int)
    v, u = np.mgrid[v0:v1, u0:u1].astype(float)
    if min(u.shape) < 2:
        return None
    xy = _on_print(np.column_stack([u.ravel(), v.ravel()]), corners).reshape(*u.shape, 2)
    per_px = np.stack([np.hypot(*np.gradient(xy[..., i])) for i in (0, 1)], -1)
    blur = max(corners.blur_px, 0.3)
    colour, known = (_squares if board.is_checkered else _dots)(xy, per_px, board, corners, blur)
    part = image[v0:v1, u0:u1].astype(float)
    middle, half = (u0 + u1) / 2, (u1 - u0) / 2
    basis = _powers((u - middle) / half, (v - (v0 + v1) / 2) / half, LEVEL_ORDER)
    levels = [_level(part, basis, known & (sign * colour > 0.99)) for sign in (1, -1)]
    if levels[0] is None or levels[1] is None:
        return None
    drawn = (1 + colour) / 2 * levels[0] + (1 - colour) / 2 * levels[1]
    top = np.iinfo(image.dtype).max
    out, where = image.copy(), np.zeros(image.shape, dtype=bool)
    out[v0:v1, u0:u1] = np.where(known, np.rint(np.clip(drawn, 0, top)), part).astype(image.dtype)
    where[v0:v1, u0:u1] = known
    return out, where


def _on_print(uv: Array, corners: BoardCorners) -> Array:
    """Where pixels (N, 2) lie on the print: a homography, and beside it a polynomial for the lens."""
    h = board_homography(corners.uv_px, corners.xy_mm)
    xy = mapped(h, uv)
    middle = corners.uv_px.mean(axis=0)
    scale = float(np.abs(corners.uv_px - middle).max())
    for order, fewest in LENS_ORDERS:
        if len(corners) >= fewest:
            left = corners.xy_mm - mapped(h, corners.uv_px)
            x, y = ((corners.uv_px - middle) / scale).T
            bend = np.linalg.lstsq(_powers(x, y, order), left, rcond=None)[0]
            x, y = ((uv - middle) / scale).T
            return np.asarray(xy + _powers(x, y, order) @ bend)
    return xy


def _powers(x: Array, y: Array, order: int) -> Array:
    """All products of powers of x and y up to an order (…, n)."""
    return np.stack([x**i * y**j for i in range(order + 1) for j in range(order + 1 - i)], -1)


def _squares(xy: Array, per_px: Array, board: Board, corners: BoardCorners, blur: float) -> tuple[Array, Mask]:
    """Of pixels (H, W): 1 on squares of the one colour, -1 on the other, between them at borders; and where known."""
    pitch = board.pitch_mm
    first = corners.xy_mm.min(axis=0)
    s = (xy - first) / pitch
    line = np.round(s)
    edge = erf((s - line) * pitch / per_px / (np.sqrt(2) * blur)) * np.where(line % 2 == 0, 1, -1)
    cell = np.floor(s).astype(int)
    place = np.round((corners.xy_mm - first) / pitch).astype(int)
    seen = np.zeros(place.max(axis=0) + 3, dtype=bool)  # a ring of none about them
    seen[tuple((place + 1).T)] = True
    about = np.zeros(xy.shape[:2], dtype=bool)
    for i in (0, 1):
        for j in (0, 1):
            at = np.clip(cell + np.array([i, j]) + 1, 0, np.array(seen.shape) - 1)
            about |= seen[at[..., 0], at[..., 1]]
    # squares end with the print: beyond their outer borders nothing is known
    inside = np.all((xy > first - pitch + CLEAR_WIDTHS * blur * per_px), axis=-1)
    last = corners.xy_mm.max(axis=0) + pitch
    inside &= np.all(xy < last - CLEAR_WIDTHS * blur * per_px, axis=-1)
    known = about & inside
    if corners.markers_mm is not None and len(corners.markers_mm):
        reach = board.marker_mm / 2 + CLEAR_WIDTHS * blur * float(np.median(per_px))
        for marker in corners.markers_mm:
            known &= np.any(np.abs(xy - marker) > reach, axis=-1)
    return edge[..., 0] * edge[..., 1], known


def _dots(xy: Array, per_px: Array, board: Board, corners: BoardCorners, blur: float) -> tuple[Array, Mask]:
    """As `_squares`, of dots: 1 on them."""
    from scipy.spatial import cKDTree  # a tenth of a second, and most commands need none of it

    distance = cKDTree(corners.xy_mm).query(xy.reshape(-1, 2))[0].reshape(xy.shape[:2])
    colour = erf((corners.dot_radius_mm - distance) / per_px.mean(axis=-1) / (np.sqrt(2) * blur))
    return colour, distance < board.pitch_mm


def _level(part: Array, basis: Array, of: Mask) -> Array | None:
    """The level (H, W) that the pixels of one colour have, without those that the stripe lights."""
    x, y = basis[of], part[of]
    kept = np.ones(len(y), dtype=bool)
    for _ in range(ROUNDS):
        if kept.sum() < FEWEST:
            return None
        by = np.linalg.lstsq(x[kept], y[kept], rcond=None)[0]
        left = y - x @ by
        middle = float(np.median(left[kept]))
        spread = 1.4826 * float(np.median(np.abs(left[kept] - middle)))
        kept = np.abs(left - middle) < max(SIGMAS * spread, LEAST_DN)
    return np.asarray(basis @ by)
