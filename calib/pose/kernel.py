"""The compiled inner loop of the pose solver: one Levenberg-Marquardt run after another, no allocation inside.

Plain loops over scalars throughout: numba compiles them several times faster than array expressions.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from geometry.compiled import kernel

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

MAX_TURN_RAD = 0.4  # a longer step leaves the region where the linear model means anything
FLAT_CHI2 = 1e-3  # a last step that gained less has reached the floor of the cost
ROUNDING_CHI2 = 1e-10  # of a cost about 1: points to 1e-13 mm over σ of some 0.01 mm leave it no better known
PARALLEL = 1e-9  # |direction's x| below this: the string runs in the plane and crosses it nowhere


class PoseProblems(NamedTuple):
    """N problems of S strings: lines starts, directions (N, S, 3), points yz (N, 2S), white (N, 2S, 2S), and a prior.

    prior_R (N, 3, 3), prior_t (N, 3): its mean; root (N, 6, 6): its square-root information.
    """

    starts: Array
    directions: Array
    yz: Array
    white: Array
    prior_R: Array
    prior_t: Array
    root: Array


class PoseMinima(NamedTuple):
    """Poses R (N, 3, 3), t (N, 3), moved to their minima in place, with what stands there.

    cost (N,), jacobian (N, rows, 6), converged (N,); rows is 2S, or 2S + 6 where the prior counts.
    """

    R: Array
    t: Array
    cost: Array
    jacobian: Array
    converged: Mask


class AtPose(NamedTuple):
    """One problem at one pose: R (3, 3), t (3,), whitened residual (rows,) and Jacobian (rows, 6)."""

    R: Array
    t: Array
    residual: Array
    jacobian: Array


@kernel
def minimise(problems: PoseProblems, found: PoseMinima, max_iterations: int, tolerance: float) -> None:
    """Move the poses to local minima in place and say what stands there."""
    p, rows = problems, found.jacobian.shape[1]
    residual = np.empty(rows)
    tried = AtPose(np.empty((3, 3)), np.empty(3), np.empty(rows), np.empty((rows, 6)))
    work, step, normal = np.empty((p.yz.shape[1], 7)), np.empty(6), np.empty((6, 6))
    for k in range(found.R.shape[0]):
        one = PoseProblems(p.starts[k], p.directions[k], p.yz[k], p.white[k], p.prior_R[k], p.prior_t[k], p.root[k])
        here = AtPose(found.R[k], found.t[k], residual, found.jacobian[k])
        value, gain, damping, largest = np.inf, np.inf, 2e-3, 1.0
        step[:] = 0.0
        for _ in range(max_iterations + 1):  # the first time round evaluates the start itself
            _move(here, step, tried)
            trial = _linearise(one, tried, work)
            # False for NaN; near the minimum the cost is rounding noise and the step says more than it does
            better = trial <= value + ROUNDING_CHI2 * (1.0 + value)
            if better:
                gain = value - trial
                value = trial
                _copy(tried, here)
                damping = damping * 0.05 + 1e-14
            else:
                damping *= 8.0
            # a tiny step that no longer helps is rounding at the minimum
            if largest < tolerance or (not better and (largest < 1e3 * tolerance or damping > 1e8)):
                found.converged[k] = True
                break
            largest = _step(here, damping, normal, step)
        found.cost[k] = value
        if gain < FLAT_CHI2:  # where two minima merge (a perpendicular view) steps shrink slowly on the flat floor
            found.converged[k] = True


@kernel
def _linearise(problem: PoseProblems, at: AtPose, work: Array) -> float:
    """Fill in the whitened residual and Jacobian of one problem at a pose; returns the cost.

    work (2S, 7): the unwhitened Jacobian and difference.
    """
    starts, directions, yz, white = problem.starts, problem.directions, problem.yz, problem.white
    R, t, residual, jacobian = at.R, at.t, at.residual, at.jacobian
    n = yz.shape[0]
    for s in range(starts.shape[0]):
        px = R[0, 0] * starts[s, 0] + R[0, 1] * starts[s, 1] + R[0, 2] * starts[s, 2] + t[0]
        qx = R[0, 0] * directions[s, 0] + R[0, 1] * directions[s, 1] + R[0, 2] * directions[s, 2]
        if abs(qx) < PARALLEL:
            qx = -PARALLEL if qx < 0 else PARALLEL
        along = -px / qx
        c0 = starts[s, 0] + along * directions[s, 0]
        c1 = starts[s, 1] + along * directions[s, 1]
        c2 = starts[s, 2] + along * directions[s, 2]
        for axis in range(1, 3):
            row = 2 * s + axis - 1
            q = R[axis, 0] * directions[s, 0] + R[axis, 1] * directions[s, 1] + R[axis, 2] * directions[s, 2]
            slope = q / qx
            w0, w1, w2 = R[axis, 0] - slope * R[0, 0], R[axis, 1] - slope * R[0, 1], R[axis, 2] - slope * R[0, 2]
            work[row, 0], work[row, 1], work[row, 2] = w0, w1, w2
            work[row, 3], work[row, 4], work[row, 5] = c1 * w2 - c2 * w1, c2 * w0 - c0 * w2, c0 * w1 - c1 * w0
            work[row, 6] = R[axis, 0] * c0 + R[axis, 1] * c1 + R[axis, 2] * c2 + t[axis] - yz[row]
    total = 0.0
    for i in range(n):
        for j in range(7):
            x = 0.0
            for k in range(n):
                x += white[i, k] * work[k, j]
            if j < 6:
                jacobian[i, j] = x
            else:
                residual[i] = x
                total += x * x
    if residual.shape[0] > n:
        total += _add_prior(problem, at, n)
    return total


@kernel
def _add_prior(problem: PoseProblems, at: AtPose, first: int) -> float:
    """Departure from the prior's mean in its own axes; the rotation's curvature is left out, the prior being wide."""
    mean_R, mean_t, root = problem.prior_R, problem.prior_t, problem.root
    R, t, residual, jacobian = at.R, at.t, at.residual, at.jacobian
    turn, departure = np.empty((3, 3)), np.empty(6)
    for i in range(3):
        departure[i] = 0.0
        for k in range(3):
            departure[i] += mean_R[k, i] * (t[k] - mean_t[k])
        for j in range(3):
            turn[i, j] = mean_R[0, i] * R[0, j] + mean_R[1, i] * R[1, j] + mean_R[2, i] * R[2, j]
    departure[3] = 0.5 * (turn[2, 1] - turn[1, 2])
    departure[4] = 0.5 * (turn[0, 2] - turn[2, 0])
    departure[5] = 0.5 * (turn[1, 0] - turn[0, 1])
    sine = math.sqrt(departure[3] * departure[3] + departure[4] * departure[4] + departure[5] * departure[5])
    angle = math.atan2(sine, 0.5 * (turn[0, 0] + turn[1, 1] + turn[2, 2] - 1.0))
    scale = angle / sine if sine > 1e-9 else 1.0
    total = 0.0
    for i in range(6):
        x = 0.0
        for k in range(6):
            x += root[i, k] * departure[k] * (scale if k > 2 else 1.0)
        residual[first + i] = x
        total += x * x
        for j in range(3):
            jacobian[first + i, j] = root[i, 0] * turn[0, j] + root[i, 1] * turn[1, j] + root[i, 2] * turn[2, j]
            jacobian[first + i, 3 + j] = root[i, 3 + j]
    return total


@kernel
def _step(at: AtPose, damping: float, normal: Array, step: Array) -> float:
    """Damped Gauss-Newton step in unit columns, no turn longer than MAX_TURN_RAD; returns its largest component."""
    jacobian, residual = at.jacobian, at.residual
    rows = residual.shape[0]
    for i in range(6):
        gradient = 0.0
        for k in range(rows):
            gradient -= jacobian[k, i] * residual[k]
        step[i] = gradient
        for j in range(i + 1):
            x = 0.0
            for k in range(rows):
                x += jacobian[k, i] * jacobian[k, j]
            normal[i, j] = x
    for i in range(6):  # damping as a share of the diagonal: the same as damping unit columns
        normal[i, i] *= 1.0 + damping
        if normal[i, i] <= 0.0:
            normal[i, i] = 1.0
    for i in range(6):  # Cholesky in place, then forward and back
        for j in range(i + 1):
            x = normal[i, j]
            for k in range(j):
                x -= normal[i, k] * normal[j, k]
            if i == j:
                normal[i, i] = math.sqrt(max(x, 1e-15 * normal[i, i]))
            else:
                normal[i, j] = x / normal[j, j]
    for i in range(6):
        for k in range(i):
            step[i] -= normal[i, k] * step[k]
        step[i] /= normal[i, i]
    for i in range(5, -1, -1):
        for k in range(i + 1, 6):
            step[i] -= normal[k, i] * step[k]
        step[i] /= normal[i, i]
    turn = math.sqrt(step[3] * step[3] + step[4] * step[4] + step[5] * step[5])
    shrink = MAX_TURN_RAD / turn if turn > MAX_TURN_RAD else 1.0
    largest = 0.0
    for i in range(6):
        step[i] *= shrink
        largest = max(largest, abs(step[i]))
    return largest


@kernel
def _move(at: AtPose, step: Array, to: AtPose) -> None:
    """The pose moved by ``step``: translation in its own axes, rotation by the unit quaternion of the vector."""
    R, t, new_R, new_t = at.R, at.t, to.R, to.t
    angle = math.sqrt(step[3] * step[3] + step[4] * step[4] + step[5] * step[5])
    scale = math.sin(0.5 * angle) / angle if angle > 1e-12 else 0.5
    w, x, y, z = math.cos(0.5 * angle), scale * step[3], scale * step[4], scale * step[5]
    for i in range(3):
        a, b, c = R[i, 0], R[i, 1], R[i, 2]
        new_R[i, 0] = a * (1 - 2 * (y * y + z * z)) + b * 2 * (x * y + w * z) + c * 2 * (x * z - w * y)
        new_R[i, 1] = a * 2 * (x * y - w * z) + b * (1 - 2 * (x * x + z * z)) + c * 2 * (y * z + w * x)
        new_R[i, 2] = a * 2 * (x * z + w * y) + b * 2 * (y * z - w * x) + c * (1 - 2 * (x * x + y * y))
        new_t[i] = t[i] + a * step[0] + b * step[1] + c * step[2]


@kernel
def _copy(at: AtPose, to: AtPose) -> None:
    for i in range(3):
        to.t[i] = at.t[i]
        for j in range(3):
            to.R[i, j] = at.R[i, j]
    for i in range(at.residual.shape[0]):
        to.residual[i] = at.residual[i]
        for j in range(6):
            to.jacobian[i, j] = at.jacobian[i, j]
