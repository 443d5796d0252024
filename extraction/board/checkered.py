"""Checkerboards, whole or in part: OpenCV finds a part of the grid, which grows to all corners that can be fitted."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from extraction.board.found import BoardCorners, NoBoard
from extraction.board.plane import board_homography, mapped
from extraction.board.saddle import Saddles, fit_saddles
from geometry import Board

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]
Grey = NDArray[np.uint8]

WINDOW_SHARE = 0.35  # of the distance of neighbours: the next corner's edges stay out
WINDOW_PX = (4, 16)  # beyond the larger the lens bends the edges
MAX_MOVE_SHARE = 0.15  # of the distance of neighbours, from where the grid expects a corner
MIN_CONTRAST_SHARE = 0.35  # of the usual contrast
MAX_MISFIT_SHARE = 0.25  # residual over contrast: a corner half hidden, or none
MAX_BEND_SHARE = 0.3  # of the distance of neighbours: perspective and lens make a tenth at most
MAX_OFF_SHARE = 0.2  # of the same, from the plane's grid: a lens bends less
ENOUGH = 0.7  # of a board's corners: of fewer another part that is found may grow to more
MIN_CORNERS = 12  # of a view: eight numbers of its homography and some to spare
SMALLEST = 3  # corners along a side of a part that is looked for
COUNTED_PX = 640  # the same, where corners are only counted
COARSE_PX = 1600  # larger pictures are searched at this width: squares stay large enough
_ROUNDS = 12


@dataclass(frozen=True, eq=False)
class _Grid:
    """Fitted corners by their place on the grid: (row, column) (N, 2) and pixels."""

    place: NDArray[np.intp]
    fit: Saddles


def find_checkerboard(image: Grey, board: Board, usable: Mask, quick: bool = False) -> BoardCorners | NoBoard:
    """The corners of a checkerboard in a picture of 8 bits (H, W)."""
    why, best = NoBoard("no checkerboard was found"), None
    for places, uv in _parts(image, board, quick):
        grid = _grown(image, places, uv, board, usable)
        if grid is None or len(grid.place) < MIN_CORNERS:
            why = NoBoard("too few corners of the checkerboard are clear")
        elif not _one_grid(grid):
            why = NoBoard("the corners found lie on no one grid: is the board's number of corners right?")
        elif best is None or len(grid.place) > len(best.place):
            best = grid
            if len(grid.place) >= ENOUGH * board.columns * board.rows:
                break
    return why if best is None else _found(best, board)


def _found(grid: _Grid, board: Board) -> BoardCorners:
    fit = grid.fit
    xy, axes, named = _as_stated(grid, board)
    blur = float(np.median(fit.blur_px))
    return BoardCorners(xy, fit.uv_px, fit.covariance_px2, blur, _step(fit), axes=axes, named=named)


def _as_stated(grid: _Grid, board: Board) -> tuple[Array, bool, bool]:
    """Places (N, 2) [mm] in the board's frame, whether its axes are the board's own, and whether corners are known.

    z points into the board. Where the whole board is seen, x runs along its columns; where a turn by 180° changes the
    colours, the square before the first corner is the dark one.
    """
    xy, fit = grid.place[:, ::-1] - grid.place[:, ::-1].min(axis=0), grid.fit
    colour = float(np.sign(np.median(fit.contrast_dn * (1 - 2 * (xy.sum(axis=1) % 2)))))
    h = board_homography(xy.astype(float), fit.uv_px)
    middle = np.append(xy.mean(axis=0), 1.0)
    if np.linalg.det(h) * (h[2] @ middle) < 0:  # counted as from behind
        xy, colour = np.stack([xy[:, 0].max() - xy[:, 0], xy[:, 1]], -1), -colour * (-1) ** int(np.ptp(xy[:, 0]))
    columns, rows = (np.ptp(xy, axis=0) + 1).tolist()
    if (columns, rows) == (board.rows, board.columns) != (board.columns, board.rows):
        xy, colour = np.stack([xy[:, 1], xy[:, 0].max() - xy[:, 0]], -1), -colour * (-1) ** int(np.ptp(xy[:, 0]))
        columns, rows = rows, columns
    axes = (columns, rows) == (board.columns, board.rows) and columns != rows
    named = axes and (columns + rows) % 2 == 1
    if named and colour < 0:
        xy = xy.max(axis=0) - xy
    return xy * board.pitch_mm, axes, named


def _one_grid(grid: _Grid) -> bool:
    """Do the corners lie where one plane's grid has them, and each near the middle of its neighbours?

    A part of a board that is counted wrongly may be found with corners left out between others; of two rows alone
    nothing tells how far apart they are.
    """
    xy, uv = grid.place[:, ::-1].astype(float), grid.fit.uv_px
    at = {(int(r), int(c)): p for (r, c), p in zip(grid.place, uv, strict=True)}
    steps, ways = [], set()
    for (r, c), middle in at.items():
        for dr, dc in ((0, 1), (1, 0)):
            one, other = at.get((r - dr, c - dc)), at.get((r + dr, c + dc))
            if one is None or other is None:
                continue
            steps.append(float(np.linalg.norm(other - one)) / 2)
            ways.add((dr, dc))
            if np.linalg.norm(one + other - 2 * middle) > MAX_BEND_SHARE * steps[-1]:
                return False
    if len(ways) < 2:
        return False
    off = np.linalg.norm(mapped(board_homography(xy, uv), xy) - uv, axis=1)
    return bool(off.max() < MAX_OFF_SHARE * float(np.median(steps)))


def fitted_corners(image: Grey, xy_mm: Array, uv: Array, window_share: float, pitch_mm: float, usable: Mask) -> Saddles:
    """Corners fitted near ``uv`` (N, 2), the edges' directions by the homography of the board."""
    h = board_homography(xy_mm, uv)
    along = _directions(h, xy_mm)
    step = pitch_mm * float(np.percentile(np.linalg.norm(along, axis=-1), 10))
    radius = int(np.clip(window_share * step, *WINDOW_PX))
    return fit_saddles(image, uv, along, radius, usable)


