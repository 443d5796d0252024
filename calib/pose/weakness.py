"""What a frame's points leave undetermined of the jig's pose."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from calib.pose.candidates import JigPoseCandidate, WeakDirection
from calib.pose.crossing import crossings
from calib.pose.solver import PoseProblem
from geometry import Pose
from geometry.pose import skew
from jig_cad import Jig

Array = NDArray[np.float64]

WEAK_MM = 1.0  # σ of the anchors above which a direction is weak
WEAK_CONDITION = 1e3
FAR_SIGMA = 3.0
CURVED_CHI2 = (5.0, 15.0)  # FAR_SIGMA² = 9 where the covariance describes the cost


def scaled_condition(jacobian: Array) -> float:
    """Condition number of a Jacobian (rows, 6) whose columns are scaled to unit norm; inf where singular."""
    s = scaled_singular_values(jacobian)
    return float(s[0] / s[-1]) if len(s) == 6 and s[-1] > 0 else float("inf")


def scaled_singular_values(jacobian: Array) -> Array:
    """Singular values, largest first, of a Jacobian (rows, 6) whose columns are scaled to unit norm."""
    norms = np.linalg.norm(jacobian, axis=0)
    return np.asarray(np.linalg.svd(jacobian / np.where(norms > 0, norms, 1.0), compute_uv=False))


def pose_covariance(jacobian: Array) -> Array:
    """(JᵀJ)⁻¹ with scaled columns; a direction that J does not see gets a huge, finite variance."""
    norms = np.linalg.norm(jacobian, axis=0)
    norms = np.where(norms > 0, norms, 1e-12)
    _, s, vt = np.linalg.svd(jacobian / norms, full_matrices=False)
    half = vt / np.maximum(s, 1e-12 * s[0])[:, None] / norms
    return np.asarray(half.T @ half)


def weak_directions(candidate: JigPoseCandidate, jig: Jig) -> tuple[WeakDirection, ...]:
    """Motions of the jig that move its anchors by more than WEAK_MM rms (1 σ), the weakest first."""
    sigma, tangents = _principal(candidate.covariance, jig)
    found = [(s, t) for s, t in zip(sigma[::-1], tangents[::-1], strict=True) if s > WEAK_MM]
    return tuple(WeakDirection(t / np.linalg.norm(t), float(s)) for s, t in found)


def curved(problem: PoseProblem, candidate: JigPoseCandidate, jig: Jig) -> bool:
    """Whether the cost is far from quadratic within 3 σ of the weakest direction: then the covariance misleads.

    Near a perpendicular view the tilt enters the distances by its square: two minima merge, or stand a few σ apart.
    """
    _, tangents = _principal(candidate.covariance, jig)
    far = candidate.T_sensor_jig @ Pose.exp(np.array([[-FAR_SIGMA], [FAR_SIGMA]]) * tangents[-1])
    yz, _ = crossings(far, problem.starts, problem.directions)
    residual = (yz - problem.yz_mm).reshape(2, -1) @ problem.whitening.T
    rise = np.sum(residual**2, axis=1) - candidate.cost
    return bool(np.min(rise) < CURVED_CHI2[0] or np.max(rise) > CURVED_CHI2[1])


def _principal(covariance: Array, jig: Jig) -> tuple[Array, Array]:
    """σ (6,) [mm rms at the anchors] and 1 σ tangents (6, 6), in rows, of the principal motions, weakest last."""
    root = np.linalg.cholesky(_anchor_metric(jig)).T
    values, vectors = np.linalg.eigh(root @ covariance @ root.T)
    sigma = np.sqrt(np.maximum(values, 0.0))
    return sigma, np.linalg.solve(root, vectors * sigma).T


def _anchor_metric(jig: Jig) -> Array:
    """K (6, 6): ξᵀ K ξ is the mean square motion of the jig's anchors [mm²] under ξ."""
    rows = np.concatenate([np.broadcast_to(np.eye(3), (len(jig.anchors), 3, 3)), -skew(jig.anchors_mm)], -1)
    return np.asarray(np.einsum("kij,kil->jl", rows, rows) / len(rows))
