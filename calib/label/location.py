"""Labels of all frames of one location, which share the jig's pose through the robot chain."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from calib.config import CalibConfig
from calib.label.chain import HandChain, mahalanobis2
from calib.label.evidence import SAME_CHI2, Prior
from calib.label.frame import label_spots
from calib.label.gates import SAME_GATE
from calib.label.refine import LabelledFrame, turned_over, upright_turn, with_pose
from geometry import Pose, Sensor, SurfacePoints, stack_poses
from geometry.ties import first_least, first_least_of_each
from jig_cad import Jig

Array = NDArray[np.float64]

LIKELY = 1e-6  # a candidate below this share is no rival to the chosen one
CONSISTENT_CHI2 = 30.0  # 6 degrees of freedom: 4e-5 of true predictions lie farther
GIVEN_JIG_SIGMA_MM, GIVEN_JIG_SIGMA_DEG = 3.0, 1.0  # of a T_base_jig in cell.toml: measured with a pointer, say
SOLVED_SHARE = 0.2  # of that, where it was solved for: an arm's nominal table leaves some 0.5 mm


def label_location(
    frames: Sequence[SurfacePoints],
    Ts_base_hand: Pose,
    T_hand_sensor: Pose,
    jig: Jig,
    sensor: Sensor,
    config: CalibConfig,
    T_base_jig: Pose | None = None,
    refined: bool = False,
) -> tuple[LabelledFrame, ...]:
    """Label the frames of one location, in the order given; the first labelled frame (x_jig · x_sensor > 0) decides
    which of the poses that the jig's symmetries join.

    Ts_base_hand: (N) by the robot. T_hand_sensor: by design, or solved: then set ``refined``, which narrows the gates.
    T_base_jig: where known (cell.toml, or solved before); it then decides that.
    """
    chain = HandChain.build(Ts_base_hand, T_hand_sensor, config.labelling, refined)
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
    turn = None if T_base_jig is not None else upright_turn([f.T_sensor_jig for f in out], jig)
    if turn is not None:
        out = [turned_over(f, turn, points, jig, sensor, config) for f, points in zip(out, frames, strict=True)]
    return tuple(out)


def _plausible(found: list[LabelledFrame], priors: list[Prior | None], jig: Jig) -> bool:
    """Whether a given T_base_jig predicts any of the frames that were labelled without it, if there are two or more."""
    pairs = [(f, p) for f, p in zip(found, priors, strict=False) if p is not None and f.T_sensor_jig is not None]
    agreeing = sum(bool(np.min(_Pool.of([f], jig).distances(p)) < CONSISTENT_CHI2) for f, p in pairs)
    return len(pairs) < 2 or agreeing > 0


@dataclass(frozen=True, eq=False)
class _Pool:
    """The likely candidates of all frames, each with the poses beside it that the jig's symmetries make of it.

    T_sensor_jig (C), covariance (C, 6, 6), frame (C,): whose it is; a frame's chosen candidate comes first.
    turn (C,): which of the jig's symmetries it took, -1 for none.
    """

    T_sensor_jig: Pose
    covariance: Array
    frame: NDArray[np.intp]
    turn: NDArray[np.intp]

    @staticmethod
    def of(found: Sequence[LabelledFrame], jig: Jig) -> _Pool:
        carried = [s.pose.inverse().adjoint for s in jig.symmetries]
        poses, covariances, frames, turns = [], [], list[int](), list[int]()
        for i, f in enumerate(found):
            for c in f.candidates if f.T_sensor_jig is not None else ():
                if c is f.candidates[0] or c.likelihood > LIKELY:
                    poses += [c.T_sensor_jig, *(c.T_sensor_jig @ s.pose for s in jig.symmetries)]
                    covariances += [c.covariance, *(a @ c.covariance @ a.T for a in carried)]
                    frames += [i] * (1 + len(carried))
                    turns += range(-1, len(carried))
        whose, turned = np.array(frames, dtype=np.intp), np.array(turns, dtype=np.intp)
        return _Pool(stack_poses(poses), np.array(covariances).reshape(-1, 6, 6), whose, turned)

    def distances(self, prior: Prior) -> Array:
        """Squared distances (C,) from a prediction of one frame, or of each candidate's own."""
        return mahalanobis2(prior, self.T_sensor_jig, self.covariance)

    def distances_by(self, i: int, chain: HandChain) -> Array:
        """Squared distances (C,) from what the chosen candidate of frame i predicts."""
        k = int(np.argmax(self.frame == i))
        return self.distances(chain.from_frame(i, self.T_sensor_jig[k], self.covariance[k], self.frame))


def _priors_by_vote(found: list[LabelledFrame], chain: HandChain, jig: Jig) -> list[Prior | None]:
    """Every frame's prediction from the frames that agree with most others, turned for now as the first of them."""
    pool = _Pool.of(found, jig)
    labelled = np.unique(pool.frame)
    if not len(labelled):
        return [None] * len(found)
    distances = {int(i): pool.distances_by(int(i), chain) for i in labelled}
    agreeing = {i: {i, *map(int, pool.frame[d < CONSISTENT_CHI2])} for i, d in distances.items()}
    chosen = sorted(agreeing[max(agreeing, key=lambda i: len(agreeing[i]))])
    by_first = distances[chosen[0]]
    mine = [np.flatnonzero(pool.frame == i) for i in chosen]
    nearest = [k[first_least(by_first[k], SAME_CHI2)] for k in mine]
    return _best_priors(pool, np.array(nearest), chain, len(found))


def _best_priors(pool: _Pool, references: NDArray[np.intp], chain: HandChain, n_frames: int) -> list[Prior | None]:
    """The prediction of every frame by that reference, of another frame, which leaves the smallest gates."""
    frames = pool.frame[references]
    T, covariance = pool.T_sensor_jig[references], pool.covariance[references]
    every = chain.from_frame(frames[:, None], T[:, None], covariance[:, None], np.arange(n_frames)[None])
    gates = np.trace(every.covariance[..., :3, :3], axis1=-2, axis2=-1)
    if len(references) > 1:
        gates[np.arange(len(frames)), frames] = np.inf
    best = first_least_of_each(np.log(gates.T), SAME_GATE)
    return [Prior(every.T_sensor_jig[int(k), j], every.covariance[k, j]) for j, k in enumerate(best)]


def _settle(
    points: SurfacePoints, found: LabelledFrame, prior: Prior | None, jig: Jig, sensor: Sensor, config: CalibConfig
) -> LabelledFrame:
    """The frame's own labels, turned and with the candidate that the chain names; labelled anew where they disagree."""
    if prior is None:
        return found
    complete = found.T_sensor_jig is not None and len(found.axis) == len(jig.strings)
    if found.T_sensor_jig is not None and complete:
        pool = _Pool.of([found], jig)
        distances = pool.distances(prior)
        nearest = first_least(distances, SAME_CHI2)
        if distances[nearest] < CONSISTENT_CHI2:
            turn = int(pool.turn[nearest])
            frame = found if turn < 0 else turned_over(found, jig.symmetries[turn], points, jig, sensor, config)
            return with_pose(frame, pool.T_sensor_jig[nearest])
    return label_spots(points, jig, sensor, prior, config)