def _step(fit: Saddles) -> float:
    return float(2 * np.median(np.abs(fit.contrast_dn)))


def _parts(image: Grey, board: Board, quick: bool) -> Iterator[tuple[NDArray[np.intp], Array]]:
    """Places and pixels of the whole board or, where that is not found, of parts that are; they grow to all of it."""
    scale = min(1.0, COARSE_PX / max(image.shape))
    small = image
    if scale < 1:
        small = np.asarray(cv2.resize(image, None, fx=scale, fy=scale, interpolation=cv2.INTER_AREA), np.uint8)
    stretched = _stretched(small)
    tried = 0
    for size, picture, thorough in _attempts(board, small, stretched):
        if tried >= GROWN:
            return
        if thorough:
            found, corners = cv2.findChessboardCornersSB(picture, size, flags=0)
        else:
            found, corners = cv2.findChessboardCorners(picture, size, flags=QUICK)
        if found:
            row, column = np.divmod(np.arange(size[0] * size[1]), size[0])
            uv = (corners.reshape(-1, 2).astype(float) + 0.5) / scale - 0.5
            tried += 1
            yield np.stack([row, column], -1), uv
        if quick:
            return


QUICK = cv2.CALIB_CB_ADAPTIVE_THRESH | cv2.CALIB_CB_NORMALIZE_IMAGE | cv2.CALIB_CB_FAST_CHECK


def counts_seen(image: Grey) -> tuple[int, int] | None:
    """Inner corners along the two sides of a checkerboard that is seen whole, whichever way it lies; None without one.

    Parameters
    ----------
    image
        Grey levels (H, W), 8 bits.

    Returns
    -------
    counts
        A board hidden in part has as many as are seen together.
    """
    scale = min(1.0, COUNTED_PX / max(image.shape))
    small = cv2.resize(image, None, fx=scale, fy=scale, interpolation=cv2.INTER_AREA) if scale < 1 else image
    found, _, grid = cv2.findChessboardCornersSBWithMeta(small, (SMALLEST, SMALLEST), cv2.CALIB_CB_LARGER)
    return (int(grid.shape[1]), int(grid.shape[0])) if found else None


PARTS = 6  # sizes of parts that are tried, largest first
GROWN = 3  # grids that are tried to grow before a picture is given up


def _attempts(board: Board, picture: Grey, stretched: Grey) -> Iterator[tuple[tuple[int, int], Grey, bool]]:
    """The whole board by the quick detector and by the thorough one, then parts of it.

    The quick one takes seconds where a board of other counts is seen: then that is looked for, where it may be a part.
    """
    c, r = board.columns, board.rows
    seen = counts_seen(picture)
    other = seen is not None and sorted(seen) != sorted((c, r))
    if not other:
        yield (c, r), picture, False
    elif seen is not None:
        for columns, rows in (seen, seen[::-1]):
            if columns <= c and rows <= r:
                yield (columns, rows), picture, True
    yield (c, r), picture, True
    yield (c, r), stretched, True
    parts = [(c - i, r - j) for i in range(c - SMALLEST + 1) for j in range(r - SMALLEST + 1) if i + j]
    parts.sort(key=lambda s: -s[0] * s[1])
    for size in parts[:PARTS]:
        yield size, stretched, True


