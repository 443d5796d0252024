"""The covariance of the SCP as it is printed, and how well it agrees with the truth where that is known."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from geometry import Pose

Array = NDArray[np.float64]

_LOCKED_COS = 0.05  # |Y| within 3° of 90°: σ of X and Z exceed that of the rotation twenty times


def printed_sigmas(T_hand_sensor: Pose, covariance: Array) -> tuple[Array, Array]:
    """σ of the six printed numbers of an SCP.

    Parameters
    ----------
    T_hand_sensor : Pose
        One.
    covariance : (6, 6)
        Of ξ = (translation, rotation) in sensor axes [mm, rad].

    Returns
    -------
    rotations : (3,) array
        About fixed X, Y, Z [deg]; at gimbal lock (|Y| = 90°) X and Z are not separate, and infinite.
    translation : (3,) array
        [mm], hand axes.
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


def gimbal_note(T_hand_sensor: Pose, covariance: Array) -> tuple[str, ...]:
    """One line where X and Z turn about the same axis, so that neither has a σ of its own; else none."""
    x, y, z = T_hand_sensor.fixed_xyz_deg
    if abs(np.cos(np.deg2rad(y))) > _LOCKED_COS:
        return ()
    both, sign = (x - z, "-") if y > 0 else (x + z, "+")
    both, sigma = (both + 180) % 360 - 180, np.rad2deg(np.sqrt(covariance[3, 3]))
    rows = "; ".join(", ".join(f"{v:.7f}" for v in row) for row in T_hand_sensor.R)
    return (
        f"rotation Y is {y:.3f}°: X and Z turn about the same axis there, so that their large σ say nothing of the "
        f"pose; X {sign} Z = {both:.4f} ± {sigma:.4f}° is what is known, and the matrix is [{rows}]: enter it, or a "
        "quaternion",
    )


def nees(truth: Pose, estimate: Pose, covariance: Array) -> float:
    """Normalised estimation error squared ξᵀ P⁻¹ ξ of T = T̂·Exp(ξ); its mean over runs is 6 where P is true."""
    xi = (estimate.inverse() @ truth).log()
    return float(xi @ np.linalg.solve(covariance, xi))
