"""Levenberg-Marquardt over batches of jig poses: whitened crossings of the strings as residuals."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from calib.pose.crossing import crossings
from calib.pose.kernel import PoseMinima, PoseProblems, minimise
from geometry import Pose, nearest_rotation

Array = NDArray[np.float64]


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
    """Poses (...), costs, whitened Jacobians (..., rows, 6), crossings, distances along the strings, convergence."""

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
    strings = problem.yz_mm.shape[-2]
    shape = np.broadcast_shapes(start.t.shape[:-1], problem.yz_mm.shape[:-2], problem.whitening.shape[:-2])
    rows = 2 * strings + (0 if problem.prior is None else 6)
    mean, root = (Pose.identity(), np.zeros((6, 6))) if problem.prior is None else problem.prior
    yz = problem.yz_mm.reshape(*problem.yz_mm.shape[:-2], 2 * strings)
    problems = PoseProblems(
        _flat(problem.starts, shape, 2),
        _flat(problem.directions, shape, 2),
        _flat(yz, shape, 1),
        _flat(problem.whitening, shape, 2),
        _flat(mean.R, shape, 2),
        _flat(mean.t, shape, 1),
        _flat(root, shape, 2),
    )
    R, t = _flat(start.R, shape, 2), _flat(start.t, shape, 1)
    n = len(t)
    cost, jacobian, converged = np.zeros(n), np.zeros((n, rows, 6)), np.zeros(n, dtype=bool)
    minimise(problems, PoseMinima(R, t, cost, jacobian, converged), max_iterations, tolerance)
    T = Pose(nearest_rotation(R).reshape(*shape, 3, 3), t.reshape(*shape, 3))
    crossed, along = crossings(T, problem.starts, problem.directions)
    ok = converged & np.isfinite(cost)
    return PoseSolution(T, cost.reshape(shape), jacobian.reshape(*shape, rows, 6), crossed, along, ok.reshape(shape))


def _flat(x: Array, shape: tuple[int, ...], core: int) -> Array:
    """A copy of the array broadcast over the batch ``shape``, as (N, core axes): one layout, one compilation."""
    tail = x.shape[x.ndim - core :]
    return np.array(np.broadcast_to(x, (*shape, *tail)), dtype=float, order="C").reshape(-1, *tail)
