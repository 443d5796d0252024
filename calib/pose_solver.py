"""Levenberg-Marquardt over batches of jig poses: whitened crossings of the strings as residuals."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from calib.crossings import crossings, crossings_jacobian
from geometry import Pose

Array = NDArray[np.float64]

MAX_TURN_RAD = 0.4  # a longer step leaves the region where the linear model means anything


@dataclass(frozen=True, eq=False)
class PoseProblem:
    """A batch (...) of pose problems.

    starts, directions: strings (S, 3) or (..., S, 3) in {J}. yz_mm: measured crossings (..., S, 2).
    whitening: W (..., 2S, 2S) with WᵀW the information of the stacked (y, z); zero rows leave a string out.
    prior: mean pose (...) and its square-root information (..., 6, 6) for ξ in T = T_prior · Exp(ξ), or None.
    """

    starts: Array
    directions: Array
    yz_mm: Array
    whitening: Array
    prior: tuple[Pose, Array] | None = None


@dataclass(frozen=True, eq=False)
class PoseSolution:
    """Poses (...), their costs, Jacobians whitened (..., rows, 6), predicted crossings and whether each converged."""

    T_sensor_jig: Pose
    cost: Array
    jacobian: Array
    yz_mm: Array
    along_mm: Array
    converged: NDArray[np.bool_]


def solve_poses(problem: PoseProblem, start: Pose, max_iterations: int = 30, tolerance: float = 1e-9) -> PoseSolution:
    """Local minima reached from the ``start`` poses (...), every member of the batch on its own.

    tolerance: a member has converged when every component of its step is below [mm, rad].
    """
    T = Pose(np.array(start.R), np.array(start.t))
    damping = np.full(T.t.shape[:-1], 1e-4)
    residual, jacobian = _linearise(problem, T)
    cost = np.sum(residual**2, -1)
    converged = np.zeros(cost.shape, dtype=bool)
    for _ in range(max_iterations):
        step = _step(jacobian, residual, damping)
        trial = T @ Pose.exp(step)
        trial_cost = np.sum(_residual(problem, trial) ** 2, -1)
        better = np.isfinite(trial_cost) & (trial_cost <= cost) & ~converged
        T = Pose(np.where(better[..., None, None], trial.R, T.R), np.where(better[..., None], trial.t, T.t))
        damping = np.clip(np.where(better, damping * 0.05, damping * 8), 1e-14, 1e8)
        small = np.all(np.abs(step) < np.where(better[..., None], tolerance, 1e3 * tolerance), axis=-1)
        converged |= small | (damping >= 1e8)  # a tiny step that no longer helps is rounding at the minimum
        if np.all(converged):
            break
        residual, jacobian = _linearise(problem, T)
        cost = np.sum(residual**2, -1)
    residual, jacobian = _linearise(problem, T)
    yz, along = crossings(T, problem.starts, problem.directions)
    return PoseSolution(T, np.sum(residual**2, -1), jacobian, yz, along, converged)


def _step(jacobian: Array, residual: Array, damping: Array) -> Array:
    norms = np.linalg.norm(jacobian, axis=-2)
    scale = 1.0 / np.where(norms > 0, norms, 1.0)
    scaled = jacobian * scale[..., None, :]
    normal = np.swapaxes(scaled, -1, -2) @ scaled
    normal[..., range(6), range(6)] += damping[..., None]
    gradient = np.swapaxes(scaled, -1, -2) @ residual[..., None]
    step = -np.linalg.solve(normal, gradient)[..., 0] * scale
    turn = np.linalg.norm(step[..., 3:], axis=-1)
    return np.asarray(step * np.minimum(1.0, MAX_TURN_RAD / np.maximum(turn, 1e-300))[..., None])


def _residual(problem: PoseProblem, T: Pose) -> Array:
    yz, _ = crossings(T, problem.starts, problem.directions)
    return _whiten(problem, T, yz)


def _whiten(problem: PoseProblem, T: Pose, yz: Array) -> Array:
    flat = (yz - problem.yz_mm).reshape(*yz.shape[:-2], -1)
    residual = np.asarray((problem.whitening @ flat[..., None])[..., 0])
    if problem.prior is None:
        return residual
    mean, root = problem.prior
    return np.concatenate([residual, (root @ (mean.inverse() @ T).log()[..., None])[..., 0]], -1)


def _linearise(problem: PoseProblem, T: Pose) -> tuple[Array, Array]:
    yz, _, jacobian = crossings_jacobian(T, problem.starts, problem.directions)
    whitened = problem.whitening @ jacobian.reshape(*jacobian.shape[:-3], -1, 6)
    residual = _whiten(problem, T, yz)
    if problem.prior is not None:
        # d log(T_prior⁻¹ T Exp(ξ)) = Jr⁻¹ ξ ≈ ξ: the prior is wide, its curvature is not needed
        root = np.broadcast_to(problem.prior[1], (*whitened.shape[:-2], 6, 6))
        whitened = np.concatenate([whitened, root], -2)
    return residual, whitened