def _stretched(image: Grey) -> Grey:
    """The picture with its usual levels over the whole range: a dim board beside a stripe is seen by the detectors."""
    low, high = np.percentile(image[::4, ::4], [1, 97])
    if high - low < 8:
        high = float(np.percentile(image[::4, ::4], 99.5))
    gain = 255.0 / max(float(high - low), 8.0)
    return np.asarray(np.clip((image.astype(np.float32) - low) * gain, 0, 255), np.uint8)


def _grown(image: Grey, places: NDArray[np.intp], uv: Array, board: Board, usable: Mask) -> _Grid | None:
    """The grid with every corner that can be fitted, no larger than the board."""
    grid = _checked(image, places, uv, places, uv, usable)
    for _ in range(_ROUNDS):
        if grid is None or len(grid.place) < MIN_CORNERS:
            return grid
        wanted = _neighbours(grid.place, board)
        if not len(wanted):
            break
        h = board_homography(grid.place[:, ::-1].astype(float), grid.fit.uv_px)
        expected = mapped(h, wanted[:, ::-1].astype(float))
        inside = np.all((expected > 2) & (expected < np.array(image.shape[::-1]) - 3), axis=1)
        more = _checked(image, wanted[inside], expected[inside], grid.place, grid.fit.uv_px, usable, grid.fit)
        if more is None or not len(more.place):
            break
        grid = _joined(grid, more)
        if not _fits(np.ptp(grid.place, axis=0) + 1, board):
            return None
    return grid


def _checked(
    image: Grey,
    places: NDArray[np.intp],
    uv: Array,
    known_places: NDArray[np.intp],
    known_uv: Array,
    usable: Mask,
    usual: Saddles | None = None,
) -> _Grid | None:
    """Those of the expected corners that are corners: near their place, of the usual contrast and the right colour."""
    if not len(places):
        return None
    h = board_homography(known_places[:, ::-1].astype(float), known_uv)
    along = _directions(h, places[:, ::-1].astype(float))
    step = np.linalg.norm(along, axis=-1).min(axis=1)
    radius = int(np.clip(WINDOW_SHARE * np.percentile(step, 10), *WINDOW_PX))
    fit = fit_saddles(image, uv, along, radius, usable)
    sign = 1 - 2 * (places.sum(axis=1) % 2)
    usual_contrast = (usual or fit).contrast_dn
    colour = np.sign(np.median(fit.contrast_dn * sign)) if usual is None else _colour(known_places, usual)
    least = MIN_CONTRAST_SHARE * float(np.median(np.abs(usual_contrast)))
    good = fit.good & (fit.contrast_dn * sign * colour > least)
    good &= fit.misfit_dn < MAX_MISFIT_SHARE * np.abs(fit.contrast_dn)
    good &= np.linalg.norm(fit.uv_px - uv, axis=1) < np.maximum(MAX_MOVE_SHARE * step, 1.0)
    return _Grid(places[good], _taken(fit, good))


def _colour(places: NDArray[np.intp], fit: Saddles) -> float:
    return float(np.sign(np.median(fit.contrast_dn * (1 - 2 * (places.sum(axis=1) % 2)))))


def _taken(fit: Saddles, chosen: Mask) -> Saddles:
    return Saddles(*(getattr(fit, name)[chosen] for name in Saddles.__dataclass_fields__))


def _joined(a: _Grid, b: _Grid) -> _Grid:
    both = (np.concatenate([getattr(a.fit, n), getattr(b.fit, n)]) for n in Saddles.__dataclass_fields__)
    return _Grid(np.concatenate([a.place, b.place]), Saddles(*both))


def _neighbours(places: NDArray[np.intp], board: Board) -> NDArray[np.intp]:
    """Places beside those known that the board may still hold, whichever way it lies."""
    steps = np.array([[0, 1], [0, -1], [1, 0], [-1, 0]])
    around = np.unique((places[:, None] + steps).reshape(-1, 2), axis=0)
    known = {tuple(p) for p in places.tolist()}
    low, high = places.min(axis=0), places.max(axis=0)
    fits = _fits(np.maximum(high, around) - np.minimum(low, around) + 1, board)
    free = [tuple(p) not in known for p in around.tolist()]
    return np.asarray(around[fits & np.array(free, dtype=bool)])


def _fits(span: NDArray[np.intp], board: Board) -> Mask:
    """Whether grids of so many rows and columns (…, 2) are no larger than the board, whichever way it lies."""
    sides = np.array([board.rows, board.columns])
    return np.asarray((span <= sides).all(axis=-1) | (span <= sides[::-1]).all(axis=-1))


def _directions(h: Array, xy: Array) -> Array:
    """What a unit step along x and along y of the board is in the image (N, 2, 2), one a row."""
    p = np.column_stack([xy, np.ones(len(xy))]) @ h.T
    uv = p[:, :2] / p[:, 2:]
    return np.stack([(h[:2, k] - uv * h[2, k]) / p[:, 2:] for k in range(2)], 1)
