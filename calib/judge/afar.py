"""Frames whose points mostly seem outlying: exact points gate at hundredths, and one wrong number moves millimetres.

The points' noise is taken for larger by so much that everything fits about, a suspect is tried there, where the problem
is as good as linear, and followed down to the noise that is stated.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from calib.bundle import Bundle, Explained, Solution, chain_start, explain, solve_bundle
from calib.config import CalibConfig
from calib.judge.suspects import LinearEvidence, SuspectTrial, evidence_of, grown
from geometry import Pose, Sensor, State

TIMES = (1e4, 1e2, 1.0)  # the points' variance: 100 times their σ are millimetres, what a wrong number moves them by
MOST_CHI2 = 1e3  # by the largest of these, beyond which the rows of frames are wrong, and no number of the files
FOLLOWED = 3  # suspects at each noise


@dataclass(frozen=True, eq=False)
class Coarse:
    """All points solved by a larger noise of theirs, nothing left out, and the suspects there, the largest first."""

    solution: Solution
    evidence: LinearEvidence
    trials: tuple[SuspectTrial, ...]
    times: float


@dataclass(frozen=True, eq=False)
class FromAfar:
    """A suspect that was followed down, and what it explains."""

    trial: SuspectTrial
    relaxed: Bundle
    explained: Explained


def lost_too_many(solution: Solution, config: CalibConfig) -> bool:
    """Whether so much was left out that the rest tells nothing of the files."""
    if solution.bundle.hands.inferred:
        return False
    gone = (solution.outlier | solution.frame_outlier[:, None])[solution.bundle.present]
    return not solution.every.converged or float(gone.mean()) > config.max_outlier_share


def coarse_solutions(
    bundle: Bundle, candidates: Sequence[Pose], solution: Solution, sensor: Sensor | None, begin: Pose
) -> Iterator[Coarse]:
    """The problem by ever smaller noise, each from where the one before came to, until one settles nowhere."""
    every = bundle.estimating(np.ones(len(bundle.estimated), dtype=bool), sensor=True)
    state, _ = chain_start(every, begin, candidates)
    for times in TIMES:
        wide = every.with_noise(times, every.hand_noise)
        try:
            result = solve_bundle(wide, state)
        except np.linalg.LinAlgError:
            return
        chi2 = result.cost / max(every.degrees_of_freedom, 1)
        if not result.converged or (times == TIMES[0] and chi2 > MOST_CHI2):
            return
        state = result.state
        points, frames = np.zeros_like(solution.outlier), np.zeros_like(solution.frame_outlier)
        whole = replace(solution, bundle=wide, every=result, outlier=points, frame_outlier=frames, explained=chi2)
        evidence = evidence_of(whole, sensor)
        seen = sorted((t for t in evidence.trials() if t.seen), key=lambda t: -t.gain)
        yield Coarse(whole, evidence, tuple(seen), times)


def followed(
    at: Coarse, relaxed_by_trial: Iterable[Bundle], candidates: Sequence[Pose], begin: Pose, config: CalibConfig
) -> Iterator[FromAfar]:
    """What the likeliest suspects at one noise explain at that which is stated, each by the problem relaxed for it."""
    for trial, relaxed in zip(at.trials, relaxed_by_trial, strict=False):
        near = _down(relaxed, at)
        if near is None:
            continue
        try:
            explained = explain(relaxed, candidates, begin, config, near)
        except np.linalg.LinAlgError:
            continue
        if explained.every.converged and _lost_share(explained) <= config.max_outlier_share:
            yield FromAfar(trial, relaxed, explained)


def _down(relaxed: Bundle, at: Coarse) -> State | None:
    """The state of a relaxed problem by ever smaller noise, from that of the problem itself."""
    every = relaxed.estimating(np.ones(len(relaxed.estimated), dtype=bool), sensor=True)
    state = grown(every, at.solution.every.state)
    for times in (t for t in TIMES if t <= at.times):
        try:
            result = solve_bundle(every.with_noise(times, every.hand_noise), state)
        except np.linalg.LinAlgError:
            return None
        if not result.converged:
            return None
        state = result.state
    return state


def _lost_share(explained: Explained) -> float:
    """Share of the points that were left out."""
    return float(np.mean(explained.robust.left_out[explained.kept.present]))
