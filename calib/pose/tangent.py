"""How far one pose is from another, in the other's axes: the coordinates that the pose kernel's prior uses."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from geometry import Pose

Array = NDArray[np.float64]


def departure(mean: Pose, T: Pose) -> Array:
    """(translation [mm], rotation vector [rad]) (..., 6) with T = (mean.R Exp(w), mean.t + mean.R ρ).

    As ``(mean.inverse() @ T).log()`` to second order, at a fraction of its time; a turn of 180° reads as (ρ, 0).
    """
    back = np.swapaxes(mean.R, -1, -2)
    turn = back @ T.R
    across = [turn[..., 2, 1] - turn[..., 1, 2], turn[..., 0, 2] - turn[..., 2, 0], turn[..., 1, 0] - turn[..., 0, 1]]
    w = 0.5 * np.stack(across, -1)
    sine = np.sqrt(np.sum(w * w, axis=-1))
    cosine = 0.5 * (turn[..., 0, 0] + turn[..., 1, 1] + turn[..., 2, 2] - 1.0)
    scale = np.arctan2(sine, cosine) / np.where(sine > 1e-9, sine, 1.0)
    moved = (back @ (T.t - mean.t)[..., None])[..., 0]
    return np.concatenate([moved, w * np.where(sine > 1e-9, scale, 1.0)[..., None]], -1)
