"""Labels of all frames of one location, which share the jig's pose through the robot chain."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from calib.config import CalibConfig
from calib.label_chain import Chain, mahalanobis2
from calib.label_evidence import Prior
from calib.label_refine import LabelledFrame, half_turned, with_pose
from calib.labelling import label_spots
from geometry import Pose, SensorModel, SurfacePoints
from jig_cad import Jig

Array = NDArray[np.float64]

CONSISTENT_CHI2 = 30.0  # 6 degrees of freedom: 4e-5 of true predictions lie farther
GIVEN_JIG_SIGMA_MM, GIVEN_JIG_SIGMA_DEG = 3.0, 1.0  # how well a T_base_jig of cell.toml is taken to be known
SOLVED_SHARE = 0.2  # of that, where it was solved for


def label_location(
    frames: Sequence[SurfacePoints],
    Ts_base_hand: Pose,
    T_hand_sensor: Pose,
    jig: Jig,
    sensor: SensorModel,
    config: CalibConfig,
    T_base_jig: Pose | None = None,
    refined: bool = False,
) -> tuple[LabelledFrame, ...]:
    """Label the frames of one location, in the order given; the first labelled frame decides the half turn.

    Ts_base_hand: (N) by the robot. T_hand_sensor: by design, or solved: then set ``refined``, which narrows the gates.
    T_base_jig: where known (cell.toml, or solved before); it then decides the half turn.
    """
    chain = Chain.build(Ts_base_hand, T_hand_sensor, config.labelling, refined)
    priors: list[Prior | None] = []
    if T_base_jig is not None:
        share = SOLVED_SHARE if refined else 1.0
        covariance = np.diag(np.repeat([GIVEN_JIG_SIGMA_MM, np.deg2rad(GIVEN_JIG_SIGMA_DEG)], 3) ** 2) * share**2
        priors = [chain.from_base(T_base_jig, covariance, j) for j in range(len(frames))]
        if refined:
            again = [label_spots(f, jig, sensor, p, config) for f, p in zip(frames, priors, strict=True)]
            if all(f.reason != "not_labelled" for f in again):
                return tuple(again)
    found = [label_spots(points, jig, sensor, None, config) for points in frames]
    if not refined and not _plausible(found, priors, jig):
        priors = []
    priors = priors or _priors_by_vote(found, chain, jig)
    out = [
        _settle(points, one, prior, jig, sensor, config)
        for points, one, prior in zip(frames, found, priors, strict=True)
    ]
    return tuple(out)


def _plausible(found: list[LabelledFrame], priors: list[Prior | None], jig: Jig) -> bool:
    """Whether a given T_base_jig predicts any of the frames that were labelled without it, if there are two or more."""
    pairs = [(f, p) for f, p in zip(found, priors, strict=False) if p is not None and f.T_sensor_jig is not None]
    agreeing = sum(mahalanobis2(p, *_nearest(p, f, jig)) < CONSISTENT_CHI2 for f, p in pairs)
    return len(pairs) < 2 or agreeing > 0


def _priors_by_vote(found: list[LabelledFrame], chain: Chain, jig: Jig) -> list[Prior | None]:
    """Every frame's prediction from the frames that agree with most others, half turn by the first of them."""
    labelled = [i for i, f in enumerate(found) if f.T_sensor_jig is not None]
    if not labelled:
        return [None] * len(found)
    agreeing = max((_agreeing(i, labelled, found, chain, jig) for i in labelled), key=len)
    first = min(agreeing)
    T, covariance = _pose_of(found[first])
    references = {first: (T, covariance)}
    for i in sorted(agreeing):
        prior = chain.from_frame(first, T, covariance, i)
        references[i] = _nearest(prior, found[i], jig)
    return [_best_prior(j, references, chain, jig) for j in range(len(found))]


def _agreeing(i: int, labelled: list[int], found: list[LabelledFrame], chain: Chain, jig: Jig) -> set[int]:
    T, covariance = _pose_of(found[i])
    out = {i}
    for j in labelled:
        if j == i:
            continue
        prior = chain.from_frame(i, T, covariance, j)
        near, cov = _nearest(prior, found[j], jig)
        if mahalanobis2(prior, near, cov) < CONSISTENT_CHI2:
            out.add(j)
    return out


def _nearest(prior: Prior, frame: LabelledFrame, jig: Jig) -> tuple[Pose, Array]:
    """The candidate of a frame, its half turn included, that is nearest to the prediction."""
    poses = [
        (c.T_sensor_jig, c.covariance) for c in frame.candidates if c.likelihood > 1e-6 or c is frame.candidates[0]
    ]
    turn = jig.half_turn
    carried = turn.inverse().adjoint
    poses += [(T @ turn, carried @ cov @ carried.T) for T, cov in poses]
    return min(poses, key=lambda p: mahalanobis2(prior, *p))


def _best_prior(j: int, references: dict[int, tuple[Pose, Array]], chain: Chain, jig: Jig) -> Prior | None:
    """The prediction of frame j, from another frame, that leaves the smallest gates."""
    priors = [chain.from_frame(i, T, cov, j) for i, (T, cov) in references.items() if i != j or len(references) == 1]
    return min(priors, key=lambda p: float(np.trace(p.covariance[:3, :3]))) if priors else None


def _pose_of(frame: LabelledFrame) -> tuple[Pose, Array]:
    best = frame.candidates[0]
    return best.T_sensor_jig, best.covariance


def _settle(
    points: SurfacePoints, found: LabelledFrame, prior: Prior | None, jig: Jig, sensor: SensorModel, config: CalibConfig
) -> LabelledFrame:
    """The frame's own labels, turned and with the candidate that the chain names; labelled anew where they disagree."""
    if prior is None:
        return found
    complete = found.T_sensor_jig is not None and len(found.axis) == len(jig.strings)
    if found.T_sensor_jig is not None:
        T, cov = _nearest(prior, found, jig)
        if mahalanobis2(prior, T, cov) < CONSISTENT_CHI2 and complete:
            turned = T.R[:, 0] @ found.T_sensor_jig.R[:, 0] < 0
            frame = half_turned(found, points, jig, sensor, config) if turned else found
            return with_pose(frame, T)
    return label_spots(points, jig, sensor, prior, config)
