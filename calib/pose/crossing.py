"""Where the jig's strings cross the laser plane, for a batch of poses, with analytic Jacobians."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from geometry import Pose, cross

Array = NDArray[np.float64]

_PARALLEL = 1e-9  # |direction's x| below this: the string runs in the plane and crosses it nowhere


def crossings(T_sensor_jig: Pose, starts: Array, directions: Array) -> tuple[Array, Array]:
    """Crossings (..., S, 2) (y, z) [mm] of x = 0, and distances (..., S) [mm] along the strings from their starts.

    T_sensor_jig: batch (...). starts, directions: (S, 3) or (..., S, 3) in {J}, directions of unit length.
    """
    p, q = _lines(T_sensor_jig, starts, directions)
    s = -p[..., 0] / _away_from_zero(q[..., 0])
    return p[..., 1:] + s[..., None] * q[..., 1:], s


def crossings_jacobian(T_sensor_jig: Pose, starts: Array, directions: Array) -> tuple[Array, Array, Array]:
    """As ``crossings``, and the Jacobian (..., S, 2, 6) for T · Exp(ξ), ξ = (translation [mm], rotation [rad]).

    A motion v of the string at the crossing moves the crossing by v - q · v_x / q_x: it slides back to x = 0.
    """
    p, q = _lines(T_sensor_jig, starts, directions)
    qx = _away_from_zero(q[..., 0])
    s = -p[..., 0] / qx
    slope = q[..., 1:] / qx[..., None]  # (..., S, 2)
    R = T_sensor_jig.R[..., None, :, :]
    slide = (
        R[..., 1:, :] - slope[..., :, None] * R[..., :1, :]
    )  # (..., S, 2, 3): motion in jig axes to motion in the plane
    c = starts + s[..., None] * directions  # crossing in {J}
    # v = R (ρ + ω × c): row · (ω × c) = (c × row) · ω
    turn = cross(c[..., None, :], slide)
    return p[..., 1:] + s[..., None] * q[..., 1:], s, np.concatenate([slide, turn], -1)


def anchor_jacobian(T_sensor_jig: Pose, starts: Array, directions: Array, lengths: Array) -> tuple[Array, Array]:
    """Motion of the crossings with a shift in {J} of the strings' start and of their end: (..., S, 2, 3) each."""
    _, s, jacobian = crossings_jacobian(T_sensor_jig, starts, directions)
    share = (s / lengths)[..., None, None]
    return (1 - share) * jacobian[..., :3], share * jacobian[..., :3]


def _lines(T: Pose, starts: Array, directions: Array) -> tuple[Array, Array]:
    Rt = np.swapaxes(T.R, -1, -2)
    return starts @ Rt + T.t[..., None, :], directions @ Rt


def _away_from_zero(x: Array) -> Array:
    return np.where(np.abs(x) < _PARALLEL, np.where(x < 0, -_PARALLEL, _PARALLEL), x)
