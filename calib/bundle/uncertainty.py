"""The covariance of what was estimated, with robot errors that were not estimated carried along."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from calib.bundle.bundle import BundleResult
from calib.bundle.normal import reduced, scaled_solve
from geometry import Pose

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Uncertainty:
    """Covariance (C, C) of the common unknowns with considered parameters, and without them (noise alone).

    Zero rows for what was not estimated. jigs (L, 6, 6): covariance of each location's jig pose, jig axes.
    condition: of the SCP's information, all else marginalised, columns scaled to unit norm.
    """

    covariance: Array
    noise_covariance: Array
    jigs: Array
    condition: float

    @property
    def scp(self) -> Array:
        """Covariance (6, 6) of ξ in T_hand_sensor·Exp(ξ), sensor axes [mm, rad]."""
        return self.covariance[:6, :6]


def uncertainty(result: BundleResult) -> Uncertainty:
    """Covariances at the solution (Schmidt's consider analysis for the parameters that were left at their nominal)."""
    schur, gain = reduced(result.normal)
    free = result.free
    considered = ~free & (result.prior_sigma > 0)
    information = schur[np.ix_(free, free)]
    noise = scaled_solve(information, np.eye(int(free.sum())))
    bias = -noise @ schur[np.ix_(free, considered)] * result.prior_sigma[considered]  # change per σ of each
    c = len(free)
    noise_covariance, covariance = np.zeros((c, c)), np.zeros((c, c))
    noise_covariance[np.ix_(free, free)] = noise
    covariance[np.ix_(free, free)] = noise + bias @ bias.T
    return Uncertainty(covariance, noise_covariance, _jigs(result, gain, noise, considered), _condition(information))


def _jigs(result: BundleResult, gain: Array, noise: Array, considered: NDArray[np.bool_]) -> Array:
    """Covariance of the jig poses: η = -Hjj⁻¹(g + Hjc c), noise and considered parts."""
    free = result.free
    schur, _ = reduced(result.normal)
    sigma = result.prior_sigma[considered]
    common = -noise @ schur[np.ix_(free, considered)] * sigma
    own = np.linalg.inv(result.normal.jigs)
    to_free = np.swapaxes(gain[:, free], -1, -2)  # (L, 6, C_free)
    to_considered = np.swapaxes(gain[:, considered], -1, -2) * sigma
    bias = -to_free @ common - to_considered
    out = own + to_free @ noise @ np.swapaxes(to_free, -1, -2) + bias @ np.swapaxes(bias, -1, -2)
    return np.asarray(out)


def _condition(information: Array) -> float:
    """Condition number of the SCP's scaled Jacobian once everything else is marginalised."""
    rest = information[6:, 6:]
    scp = information[:6, :6]
    if len(rest):
        scp = scp - information[:6, 6:] @ scaled_solve(rest, information[6:, :6])
    scale = 1 / np.sqrt(np.maximum(np.diag(scp), 1e-300))
    values = np.linalg.eigvalsh(scp * scale[:, None] * scale)
    return float(np.sqrt(values[-1] / values[0])) if values[0] > 1e-16 * values[-1] else float("inf")


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
