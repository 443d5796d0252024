"""Jig pose of one frame by weighted least squares over the strings' crossings of the laser plane."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from calib.crossings import anchor_jacobian
from calib.jig_pose_types import Ambiguity, JigPoseCandidate, JigPoseResult, WeakDirection
from calib.pose_solver import PoseProblem, PoseSolution, solve_poses
from calib.pose_starts import grid_starts, pencil_starts
from geometry import AxisPoints, NoAnswerError, Pose
from geometry.pose import skew
from jig_cad import ANCHORS, STRINGS, Jig

Array = NDArray[np.float64]

MIN_STRINGS = 3
SAME_MM, SAME_RAD = 0.05, 1e-3  # nearer minima are one
VALLEY_RAD, VALLEY_CHI2 = 0.01, 0.1
AMBIGUOUS_CHI2 = 16.0  # another pose within this of the best one can not be told from it by the points
WEAK_MM = 1.0  # σ of the anchors above which a direction is weak
WEAK_CONDITION = 1e3
BEYOND = 0.05  # a string can not be crossed farther beyond its anchors than this share of its length


def jig_pose(
    axis: AxisPoints, jig: Jig, guess: Pose | None = None, anchor_sigma_mm: float | None = None
) -> JigPoseResult:
    """All poses T_sensor_jig that explain labelled axis points, by weighted least squares.

    axis: at least three points of different strings; their covariances alone are the weights.
    guess: picks among about equally likely candidates, and is a start where fewer than five strings remain.
    anchor_sigma_mm: σ of the anchors in y and z for the likelihoods; None: uniform within the jig's tolerance.
    Raises NoAnswerError where fewer than three strings are given or no iteration converges.
    """
    index = string_indices(axis, jig)
    starts, directions = jig.starts[index], jig.directions[index]
    problem = PoseProblem(starts, directions, axis.yz_mm, whitening(axis.cov_yz_mm2))
    solution = _distinct(solve_poses(problem, _starts(problem, guess), max_iterations=30))
    chi2 = _chi2_with_tolerance(solution, axis, jig, index, anchor_sigma_mm)
    along = solution.along_mm / jig.lengths[index]
    possible = np.all((along > -BEYOND) & (along < 1 + BEYOND), axis=-1)
    chi2 = np.where(possible, chi2, np.inf) if np.any(possible) else chi2
    share = np.exp(-0.5 * (chi2 - np.min(chi2)))
    order = _order(chi2, solution.T_sensor_jig, guess, jig)
    candidates = tuple(_candidate(solution, axis, i, share[i] / share.sum(), chi2[i]) for i in order)
    weak = weak_directions(candidates[0], jig)
    condition = scaled_condition(solution.jacobian[order[0]])
    ambiguity = _ambiguity(chi2[order], condition, weak)
    return JigPoseResult(candidates, 2 * len(axis) - 6, condition, weak, ambiguity)


def pose_near(axis: AxisPoints, jig: Jig, guess: Pose, root_information: Array) -> JigPoseResult:
    """The pose next to a guess of known uncertainty: for points that do not determine one on their own.

    root_information: (6, 6) of ξ in T = guess · Exp(ξ). dof counts what the points themselves check.
    """
    index = string_indices(axis, jig)
    white = whitening(axis.cov_yz_mm2)
    problem = PoseProblem(
        jig.starts[index], jig.directions[index], axis.yz_mm[None], white[None], (guess, root_information)
    )
    solution = _distinct(solve_poses(problem, Pose(guess.R[None], guess.t[None])))
    chi2 = _chi2_with_tolerance(solution, axis, jig, index, None)
    candidate = _candidate(solution, axis, 0, 1.0, float(chi2[0]))
    own = solution.jacobian[0, : 2 * len(axis)]
    rank = int(np.sum(_scaled_singular_values(own) > 1.0 / WEAK_CONDITION))
    return JigPoseResult((candidate,), 2 * len(axis) - rank, scaled_condition(own), weak_directions(candidate, jig))


def string_indices(axis: AxisPoints, jig: Jig) -> NDArray[np.intp]:
    """Index (N,) into the jig's strings of every labelled point; NoAnswerError where too few or unknown."""
    unknown = [label for label in axis.label if label not in jig.strings]
    if unknown:
        raise NoAnswerError(f'point "{unknown[0]}" is no string of this jig, which has {", ".join(jig.strings)}')
    if len(set(axis.label)) < MIN_STRINGS:
        raise NoAnswerError(
            f"{len(set(axis.label))} strings were measured: a jig pose needs {MIN_STRINGS} or more different ones"
        )
    return np.array([jig.strings.index(label) for label in axis.label], dtype=np.intp)


