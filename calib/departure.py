"""How far one pose is from another, in the other's axes: the coordinates that the pose kernel's prior uses."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from geometry import Pose

Array = NDArray[np.float64]


def departure(mean: Pose, T: Pose) -> Array:
    """(translation [mm], rotation vector [rad]) (6,) with T = (mean.R Exp(w), mean.t + mean.R ρ), both single poses.

    As ``(mean.inverse() @ T).log()`` to second order, at a fraction of its time; a turn of 180° reads as (ρ, 0).
    """
    turn = mean.R.T @ T.R
    w = 0.5 * np.array([turn[2, 1] - turn[1, 2], turn[0, 2] - turn[2, 0], turn[1, 0] - turn[0, 1]])
    sine = math.sqrt(float(w @ w))
    angle = math.atan2(sine, 0.5 * (float(np.trace(turn)) - 1.0))
    out = np.empty(6)
    out[:3] = mean.R.T @ (T.t - mean.t)
    out[3:] = w * (angle / sine if sine > 1e-9 else 1.0)
    return out
