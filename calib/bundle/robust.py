"""The bundle with outliers found and taken out, one a frame at a time."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.stats import chi2 as chi2_law

from calib.bundle.bundle import BundleResult, solve_bundle
from calib.bundle.linearise import State
from calib.bundle.problem import Problem
from calib.bundle.weights import deletion_chi2, frame_chi2

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

_ROUNDS = 25
_MIN_POINTS = 3  # a frame with fewer trusted points is left out whole
_FRAME_TAIL = 1e-7


@dataclass(frozen=True, eq=False)
class RobustResult:
    """The bundle's answer, the outlying points (F, M) and the frames left out (F,)."""

    bundle: BundleResult
    outlier: Mask
    frame_outlier: Mask


def solve_robust(
    problem: Problem, start: State, estimated: Mask, point_chi2: float = 25.0, max_share: float = 0.25
) -> RobustResult:
    """Solve, take out what the rest contradicts beyond its noise, solve again, until nothing changes.

    Robot errors that are not estimated widen the gate, so that a misfit of the model is not taken for outliers.
    point_chi2: gate of a point (2 degrees). max_share: stop when more than this share of the points went out.
    """
    absent = ~problem.points.present
    outlier, frame_outlier = np.zeros_like(absent), np.zeros(problem.n_frames, dtype=bool)
    result = solve_bundle(problem, start, estimated)
    for _ in range(_ROUNDS):
        after, frames_after = _judge(problem, result, estimated, outlier, frame_outlier, point_chi2)
        if np.array_equal(after, outlier) and np.array_equal(frames_after, frame_outlier):
            break
        outlier, frame_outlier = after, frames_after
        if (outlier | frame_outlier[:, None])[problem.points.present].mean() > max_share:
            break
        removed = absent | outlier | frame_outlier[:, None]
        result = solve_bundle(problem, result.state, estimated, removed)
    return RobustResult(result, outlier, frame_outlier)


def _judge(
    problem: Problem,
    result: BundleResult,
    estimated: Mask,
    outlier: Mask,
    frame_outlier: Mask,
    point_chi2: float,
) -> tuple[Mask, Mask]:
    """Outlying points and frames after this solution: at most one new point a frame, else one new frame."""
    absent = ~problem.points.present
    noise = gate_noise(problem, result, estimated)
    distance = np.where(absent, 0.0, deletion_chi2(problem, result.lin, absent | outlier, noise))
    stays = outlier & (distance > point_chi2)
    worst = np.argmax(np.where(outlier, 0.0, distance), axis=1)
    rows = np.arange(len(worst))
    new = np.zeros_like(outlier)
    new[rows, worst] = (distance[rows, worst] > point_chi2) & ~outlier[rows, worst] & ~frame_outlier
    out = stays | new
    few = (problem.points.present & ~out).sum(axis=1) < np.minimum(_MIN_POINTS, problem.points.present.sum(axis=1))
    if np.any(new):
        return out, frame_outlier | few
    chi2, dof = frame_chi2(problem, result.lin, absent | out, noise)
    excess = chi2 / chi2_law.isf(_FRAME_TAIL, np.maximum(dof, 1))
    frames = few | (frame_outlier & (excess > 1))
    kept = np.where(frames, 0.0, excess)
    if np.max(kept, initial=0.0) > 1:
        frames[int(np.argmax(kept))] = True
    return out, frames


def gate_noise(problem: Problem, result: BundleResult, estimated: Mask) -> Array:
    """Covariance (F, 6, 6) of the hand poses: joint noise, and the robot errors that were not estimated."""
    sigma = np.where(estimated, 0.0, problem.chain.parameter_sigma)
    columns = result.lin.parameters * sigma
    return np.asarray(problem.chain.noise + columns @ np.swapaxes(columns, -1, -2))
