"""Weights of a frame's points: their own covariance, and what the anchors' tolerance adds to it."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from calib.pose.crossing import anchor_jacobian
from calib.pose.solver import PoseSolution
from geometry import AxisPoints, Pose
from jig_cad import Jig

Array = NDArray[np.float64]

EXACT_MM = 1e-7  # σ that stands for none: points given as exact still have a weight

_IN_SHEET_MM = 100.0  # a crossing that the anchors' tolerance moves so far belongs to a string that lies in the sheet


def whitening(cov: Array) -> Array:
    """Block-diagonal W (..., 2N, 2N) with WᵀW the inverse of the points' covariances (..., N, 2, 2)."""
    n = cov.shape[-3]
    root = np.linalg.inv(np.linalg.cholesky(cov + EXACT_MM**2 * np.eye(2)))
    out = np.zeros((*cov.shape[:-3], n, 2, n, 2))
    diagonal = np.arange(n)
    out[..., diagonal, :, diagonal, :] = np.moveaxis(root, -3, 0)
    return out.reshape(*cov.shape[:-3], 2 * n, 2 * n)


def anchor_covariance(T: Pose, jig: Jig, index: NDArray[np.intp], sigma_mm: float) -> Array:
    """Covariance (..., 2N, 2N) of the crossings of strings ``index`` through their anchors, which strings share."""
    first, second = anchor_jacobian(T, jig.starts[index], jig.directions[index], jig.lengths[index])
    g = np.zeros((*T.t.shape[:-1], len(index), 2, len(jig.anchors), 2))
    for i, k in enumerate(index):
        g[..., i, :, jig.start_index[k], :] = first[..., i, :, 1:]
        g[..., i, :, jig.end_index[k], :] = second[..., i, :, 1:]
    g = g.reshape(*T.t.shape[:-1], 2 * len(index), -1)
    return np.asarray(sigma_mm**2 * g @ np.swapaxes(g, -1, -2))


def chi2_with_tolerance(
    solution: PoseSolution, axis: AxisPoints, jig: Jig, index: NDArray[np.intp], sigma_mm: float | None
) -> Array:
    """χ² (K,) of every minimum with the anchors' tolerance in the covariance, to first order about the minimum."""
    sigma = jig.anchor_sigma_mm if sigma_mm is None else sigma_mm
    if sigma == 0:
        return solution.cost
    n = len(axis)
    jacobian = crossing_jacobian(solution, axis)
    total = anchor_covariance(solution.T_sensor_jig, jig, index, sigma)
    for i, cov in enumerate(axis.cov_yz_mm2):
        total[..., 2 * i : 2 * i + 2, 2 * i : 2 * i + 2] += cov
    level = np.trace(total, axis1=-2, axis2=-1) / (2 * n)
    usable = np.isfinite(level) & (level < _IN_SHEET_MM**2)
    if not np.any(usable):
        return solution.cost
    total = np.where(usable[..., None, None], total, np.eye(2 * n))
    root = np.linalg.inv(np.linalg.cholesky(total))
    residual = (solution.yz_mm - axis.yz_mm).reshape(-1, 2 * n)
    r = (root @ residual[..., None])[..., 0]
    u, s, _ = np.linalg.svd(root @ jacobian, full_matrices=False)
    u = u * (s > 1e-9 * s[..., :1])[..., None, :]
    chi2 = np.sum(r**2, -1) - np.sum((np.swapaxes(u, -1, -2) @ r[..., None]) ** 2, axis=(-1, -2))
    return np.asarray(np.where(usable, chi2, np.inf))


def crossing_jacobian(solution: PoseSolution, axis: AxisPoints) -> Array:
    """Jacobian (K, 2N, 6) of the crossings, from the whitened one."""
    return np.asarray(np.linalg.solve(whitening(axis.cov_yz_mm2), solution.jacobian[..., : 2 * len(axis), :]))
