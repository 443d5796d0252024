"""Whether a view that the others contradict would agree with them if its picture were mirrored or turned.

A mirrored picture of squares is one of squares, too: its corners fit a camera. Its stripe lies where the laser plane,
mirrored with it, would have drawn it.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from calib.sensor.choice import Choice
from calib.sensor.lens import undistort
from calib.sensor.start import board_pose, homography
from calib.sensor.terms import BOARD, CAMERA, PLANE, CornerResiduals, StripeOnBoard
from calib.sensor.views import BoardView, BoardViews
from geometry import Pose, State

Array = NDArray[np.float64]

WAYS = {"mirrored left to right": (-1.0, 1.0), "mirrored top to bottom": (1.0, -1.0), "turned by 180°": (-1.0, -1.0)}
AGREES_PX, AGREES_OFFSETS = 1.0, 3.0  # of its stripe from the plane, and the same in what all whole stripes are off
NEARER = 5.0  # times, than the stripe as it was seen
_STEPS = 8  # of its board's pose: Gauss and Newton's double their digits


def mirrored(view: BoardView, choice: Choice) -> str | None:
    """In which of the WAYS a view that was left out agrees with the solution of the others; None in none.

    view: pixels from the image's centre.
    """
    if not len(view.stripe) or len(view.corners) < 4:
        return None
    usual = _off_px(view, choice)
    off = {way: _off_px(_flipped(view, np.array(signs)), choice) for way, signs in WAYS.items()}
    best = min(off, key=lambda way: off[way])
    agrees = off[best] < max(AGREES_PX, AGREES_OFFSETS * choice.bundle.stripe_noise.offset_px)
    return best if agrees and NEARER * off[best] < usual else None


def _flipped(view: BoardView, signs: Array) -> BoardView:
    corners = replace(view.corners, uv_px=view.corners.uv_px * signs)
    stripe = replace(view.stripe, uv_px=view.stripe.uv_px * signs, normal=view.stripe.normal * signs)
    return replace(view, corners=corners, stripe=stripe)


def _off_px(view: BoardView, choice: Choice) -> float:
    """How far along its normal the stripe lies, the median of its points, from where its board meets the plane."""
    views, known = BoardViews((view,)), choice.result.state
    camera = known.vector(CAMERA)
    h = homography(view.corners.xy_mm, undistort(camera, view.corners.uv_px).value)
    pose = board_pose(h, 1.0)
    state = State({CAMERA: camera, PLANE: known.vector(PLANE), BOARD: Pose(pose.R[None], pose.t[None])})
    for _ in range(_STEPS):
        errors = CornerResiduals(views).errors(state)
        by, residual = errors.jacobian[BOARD].reshape(-1, 6), errors.residual.reshape(-1)
        step = np.linalg.lstsq(by, -residual, rcond=None)[0]
        state = state.with_value(BOARD, state.pose(BOARD) @ Pose.exp(step[None]))
    with np.errstate(all="ignore"):  # a board that meets the plane nowhere
        off = np.abs(StripeOnBoard(views).errors(state).residual)
    return float(np.median(off)) if np.all(np.isfinite(off)) else np.inf
