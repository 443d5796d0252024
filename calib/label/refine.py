"""From a labelling to axis points and a pose: the surface offset needs the pose, the pose the axis points."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import lru_cache
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from calib.config import CalibConfig
from calib.label.evidence import SAME_CHI2, Prior
from calib.label.surface_offset import axis_points
from calib.pose import JigPoseCandidate, JigPoseFit, crossings, fit_pose, pose_near
from geometry import AxisPoints, NoAnswerError, Pose, Sensor, SurfacePoints, Symmetry
from geometry.special import chdtri
from geometry.ties import first_least
from jig_cad import Jig

Array = NDArray[np.float64]
IntArray = NDArray[np.intp]
LabelReason = Literal["no_spots", "too_few_spots", "not_labelled"]

ALIKE = 1e-6  # cosines nearer to each other are equal but for rounding
KEEP_MM = 1.0  # a spot farther from its string than this is not the string's
SAME_OFF = 1e-6  # mm and rad: candidates as near as this to a pose are equally near
FULL = 5  # strings that determine a pose on their own


@dataclass(frozen=True, eq=False)
class LabelledFrame:
    """One frame's strings: axis points in the order of the jig's strings, and the pose that explains them.

    candidates: poses that explain the same labels (the mirror), most likely first. cost: χ² of the chosen pose,
    anchors' tolerance included, at ``dof``. reason: why nothing was labelled, or None.
    """

    axis: AxisPoints = field(default_factory=AxisPoints.empty)
    T_sensor_jig: Pose | None = None
    candidates: tuple[JigPoseCandidate, ...] = ()
    cost: float = float("nan")
    dof: int = 0
    reason: LabelReason | None = None


def refine_labels(
    points: SurfacePoints,
    labels: IntArray,
    T_sensor_jig: Pose,
    prior: Prior | None,
    jig: Jig,
    sensor: Sensor,
    config: CalibConfig,
    starts: Pose | None = None,
) -> LabelledFrame | None:
    """The labelled frame, or None where its spots do not fit the jig, not even with one of them left out.

    labels: spot of every string (S,), -1 where none. T_sensor_jig: wrong by a degree at most. starts: the minima (K)
    of about the same points, where they are known.
    """
    part = _Part(points, T_sensor_jig, prior, jig, sensor, config, starts)
    try:
        axis, pose = part.solve(labels)
        if part.misfit(pose) and len(axis) >= FULL:
            axis, pose = _without_worst(part, labels, axis)
    except NoAnswerError:
        return None
    if part.misfit(pose):
        return None
    return LabelledFrame(axis, pose.T_sensor_jig, pose.candidates, pose.best.chi2, pose.dof)


@dataclass(frozen=True, eq=False)
class _Part:
    """What stays the same while labels are tried."""

    points: SurfacePoints
    T_sensor_jig: Pose
    prior: Prior | None
    jig: Jig
    sensor: Sensor
    config: CalibConfig
    starts: Pose | None = None

    def solve(self, labels: IntArray) -> tuple[AxisPoints, JigPoseFit]:
        """Axis points for the pose, then the pose for the axis points: a pose of 1° suffices for the offsets."""
        index = np.flatnonzero(labels >= 0)
        names = tuple(self.jig.strings[i] for i in index)
        spots = take(self.points, labels[index])
        given = None if self.prior is None else (self.prior.T_sensor_jig, self.prior.root_information)
        T = self.T_sensor_jig
        yz, cov = axis_points(spots, names, self.jig, self.sensor, T, self.config)
        axis = AxisPoints(names, labels[index], yz, cov, spots.flag, spots.yz_mm - yz)
        if given is not None and len(index) < FULL:
            return axis, pose_near(axis, self.jig, *given)
        return axis, fit_pose(axis, self.jig, T if given is None else given[0], self.starts)

    def misfit(self, pose: JigPoseFit) -> bool:
        """Whether χ² says that some point is not where its string is."""
        return pose.dof > 0 and pose.best.chi2 > _chi2_limit(self.config.labelling.min_probability, pose.dof)


@lru_cache
def _chi2_limit(probability: float, dof: int) -> float:
    return float(chdtri(dof, probability))


def _without_worst(part: _Part, labels: IntArray, axis: AxisPoints) -> tuple[AxisPoints, JigPoseFit]:
    """The frame less the one string whose absence lets the others agree; kept with a flag if it is near its string."""
    trials = []
    for s in map(int, np.flatnonzero(labels >= 0)):
        fewer = labels.copy()
        fewer[s] = -1
        trials.append((s, *part.solve(fewer)))
    s, rest, pose = trials[first_least([t[2].best.chi2 for t in trials], SAME_CHI2)]
    k = axis.label.index(part.jig.strings[s])
    predicted, _ = crossings(pose.T_sensor_jig, part.jig.starts[s : s + 1], part.jig.directions[s : s + 1])
    if np.linalg.norm(predicted[0] - axis.yz_mm[k]) > KEEP_MM:
        return rest, pose
    flagged = replace(axis, flag=tuple((f or "pose_residual") if i == k else f for i, f in enumerate(axis.flag)))
    return flagged, replace(pose, candidates=tuple(_seen_by(c, flagged, part.jig) for c in pose.candidates))


def _seen_by(candidate: JigPoseCandidate, axis: AxisPoints, jig: Jig) -> JigPoseCandidate:
    """The candidate with the residuals of all points of ``axis``, of which it was fitted to fewer."""
    lines = [jig.strings.index(label) for label in axis.label]
    predicted, _ = crossings(candidate.T_sensor_jig, jig.starts[lines], jig.directions[lines])
    return replace(candidate, residuals_mm=predicted - axis.yz_mm)


def take(points: SurfacePoints, index: IntArray) -> SurfacePoints:
    """The spots at ``index``."""
    p = points
    return SurfacePoints(
        p.uv_px[index],
        p.cov_uv_px2[index],
        p.yz_mm[index],
        p.cov_yz_mm2[index],
        p.score[index],
        tuple(p.flag[i] for i in index),
        p.axis_rad[index],
        p.sigma_px[index],
        p.amplitude_dn[index],
    )


def upright_turn(Ts_sensor_jig: Sequence[Pose | None], jig: Jig) -> Symmetry | None:
    """The symmetry by which the first pose that there is comes to the convention, None where it is there already.

    Of the poses that points can not tell, the one with the largest x_jig · x_sensor is taken; where turns about x leave
    that alike, the one with the largest y_jig · y_sensor.
    """
    first = next((T for T in Ts_sensor_jig if T is not None), None)
    if first is None:
        return None
    best, upright = None, first
    for symmetry in jig.symmetries:
        turned = first @ symmetry.pose
        x, y = (float(turned.R[k, k] - upright.R[k, k]) for k in (0, 1))
        if x > ALIKE or (abs(x) <= ALIKE and y > ALIKE):
            best, upright = symmetry, turned
    return best


def turned_over(
    frame: LabelledFrame,
    turn: Symmetry,
    points: SurfacePoints,
    jig: Jig,
    sensor: Sensor,
    config: CalibConfig,
) -> LabelledFrame:
    """The frame with the jig carried onto itself: the pillar the other way up, where B and C change places."""
    if frame.T_sensor_jig is None:
        return frame
    if not jig.measured and jig.pillar is not None:
        return _renamed(frame, turn, jig)
    labels = np.full(len(jig.strings), -1, dtype=np.intp)
    for label, spot in zip(frame.axis.label, frame.axis.spot, strict=True):
        labels[jig.strings.index(turn.relabelled(label))] = spot
    flags = {int(s): f for s, f in zip(frame.axis.spot, frame.axis.flag, strict=True)}
    T = frame.T_sensor_jig @ turn.pose
    axis, pose = _Part(points, T, None, jig, sensor, config).solve(labels)
    axis = replace(axis, flag=tuple(flags[int(s)] for s in axis.spot))
    return LabelledFrame(axis, pose.T_sensor_jig, pose.candidates, pose.best.chi2, pose.dof)


def _renamed(frame: LabelledFrame, turn: Symmetry, jig: Jig) -> LabelledFrame:
    """The frame turned over where that is exact: strings change their names, lines and spots stay."""
    axis = frame.axis
    names = [turn.relabelled(label) for label in axis.label]
    order = sorted(range(len(axis)), key=lambda i: jig.strings.index(names[i]))
    flags = tuple(axis.flag[i] for i in order) if axis.flag else ()
    offset = None if axis.offset_mm is None else axis.offset_mm[order]
    turned = AxisPoints(
        tuple(names[i] for i in order), axis.spot[order], axis.yz_mm[order], axis.cov_yz_mm2[order], flags, offset
    )
    carried = turn.pose.inverse().adjoint
    candidates = tuple(
        replace(
            c,
            T_sensor_jig=c.T_sensor_jig @ turn.pose,
            covariance=carried @ c.covariance @ carried.T,
            residuals_mm=c.residuals_mm[order],
        )
        for c in frame.candidates
    )
    T = None if frame.T_sensor_jig is None else frame.T_sensor_jig @ turn.pose
    return replace(frame, axis=turned, T_sensor_jig=T, candidates=candidates)


def with_pose(frame: LabelledFrame, near: Pose) -> LabelledFrame:
    """The frame with the candidate nearest to ``near`` chosen: a mirror resolved by other frames."""
    if len(frame.candidates) < 2:
        return frame
    off = [float(np.linalg.norm((c.T_sensor_jig.inverse() @ near).log())) for c in frame.candidates]
    chosen = frame.candidates[first_least(off, SAME_OFF)]
    rest = tuple(c for c in frame.candidates if c is not chosen)
    return replace(frame, T_sensor_jig=chosen.T_sensor_jig, candidates=(chosen, *rest), cost=chosen.chi2)