def whitening(cov: Array) -> Array:
    """Block-diagonal W (..., 2N, 2N) with WᵀW the inverse of the points' covariances (..., N, 2, 2)."""
    n = cov.shape[-3]
    root = np.linalg.inv(np.linalg.cholesky(cov))
    out = np.zeros((*cov.shape[:-3], n, 2, n, 2))
    diagonal = np.arange(n)
    out[..., diagonal, :, diagonal, :] = np.moveaxis(root, -3, 0)
    return out.reshape(*cov.shape[:-3], 2 * n, 2 * n)


def scaled_condition(jacobian: Array) -> float:
    """Condition number of a Jacobian (rows, 6) whose columns are scaled to unit norm; inf where singular."""
    s = _scaled_singular_values(jacobian)
    return float(s[0] / s[-1]) if len(s) == 6 and s[-1] > 0 else float("inf")


def _scaled_singular_values(jacobian: Array) -> Array:
    norms = np.linalg.norm(jacobian, axis=0)
    return np.asarray(np.linalg.svd(jacobian / np.where(norms > 0, norms, 1.0), compute_uv=False))


def weak_directions(candidate: JigPoseCandidate, jig: Jig) -> tuple[WeakDirection, ...]:
    """Motions of the jig that move its anchors by more than WEAK_MM rms (1 σ), the weakest first."""
    metric = _anchor_metric(jig)
    root = np.linalg.cholesky(metric).T
    values, vectors = np.linalg.eigh(root @ candidate.covariance @ root.T)
    out = []
    for value, vector in zip(values[::-1], vectors.T[::-1], strict=True):
        if value > WEAK_MM**2:
            tangent = np.linalg.solve(root, vector)
            out.append(WeakDirection(tangent / np.linalg.norm(tangent), float(np.sqrt(value))))
    return tuple(out)


def anchor_sigma(jig: Jig) -> float:
    """σ [mm] of every anchor's y and z: uniform within ± half of the tolerance; 0 where the anchors were measured."""
    return 0.0 if jig.measured else float(jig.tolerance_mm / np.sqrt(12))


def anchor_covariance(T: Pose, jig: Jig, index: NDArray[np.intp], sigma_mm: float) -> Array:
    """Covariance (..., 2N, 2N) of the crossings of strings ``index`` through their anchors, which strings share."""
    first, second = anchor_jacobian(T, jig.starts[index], jig.directions[index], jig.lengths[index])
    g = np.zeros((*T.t.shape[:-1], len(index), 2, len(ANCHORS), 2))
    for i, k in enumerate(index):
        ends = [ANCHORS.index(a) for a in STRINGS[jig.strings[k]]]
        g[..., i, :, ends[0], :] = first[..., i, :, 1:]
        g[..., i, :, ends[1], :] = second[..., i, :, 1:]
    g = g.reshape(*T.t.shape[:-1], 2 * len(index), -1)
    return np.asarray(sigma_mm**2 * g @ np.swapaxes(g, -1, -2))


def _starts(problem: PoseProblem, guess: Pose | None) -> Pose:
    n = len(problem.yz_mm)
    poses = [] if guess is None else [Pose(guess.R[None], guess.t[None])]
    if n >= 5:
        poses.append(pencil_starts(problem.starts, problem.directions, problem.yz_mm))
    if n < 5:
        poses.append(grid_starts(problem.starts, problem.directions, problem.yz_mm))
    return Pose(np.concatenate([p.R for p in poses]), np.concatenate([p.t for p in poses]))


def _distinct(solution: PoseSolution) -> PoseSolution:
    """The different local minima, lowest cost first; NoAnswerError where nothing converged."""
    usable = solution.converged & np.isfinite(solution.cost)
    if not np.any(usable):
        raise NoAnswerError("no jig pose explains the points: the iteration converged from no start")
    kept: list[int] = []
    T = solution.T_sensor_jig
    for i in np.argsort(solution.cost, kind="stable"):
        if usable[i] and not any(_same(T[int(i)], T[k], solution.jacobian[k]) for k in kept):
            kept.append(int(i))
    k = np.array(kept)
    s = solution
    return PoseSolution(T[k], s.cost[k], s.jacobian[k], s.yz_mm[k], s.along_mm[k], s.converged[k])


