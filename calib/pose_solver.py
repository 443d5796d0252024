"""Levenberg-Marquardt over batches of jig poses: whitened crossings of the strings as residuals."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from calib.crossings import crossings_jacobian
from geometry import Pose, exp_so3

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
    yz, along, residual, jacobian = _linearise(problem, T)
    cost = _square(residual)
    converged = np.zeros(cost.shape, dtype=bool)
    for _ in range(max_iterations):
        step = _step(jacobian, residual, damping)
        trial = Pose(T.R @ exp_so3(step[..., 3:]), T.t + (T.R @ step[..., :3, None])[..., 0])
        new = _linearise(problem, trial)
        new_cost = _square(new[2])
        better = (new_cost <= cost) & ~converged  # False for NaN
        small = np.max(np.abs(step), axis=-1) < np.where(better, tolerance, 1e3 * tolerance)
        T = Pose(np.where(better[..., None, None], trial.R, T.R), np.where(better[..., None], trial.t, T.t))
        yz, along, residual, jacobian = (
            np.where(better.reshape(*better.shape, *(1,) * (n.ndim - better.ndim)), n, o)
            for n, o in zip(new, (yz, along, residual, jacobian), strict=True)
        )
        cost = np.where(better, new_cost, cost)
        damping = np.clip(np.where(better, damping * 0.05, damping * 8), 1e-14, 1e8)
        converged |= small | (damping >= 1e8)  # a tiny step that no longer helps is rounding at the minimum
        if np.all(converged):
            break
    return PoseSolution(T, cost, jacobian, yz, along, converged)


def _square(v: Array) -> Array:
    return np.asarray(np.einsum("...i,...i->...", v, v))


def _step(jacobian: Array, residual: Array, damping: Array) -> Array:
    """Damped Gauss-Newton step (..., 6) in unit columns, no turn longer than MAX_TURN_RAD."""
    norms = np.sqrt(np.einsum("...ij,...ij->...j", jacobian, jacobian))
    scale = 1.0 / np.where(norms > 0, norms, 1.0)
    scaled = jacobian * scale[..., None, :]
    transposed = np.swapaxes(scaled, -1, -2)
    normal = transposed @ scaled
    normal[..., range(6), range(6)] += damping[..., None]
    step = -np.linalg.solve(normal, transposed @ residual[..., None])[..., 0] * scale
    turn = np.sqrt(_square(step[..., 3:]))
    return np.asarray(step * np.minimum(1.0, MAX_TURN_RAD / np.maximum(turn, 1e-300))[..., None])


def _linearise(problem: PoseProblem, T: Pose) -> tuple[Array, Array, Array, Array]:
    """Crossings, distances along the strings, whitened residual (..., rows) and its Jacobian (..., rows, 6)."""
    yz, along, jacobian = crossings_jacobian(T, problem.starts, problem.directions)
    whitened = problem.whitening @ jacobian.reshape(*jacobian.shape[:-3], -1, 6)
    flat = (yz - problem.yz_mm).reshape(*yz.shape[:-2], -1)
    residual = (problem.whitening @ flat[..., None])[..., 0]
    if problem.prior is not None:
        # d log(T_prior⁻¹ T Exp(ξ)) = Jr⁻¹ ξ ≈ ξ: the prior is wide, its curvature is not needed
        mean, root = problem.prior
        departure = (root @ (mean.inverse() @ T).log()[..., None])[..., 0]
        residual = np.concatenate([residual, departure], -1)
        whitened = np.concatenate([whitened, np.broadcast_to(root, (*whitened.shape[:-2], 6, 6))], -2)
    return yz, along, np.asarray(residual), np.asarray(whitened)
