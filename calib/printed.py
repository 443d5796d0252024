"""The covariance of the SCP as it is printed, and how well it agrees with the truth where that is known."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from geometry import Pose

Array = NDArray[np.float64]


def printed_sigmas(T_hand_sensor: Pose, covariance: Array) -> tuple[Array, Array]:
    """σ of the rotations about fixed X, Y, Z (3,) [deg] and of the translation (3,) [mm], hand axes.

    covariance: (6, 6) of ξ, sensor axes. At gimbal lock (|Y| = 90°) X and Z are not separate; infinite there.
    """
    x, y, _ = np.deg2rad(T_hand_sensor.fixed_xyz_deg)
    rates = np.array(  # ω in sensor axes of unit rates of X, Y, Z for R = Rz·Ry·Rx
        [[1, 0, -np.sin(y)], [0, np.cos(x), np.sin(x) * np.cos(y)], [0, -np.sin(x), np.cos(x) * np.cos(y)]]
    )
    translation = np.sqrt(np.diag(T_hand_sensor.R @ covariance[:3, :3] @ T_hand_sensor.R.T))
    if abs(np.cos(y)) < 1e-9:
        locked = np.array([np.inf, np.sqrt(rates[:, 1] @ covariance[3:, 3:] @ rates[:, 1]), np.inf])
        return np.rad2deg(locked), translation
    to_angles = np.linalg.inv(rates)
    rotation = np.sqrt(np.diag(to_angles @ covariance[3:, 3:] @ to_angles.T))
    return np.rad2deg(rotation), translation


def nees(truth: Pose, estimate: Pose, covariance: Array) -> float:
    """Normalised estimation error squared ξᵀ P⁻¹ ξ of T = T̂·Exp(ξ); its mean over runs is 6 where P is true."""
    xi = (estimate.inverse() @ truth).log()
    return float(xi @ np.linalg.solve(covariance, xi))