def _same(a: Pose, b: Pose, jacobian: Array) -> bool:
    """Whether two poses are one minimum: almost equal, or nearby on the floor of a flat valley."""
    xi = (b.inverse() @ a).log()
    turn = np.linalg.norm(xi[3:])
    equal = np.linalg.norm(xi[:3]) < SAME_MM and turn < SAME_RAD
    return bool(equal or (turn < VALLEY_RAD and np.sum((jacobian @ xi) ** 2) < VALLEY_CHI2))


def _chi2_with_tolerance(
    solution: PoseSolution, axis: AxisPoints, jig: Jig, index: NDArray[np.intp], sigma_mm: float | None
) -> Array:
    """χ² (K,) of every minimum with the anchors' tolerance in the covariance, to first order about the minimum."""
    sigma = anchor_sigma(jig) if sigma_mm is None else sigma_mm
    if sigma == 0:
        return solution.cost
    n = len(axis)
    jacobian = crossing_jacobian(solution, axis)
    total = anchor_covariance(solution.T_sensor_jig, jig, index, sigma)
    for i, cov in enumerate(axis.cov_yz_mm2):
        total[..., 2 * i : 2 * i + 2, 2 * i : 2 * i + 2] += cov
    root = np.linalg.inv(np.linalg.cholesky(total))
    residual = (solution.yz_mm - axis.yz_mm).reshape(-1, 2 * n)
    r = (root @ residual[..., None])[..., 0]
    u, s, _ = np.linalg.svd(root @ jacobian, full_matrices=False)
    u = u * (s > 1e-9 * s[..., :1])[..., None, :]
    return np.asarray(np.sum(r**2, -1) - np.sum((np.swapaxes(u, -1, -2) @ r[..., None]) ** 2, axis=(-1, -2)))


def crossing_jacobian(solution: PoseSolution, axis: AxisPoints) -> Array:
    """Jacobian (K, 2N, 6) of the crossings, from the whitened one."""
    return np.asarray(np.linalg.solve(whitening(axis.cov_yz_mm2), solution.jacobian[..., : 2 * len(axis), :]))


def _order(chi2: Array, T: Pose, guess: Pose | None, jig: Jig) -> NDArray[np.intp]:
    """Most likely first; with a guess, the nearest to it among the about equally likely comes first."""
    order = np.argsort(chi2, kind="stable")
    if guess is None:
        return order
    close = [int(i) for i in order if chi2[i] <= chi2[order[0]] + AMBIGUOUS_CHI2]
    anchors = jig.anchors_mm
    first = min(close, key=lambda i: float(np.linalg.norm(T[i] @ anchors - guess @ anchors)))
    return np.array([first, *[i for i in order if i != first]], dtype=np.intp)


def _candidate(solution: PoseSolution, axis: AxisPoints, i: int, likelihood: float, chi2: float) -> JigPoseCandidate:
    return JigPoseCandidate(
        T_sensor_jig=solution.T_sensor_jig[int(i)],
        cost=float(solution.cost[i]),
        chi2=float(chi2),
        likelihood=float(likelihood),
        converged=bool(solution.converged[i]),
        residuals_mm=solution.yz_mm[i] - axis.yz_mm,
        covariance=_covariance(solution.jacobian[i]),
    )


def _covariance(jacobian: Array) -> Array:
    """(JᵀJ)⁻¹ with scaled columns; a direction that J does not see gets a huge, finite variance."""
    norms = np.linalg.norm(jacobian, axis=0)
    norms = np.where(norms > 0, norms, 1e-12)
    _, s, vt = np.linalg.svd(jacobian / norms, full_matrices=False)
    half = vt / np.maximum(s, 1e-12 * s[0])[:, None] / norms
    return np.asarray(half.T @ half)


def _anchor_metric(jig: Jig) -> Array:
    """K (6, 6): ξᵀ K ξ is the mean square motion of the jig's anchors [mm²] under ξ."""
    rows = np.concatenate([np.broadcast_to(np.eye(3), (6, 3, 3)), -skew(jig.anchors_mm)], -1)
    return np.asarray(np.einsum("kij,kil->jl", rows, rows) / len(rows))


def _ambiguity(chi2: Array, condition: float, weak: tuple[WeakDirection, ...]) -> Ambiguity:
    if condition > WEAK_CONDITION or weak:
        return "weak"
    return "mirror" if len(chi2) > 1 and np.min(chi2[1:]) < chi2[0] + AMBIGUOUS_CHI2 else "unique"
