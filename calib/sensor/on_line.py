"""Which stripe points lie on the board: its plane and the laser's meet in a straight line on the board."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from calib.sensor.bundle import on_board
from calib.sensor.lens import undistort
from calib.sensor.shape import BEND, BoardShape
from calib.sensor.terms import BOARD, CAMERA, PLANE, StripeOnBoard
from calib.sensor.views import BoardView, BoardViews, StripePoints
from geometry import Pose, State

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

_TRIES = 300  # pairs of points: a stripe that makes up a fifth of all is met with certainty
_ALIKE = 101  # points, over which the stripe's light changes little
_SEED = 20  # the same pairs every time
MIN_POINTS = 12  # of a stripe that counts
APART_PX = 8.0  # of a second stripe from the first: real ones have waves of a pixel or two


def on_one_line(
    view: BoardView, state: State, index: int, tolerance_px: float, shape: BoardShape | None = None
) -> BoardView:
    """The view with those points of its stripe that lie on the best supported straight line of the board."""
    stripe = view.stripe
    if len(stripe) < MIN_POINTS:
        return replace(view, stripe=stripe[:0])
    board = state.pose(BOARD)
    T = Pose(board.R[index], board.t[index])
    xy = _straightened(view, state, T, shape)
    depth = float(np.median(np.linalg.norm(on_board(state.vector(CAMERA), T, stripe.uv_px), axis=1)))
    tolerance = tolerance_px * depth / float(state.vector(CAMERA)[0])
    good = _largest_line(xy, tolerance)
    for _ in range(3):
        good = _off_line(xy, good) < tolerance
    return replace(view, stripe=_steadied(stripe[good]) if good.sum() >= MIN_POINTS else stripe[:0])


def _straightened(view: BoardView, state: State, T: Pose, shape: BoardShape | None) -> Array:
    """The stripe's points (N, 2) on the board T_camera_board, moved so that they are straight where the board is bent.

    Where z on the board and m · x = d is the laser plane in its frame, a height shifts the line by m z across it.
    """
    camera = state.vector(CAMERA)
    if shape is None or BEND not in state.values or PLANE not in state.values:
        return np.asarray((T.inverse() @ on_board(camera, T, view.stripe.uv_px))[:, :2])
    q = np.column_stack([undistort(camera, view.stripe.uv_px).value, np.ones(len(view.stripe))])
    alone = state.with_value(BOARD, Pose(T.R[None], T.t[None]))
    reach = StripeOnBoard(BoardViews((view,)), shape=shape).met(alone, q).reach
    p, m = T.inverse() @ (reach[:, None] * q), T.R.T @ state.vector(PLANE)
    return np.asarray(p[:, :2] + m[:2] * (m[2] * p[:, 2] / (m[:2] @ m[:2]))[:, None])


def second_line(
    view: BoardView, kept: BoardView, state: State, index: int, tolerance_px: float, shape: BoardShape | None = None
) -> int:
    """How many points of a view's stripe that were not ``kept`` lie on another straight line of the board.

    Beside the first by more than what bends a stripe: a sheet or a board that is not flat is no second stripe.
    """
    rest = view.stripe[~np.isin(_numbers(view), _numbers(kept))]
    board = state.pose(BOARD)
    T, camera = Pose(board.R[index], board.t[index]), state.vector(CAMERA)
    both = (np.concatenate([getattr(s, n) for s in (rest, kept.stripe)]) for n in StripePoints.__dataclass_fields__)
    xy = _straightened(replace(view, stripe=StripePoints(*both)), state, T, shape)
    used = np.arange(len(xy)) >= len(rest)
    depth = np.linalg.norm(on_board(camera, T, kept.stripe.uv_px), axis=1)
    apart = APART_PX * float(np.median(depth)) / float(camera[0])
    far = _off_line(xy, used)[: len(rest)] > apart
    return len(on_one_line(replace(view, stripe=rest[far]), state, index, tolerance_px, shape).stripe)


def _numbers(view: BoardView) -> NDArray[np.complex128]:
    """The stripe's pixels as one number each."""
    return np.asarray(view.stripe.uv_px[:, 1] + 1j * view.stripe.uv_px[:, 0])


def _steadied(stripe: StripePoints) -> StripePoints:
    """The stripe with σ as its neighbours have it: errors that neighbours share do not follow each point's own σ."""
    from scipy.ndimage import median_filter  # a tenth of a second, and most commands need none of it

    return replace(stripe, sigma_px=median_filter(stripe.sigma_px, size=_ALIKE, mode="nearest"))


def _largest_line(xy: Array, tolerance: float) -> Mask:
    """The points (N,) near that line through two of them which has most of them near it; ties to the first."""
    pairs = np.random.default_rng(_SEED).integers(0, len(xy), (_TRIES, 2))
    a, b = xy[pairs[:, 0]], xy[pairs[:, 1]]
    along = b - a
    length = np.linalg.norm(along, axis=1)
    fine = length > 20 * tolerance
    if not np.any(fine):
        return np.ones(len(xy), dtype=bool)
    normal = np.stack([-along[fine, 1], along[fine, 0]], -1) / length[fine, None]
    near = np.abs((xy[None] - a[fine][:, None]) @ normal[..., None])[..., 0] < tolerance
    return np.asarray(near[int(np.argmax(near.sum(axis=1)))])


def _off_line(xy: Array, good: Mask) -> Array:
    """Distances (N,) from the straight line through the ``good`` points."""
    if good.sum() < 2:
        return np.full(len(xy), np.inf)
    middle = xy[good].mean(axis=0)
    normal = np.linalg.svd(xy[good] - middle, full_matrices=False)[2][-1]
    return np.asarray(np.abs((xy - middle) @ normal))
