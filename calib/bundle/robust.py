"""The bundle with outliers found and taken out, one a frame at a time."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from calib.bundle.problem import Bundle
from calib.bundle.solve import hand_twists, linearisations, solve_bundle
from calib.bundle.weights import deletion_chi2, frame_chi2
from calib.engine import Result
from geometry import State
from geometry.special import chdtri

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

_ROUNDS = 25  # one point a frame each; a set that needs more is beyond the share of outliers allowed
_MIN_POINTS = 3  # a frame with fewer trusted points is left out whole
_FRAME_TAIL = 1e-7  # of sound frames are left out by chance
# times every other frame's χ² over its limit: a frame a degree off in one joint has 2.3 to 30, as it pulls
_ALONE = 2.0


@dataclass(frozen=True, eq=False)
class RobustResult:
    """The bundle's answer, the outlying points (F, M) and the frames left out (F,)."""

    result: Result
    outlier: Mask
    frame_outlier: Mask

    @property
    def left_out(self) -> Mask:
        """Points (F, M) that were taken out, one by one or with their frame."""
        return self.outlier | self.frame_outlier[:, None]


def solve_robust(
    bundle: Bundle, start: State, point_chi2: float = 25.0, max_share: float = 0.25, strays: Mask | None = None
) -> RobustResult:
    """Solve, take out what the rest contradicts beyond its noise, solve again, until nothing changes.

    Robot errors that are not estimated widen the gate, so that a misfit of the model is not taken for outliers.
    point_chi2: gate of a point (2 degrees). max_share: stop when more than this share of the points went out.
    strays (F,): frames that the first solve leaves out; they come back where they fit.
    """
    present = bundle.present
    outlier = np.zeros_like(present)
    frame_outlier = np.zeros(len(present), dtype=bool) if strays is None else strays
    first = bundle.without(outlier | frame_outlier[:, None]) if np.any(frame_outlier) else bundle
    result = solve_bundle(first, start)
    for _ in range(_ROUNDS):
        after, frames_after = _judge(bundle, result, outlier, frame_outlier, point_chi2)
        if np.array_equal(after, outlier) and np.array_equal(frames_after, frame_outlier):
            break
        outlier, frame_outlier = after, frames_after
        if (outlier | frame_outlier[:, None])[present].mean() > max_share:
            break
        result = solve_bundle(bundle.without(outlier | frame_outlier[:, None]), result.state)
    return RobustResult(result, outlier, frame_outlier)


def _judge(bundle: Bundle, result: Result, outlier: Mask, frame_outlier: Mask, point_chi2: float) -> tuple[Mask, Mask]:
    """Outlying points and frames after this solution: at most one new point a frame, else one new frame.

    A frame that stands out alone, without its worst point too, goes first: it has pulled the others, whose points only
    seem to be wrong.
    """
    present = bundle.present
    noise, lins = gate_noise(bundle, result), linearisations(result)
    tried = zip(bundle.without(outlier).terms, lins, strict=True)
    distance = bundle.by_frame([deletion_chi2(t, lin, noise[t.frame]) for t, lin in tried])
    distance = np.where(present, distance, 0.0)
    stays = outlier & (distance > point_chi2)
    worst = np.argmax(np.where(outlier, 0.0, distance), axis=1)
    rows = np.arange(len(worst))
    new = np.zeros_like(outlier)
    new[rows, worst] = (distance[rows, worst] > point_chi2) & ~outlier[rows, worst] & ~frame_outlier
    out = stays | new
    few = (present & ~out).sum(axis=1) < np.minimum(_MIN_POINTS, present.sum(axis=1))
    judged = [frame_chi2(t, lin, noise[t.frame]) for t, lin in zip(bundle.without(out).terms, lins, strict=True)]
    chi2, dof = (bundle.by_frame([found[k] for found in judged]) for k in (0, 1))
    excess = chi2 / chdtri(np.maximum(dof, 1), _FRAME_TAIL)
    if np.any(new):
        alone = _standing_out(np.where(frame_outlier, 0.0, excess), np.any(new, axis=1))
        return (out, frame_outlier | few) if alone is None else (stays, frame_outlier | (rows == alone))
    frames = few | (frame_outlier & (excess > 1))
    kept = np.where(frames, 0.0, excess)
    if np.max(kept, initial=0.0) > 1:
        frames[int(np.argmax(kept))] = True
    return out, frames


def _standing_out(excess: Array, doubted: Mask) -> int | None:
    """The frame (F,) that is beyond all others, where points of others are doubted as well; None where none is."""
    worst = int(np.argmax(excess))
    others = np.delete(excess, worst)
    if excess[worst] <= max(1.0, _ALONE * np.max(others, initial=0.0)) or not np.any(np.delete(doubted, worst)):
        return None
    return worst


def gate_noise(bundle: Bundle, result: Result) -> Array:
    """Covariance (F, 6, 6) of the hand poses: joint noise, and the robot errors that were not estimated."""
    robot = bundle.unknowns.block("robot")
    columns = hand_twists(bundle, result) * np.where(robot.free, 0.0, robot.sigma)
    return np.asarray(bundle.hand_noise + columns @ np.swapaxes(columns, -1, -2))
