"""Jig pose of one frame by weighted least squares over the strings' crossings of the laser plane."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from calib.pose.candidates import Ambiguity, JigPoseCandidate, JigPoseFit, JigPoseResult
from calib.pose.solver import PoseProblem, PoseSolution, solve_poses
from calib.pose.starts import grid_starts, pencil_starts
from calib.pose.tangent import departure
from calib.pose.weakness import (
    WEAK_CONDITION,
    curved,
    pose_covariance,
    scaled_condition,
    scaled_singular_values,
    weak_directions,
)
from calib.pose.weights import chi2_with_tolerance, whitening
from geometry import AxisPoints, NoAnswerError, Pose
from geometry.ties import ascending, first_least
from jig_cad import Jig

Array = NDArray[np.float64]

MIN_STRINGS = 3
MAX_CANDIDATES = 8  # where the points leave a direction free, every start ends elsewhere
SAME_MM, SAME_RAD = 0.05, 1e-3  # nearer minima are one
SAME_CHI2, SAME_ANCHORS_MM = 1e-6, 1e-6  # equal minima keep the order of their starts
VALLEY_RAD, VALLEY_CHI2 = 0.01, 0.1
AMBIGUOUS_CHI2 = 16.0  # another pose within this of the best one can not be told from it by the points
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
    fit, problem, jacobian = _search(axis, jig, guess, anchor_sigma_mm)
    best, others = fit.best, fit.candidates[1:]
    weak = weak_directions(best, jig)
    condition = scaled_condition(jacobian)
    undetermined = bool(weak) or condition > WEAK_CONDITION or curved(problem, best, jig)
    mirror = any(c.chi2 < best.chi2 + AMBIGUOUS_CHI2 for c in others)
    ambiguity: Ambiguity = "weak" if undetermined else "mirror" if mirror else "unique"
    return JigPoseResult(fit.candidates, fit.dof, condition, weak, ambiguity)


def fit_pose(axis: AxisPoints, jig: Jig, guess: Pose | None = None, starts: Pose | None = None) -> JigPoseFit:
    """As ``jig_pose``, without the diagnosis of what the points leave undetermined.

    starts: poses (K) near all minima, in place of a search for them.
    """
    return _search(axis, jig, guess, None, starts)[0]


def _search(
    axis: AxisPoints, jig: Jig, guess: Pose | None, anchor_sigma_mm: float | None, near: Pose | None = None
) -> tuple[JigPoseFit, PoseProblem, Array]:
    """All minima, the problem, and the whitened Jacobian (rows, 6) at the chosen one."""
    index = string_indices(axis, jig)
    starts, directions = jig.starts[index], jig.directions[index]
    problem = PoseProblem(starts, directions, axis.yz_mm, whitening(axis.cov_yz_mm2))
    solution = _distinct(solve_poses(problem, _starts(problem, guess, near, jig), max_iterations=30))
    chi2 = chi2_with_tolerance(solution, axis, jig, index, anchor_sigma_mm)
    along = solution.along_mm / jig.lengths[index]
    possible = np.all((along > -BEYOND) & (along < 1 + BEYOND), axis=-1)
    chi2 = np.where(possible, chi2, np.inf) if np.any(possible) else chi2
    share = np.exp(-0.5 * (chi2 - np.min(chi2)))
    order = _order(chi2, solution.T_sensor_jig, guess, jig)
    candidates = tuple(_candidate(solution, axis, i, share[i] / share.sum(), chi2[i]) for i in order[:MAX_CANDIDATES])
    return JigPoseFit(candidates, 2 * len(axis) - 6), problem, solution.jacobian[order[0]]


def pose_near(axis: AxisPoints, jig: Jig, guess: Pose, root_information: Array) -> JigPoseFit:
    """The pose next to a guess of known uncertainty: for points that do not determine one on their own.

    root_information: (6, 6) of ξ in T = guess · Exp(ξ). dof counts what the points themselves check.
    """
    index = string_indices(axis, jig)
    white = whitening(axis.cov_yz_mm2)
    problem = PoseProblem(
        jig.starts[index], jig.directions[index], axis.yz_mm[None], white[None], (guess, root_information)
    )
    solution = _distinct(solve_poses(problem, Pose(guess.R[None], guess.t[None])))
    chi2 = chi2_with_tolerance(solution, axis, jig, index, None)
    candidate = _candidate(solution, axis, 0, 1.0, float(chi2[0]))
    own = solution.jacobian[0, : 2 * len(axis)]
    rank = int(np.sum(scaled_singular_values(own) > 1.0 / WEAK_CONDITION))
    return JigPoseFit((candidate,), 2 * len(axis) - rank)


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


def _starts(problem: PoseProblem, guess: Pose | None, near: Pose | None, jig: Jig) -> Pose:
    poses = [] if guess is None else [Pose(guess.R[None], guess.t[None])]
    few = len(problem.yz_mm) < 5
    searches = [grid_starts] if few else [pencil_starts] if jig.pillar is not None else [pencil_starts, grid_starts]
    given = (problem.starts, problem.directions, problem.yz_mm)
    poses += [search(*given) for search in searches] if near is None else [near]
    return Pose(np.concatenate([p.R for p in poses]), np.concatenate([p.t for p in poses]))


def _distinct(solution: PoseSolution) -> PoseSolution:
    """The different local minima, lowest cost first; NoAnswerError where nothing converged."""
    usable = solution.converged & np.isfinite(solution.cost)
    if not np.any(usable):
        raise NoAnswerError("no jig pose explains the points: the iteration converged from no start")
    kept: list[int] = []
    T = solution.T_sensor_jig
    for i in ascending(solution.cost, SAME_CHI2):
        if usable[i] and not any(_same(T[int(i)], T[k], solution.jacobian[k]) for k in kept):
            kept.append(int(i))
    k = np.array(kept)
    s = solution
    return PoseSolution(T[k], s.cost[k], s.jacobian[k], s.yz_mm[k], s.along_mm[k], s.converged[k])


def _same(a: Pose, b: Pose, jacobian: Array) -> bool:
    """Whether two poses are one minimum: almost equal, or nearby on the floor of a flat valley."""
    if np.max(np.abs(a.R - b.R)) > 2 * VALLEY_RAD:  # also keeps half turns, whose departure is not defined, apart
        return False
    xi = departure(b, a)
    turn = np.linalg.norm(xi[3:])
    equal = np.linalg.norm(xi[:3]) < SAME_MM and turn < SAME_RAD
    return bool(equal or (turn < VALLEY_RAD and np.sum((jacobian @ xi) ** 2) < VALLEY_CHI2))


def _order(chi2: Array, T: Pose, guess: Pose | None, jig: Jig) -> NDArray[np.intp]:
    """Most likely first; with a guess, the nearest to it among the about equally likely comes first."""
    order = ascending(chi2, SAME_CHI2)
    if guess is None:
        return order
    close = [int(i) for i in order if chi2[i] <= chi2[order[0]] + AMBIGUOUS_CHI2]
    anchors = jig.anchors_mm
    first = close[first_least([np.linalg.norm(T[i] @ anchors - guess @ anchors) for i in close], SAME_ANCHORS_MM)]
    return np.array([first, *[i for i in order if i != first]], dtype=np.intp)


def _candidate(solution: PoseSolution, axis: AxisPoints, i: int, likelihood: float, chi2: float) -> JigPoseCandidate:
    return JigPoseCandidate(
        T_sensor_jig=solution.T_sensor_jig[int(i)],
        cost=float(solution.cost[i]),
        chi2=float(chi2),
        likelihood=float(likelihood),
        converged=bool(solution.converged[i]),
        residuals_mm=solution.yz_mm[i] - axis.yz_mm,
        covariance=pose_covariance(solution.jacobian[i]),
    )
