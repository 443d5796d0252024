"""Which points and frames the others contradict, by the noise of points and hands together."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from calib.bundle.on_target import OnTarget, OnTargetLinearised, removal

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]


def deletion_chi2(term: OnTarget, lin: OnTargetLinearised, hand_noise: Array) -> Array:
    """Squared Mahalanobis distance (F, M), k degrees, of every point from what its frame's other points say of it.

    hand_noise (F, 6, 6) stands in place of the term's own. Source: the deletion residual; with Q = S⁻¹, point i is off
    by Q_ii⁻¹ (Q r)_i of covariance Q_ii⁻¹.
    """
    f, m = term.removed.shape
    k = lin.offset.shape[1] // m
    inflation = removal(term.removed)
    Q = np.linalg.inv(term.covariance(lin.by_point, lin.by_hand, hand_noise))
    q = (Q @ lin.offset[..., None]).reshape(f, m, k)
    i = np.arange(m)
    blocks = np.swapaxes(Q.reshape(f, m, k, m, k)[:, i, :, i, :], 0, 1)
    covariance = np.linalg.inv(blocks)
    error = (covariance @ q[..., None])[..., 0]
    covariance = covariance - term.point_covariance(lin.by_point) * (inflation - 1)[..., None, None]
    return np.asarray(np.einsum("fmi,fmi->fm", error, np.linalg.solve(covariance, error[..., None])[..., 0]))


def frame_chi2(term: OnTarget, lin: OnTargetLinearised, hand_noise: Array) -> tuple[Array, Array]:
    """χ² (F,) of whole frames and their degrees of freedom (F,), k a point that counts."""
    covariance = term.covariance(lin.by_point, lin.by_hand, hand_noise)
    r = lin.offset[..., None]
    chi2 = (np.swapaxes(r, -1, -2) @ np.linalg.solve(covariance, r))[:, 0, 0]
    k = lin.offset.shape[1] // term.removed.shape[1]
    return chi2, float(k) * np.sum(term.points.present & ~term.removed, axis=1)
