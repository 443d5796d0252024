"""What the noise of points and joints together makes of a frame's weights, and which points they contradict."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from calib.bundle.linearise import Linearised
from calib.bundle.problem import Problem

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

_REMOVED = 1e8  # factor on the variance of a removed point
_JITTER = 1e-14  # keeps a frame whose strings lie almost in the sheet factorisable


def frame_covariance(problem: Problem, lin: Linearised, inflation: Array, hand_noise: Array) -> Array:
    """Covariance (F, 2M, 2M) [mm²] of a frame's points: localisation noise (times ``inflation`` (F, M)) and hand noise.

    hand_noise: (F, 6, 6). The joints' noise is common to a frame's points and correlates them; to first order this is
    the same as a hand pose per frame as an unknown with that prior.
    """
    f, m = problem.points.present.shape
    hand = lin.hand.reshape(f, 2 * m, 6)
    out = hand @ hand_noise @ np.swapaxes(hand, -1, -2)
    blocks = out.reshape(f, m, 2, m, 2)
    i = np.arange(m)
    blocks[:, i, :, i, :] += np.swapaxes(problem.points.cov_mm2 * inflation[..., None, None], 0, 1)
    return out


def whitener(covariance: Array) -> Array:
    """Matrices (F, 2M, 2M) that make the frames' residuals independent with unit variance."""
    size = covariance.shape[-1]
    level = np.trace(covariance, axis1=-2, axis2=-1)[:, None, None] / size
    return np.asarray(np.linalg.inv(np.linalg.cholesky(covariance + _JITTER * level * np.eye(size))))


def removal(removed: Mask) -> Array:
    """Inflation (F, M) that takes the removed points out of the solution."""
    return np.where(removed, _REMOVED, 1.0)


def deletion_chi2(problem: Problem, lin: Linearised, removed: Mask, hand_noise: Array) -> Array:
    """Squared Mahalanobis distance (F, M), 2 degrees, of every point from what its frame's other points say of it.

    Source: the deletion residual; with Q = S⁻¹, point i is off by Q_ii⁻¹ (Q r)_i of covariance Q_ii⁻¹.
    """
    f, m = removed.shape
    inflation = removal(removed)
    Q = np.linalg.inv(frame_covariance(problem, lin, inflation, hand_noise))
    q = (Q @ lin.residual.reshape(f, 2 * m, 1)).reshape(f, m, 2)
    i = np.arange(m)
    blocks = np.swapaxes(Q.reshape(f, m, 2, m, 2)[:, i, :, i, :], 0, 1)
    covariance = np.linalg.inv(blocks)
    error = (covariance @ q[..., None])[..., 0]
    covariance = covariance - problem.points.cov_mm2 * (inflation - 1)[..., None, None]
    return np.asarray(np.einsum("fmi,fmi->fm", error, np.linalg.solve(covariance, error[..., None])[..., 0]))


def frame_chi2(problem: Problem, lin: Linearised, removed: Mask, hand_noise: Array) -> tuple[Array, Array]:
    """χ² (F,) of whole frames and their degrees of freedom (F,), two a point that counts."""
    covariance = frame_covariance(problem, lin, removal(removed), hand_noise)
    r = lin.residual.reshape(len(removed), -1, 1)
    chi2 = (np.swapaxes(r, -1, -2) @ np.linalg.solve(covariance, r))[:, 0, 0]
    return chi2, 2.0 * np.sum(problem.points.present & ~removed, axis=1)
