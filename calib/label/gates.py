"""Labels with a guess of the pose: one string after another, each within the gate that the earlier ones leave."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from calib.pose import crossings_jacobian
from geometry import Pose
from geometry.ties import ascending
from jig_cad import Jig

Array = NDArray[np.float64]
IntArray = NDArray[np.intp]

GATE_CHI2 = 20.0  # 2 degrees of freedom: 4.5e-5 of true spots lie outside
DETECTED = 0.9  # a string's share of being seen at all; cells find 0.999, frames with posts in the way some 0.9
SAME_SCORE, SAME_GATE = 1e-6, 1e-6  # nats, and relative: nearer ones keep the order of spots and strings
SECOND_ORDER = (
    0.12  # at the widest guess (4 mm, 1.5°): error of the linear prediction as a share of the first-order motion's σ
)


def gated_labels(
    yz_mm: Array, cov_mm2: Array, jig: Jig, guess: Pose, covariance: Array, density: float, limit: int
) -> IntArray:
    """Assignments (H, S) of spots to strings, -1 where none, most likely first, at least three strings found.

    yz_mm, cov_mm2: spots as axis points (N, 2), (N, 2, 2). covariance: of ξ in T = guess · Exp(ξ) (6, 6).
    density: clutter per mm². Joint compatibility (Neira & Tardós 2001) as a beam search: each hypothesis carries its
    linear estimate of ξ; the curvature that this leaves out is an error of SECOND_ORDER of the motion.
    """
    predicted, along, jacobian = crossings_jacobian(guess, jig.starts, jig.directions)
    order = _order(jacobian, covariance, along, jig.lengths)
    labels = np.full((1, len(jig.strings)), -1, dtype=np.intp)
    xi, cov, score = np.zeros((1, 6)), covariance[None], np.zeros(1)
    for s in order:
        curvature = SECOND_ORDER**2 * (jacobian[s] @ covariance @ jacobian[s].T)
        noise = cov_mm2 + curvature
        labels, xi, cov, score = _extend(
            (labels, xi, cov, score), s, yz_mm - predicted[s], jacobian[s], noise, density, limit
        )
    enough = np.sum(labels >= 0, axis=1) >= 3
    ranked = ascending(-score[enough], SAME_SCORE)
    return np.asarray(labels[enough][ranked])


def _order(jacobian: Array, covariance: Array, along: Array, lengths: Array) -> IntArray:
    """Strings with the smallest gates first; those that the guess crosses far outside their ends last."""
    gates = np.trace(jacobian @ covariance @ np.swapaxes(jacobian, -1, -2), axis1=-2, axis2=-1)
    share = along / lengths
    outside = (share < -0.5) | (share > 1.5)
    return np.asarray(np.lexsort((np.round(np.log(gates) / SAME_GATE), outside)), dtype=np.intp)


def _extend(
    beam: tuple[IntArray, Array, Array, Array],
    s: int,
    offset: Array,
    jacobian: Array,
    noise: Array,
    density: float,
    limit: int,
) -> tuple[IntArray, Array, Array, Array]:
    """Every hypothesis with string ``s`` missing, or at each spot inside its gate (a Kalman update of its ξ)."""
    labels, xi, cov, score = beam
    spread = jacobian @ cov @ jacobian.T  # (H, 2, 2)
    innovation = offset[None] - (xi @ jacobian.T)[:, None]  # (H, N, 2)
    total = spread[:, None] + noise[None]  # (H, N, 2, 2)
    inverse = _inverse_2x2(total)
    chi2 = np.einsum("hni,hnij,hnj->hn", innovation, inverse, innovation)
    free = np.ones_like(chi2, dtype=bool)
    rows = np.arange(len(labels))
    for column in labels.T:
        free[rows[column >= 0], column[column >= 0]] = False
    h, n = np.nonzero((chi2 < GATE_CHI2) & free)
    determinant = total[h, n, 0, 0] * total[h, n, 1, 1] - total[h, n, 0, 1] ** 2
    gain = np.log(DETECTED / density) - 0.5 * chi2[h, n] - np.log(2 * np.pi * np.sqrt(determinant))
    kalman = cov[h] @ jacobian.T @ inverse[h, n]  # (K, 6, 2)
    new_labels = labels[h].copy()
    new_labels[:, s] = n
    out_labels = np.concatenate([labels, new_labels])
    out_score = np.concatenate([score + np.log(1 - DETECTED), score[h] + gain])
    out_xi = np.concatenate([xi, xi[h] + (kalman @ innovation[h, n][..., None])[..., 0]])
    out_cov = np.concatenate([cov, cov[h] - kalman @ jacobian @ cov[h]])
    best = ascending(-out_score, SAME_SCORE)[:limit]
    return out_labels[best], out_xi[best], out_cov[best], out_score[best]


def _inverse_2x2(m: Array) -> Array:
    determinant = m[..., 0, 0] * m[..., 1, 1] - m[..., 0, 1] * m[..., 1, 0]
    out = np.empty_like(m)
    out[..., 0, 0], out[..., 1, 1] = m[..., 1, 1], m[..., 0, 0]
    out[..., 0, 1], out[..., 1, 0] = -m[..., 0, 1], -m[..., 1, 0]
    return out / determinant[..., None, None]
