"""Which spot is which string: labels from the jig's geometry, among clutter."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from calib.axis_offset import axis_points, surface_offset
from calib.config import CalibConfig
from calib.crossings import crossings
from calib.jig_pose import anchor_sigma, jig_pose, whitening
from calib.jig_pose_types import JigPoseCandidate, JigPoseResult
from calib.label_evidence import Hypotheses, Prior, Spots, weigh
from calib.label_faces import five_spot_labels
from calib.label_gates import DETECTED, gated_labels
from calib.pose_solver import PoseProblem, solve_poses
from geometry import AxisPoints, NoAnswerError, Pose, SensorModel, SurfacePoints, skew
from jig_cad import Jig, half_turn_label

Array = NDArray[np.float64]
IntArray = NDArray[np.intp]
LabelReason = Literal["no_spots", "too_few_spots", "not_labelled"]

HYPOTHESES = 60  # solved in full; the true labelling is among the first few
MIN_EVIDENCE = 9.0  # nats over "all clutter"
MARGIN = 7.0  # nats over any other labelling: 1 in 1,100
SAME_POSE_MM = 3.0
OFFSET_SPREAD = 0.5  # radii: how much the lit surface's offset differs between strings of unknown direction
KEEP_MM = 1.0  # a spot farther from its string than this is not the string's


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


def label_frame(
    points: SurfacePoints,
    jig: Jig,
    sensor: SensorModel,
    T_sensor_jig_guess: Pose | None,
    config: CalibConfig,
) -> LabelledFrame:
    """Label one frame's spots.

    With a guess of the pose (wrong by several mm and a few degrees) three or four strings suffice; without, five are
    needed and the half turn is chosen so that x_jig · x_sensor > 0.
    """
    prior = None if T_sensor_jig_guess is None else guess_prior(T_sensor_jig_guess, jig, config)
    return label_spots(points, jig, sensor, prior, config)


def guess_prior(guess: Pose, jig: Jig, config: CalibConfig) -> Prior:
    """A guess with the σ of the configuration, which are meant at the jig's middle."""
    c = jig.anchors_mm.mean(0)
    sigma = np.repeat([config.labelling.guess_sigma_mm, np.deg2rad(config.labelling.guess_sigma_deg)], 3)
    to_origin = np.block([[np.eye(3), skew(c)], [np.zeros((3, 3)), np.eye(3)]])
    return Prior(guess, to_origin @ np.diag(sigma**2) @ to_origin.T)


def label_spots(
    points: SurfacePoints, jig: Jig, sensor: SensorModel, prior: Prior | None, config: CalibConfig
) -> LabelledFrame:
    """Label one frame's spots with a prior of any covariance, or none."""
    if len(points) == 0:
        return LabelledFrame(reason="no_spots")
    if len(points) < (5 if prior is None else 3):
        return LabelledFrame(reason="too_few_spots")
    hypotheses = _hypotheses(points, jig, sensor, prior, config)
    labels = None if hypotheses is None else _decide(hypotheses, jig)
    if hypotheses is None or labels is None:
        return LabelledFrame(reason="not_labelled")
    return _finish(points, labels, hypotheses.T_sensor_jig[0], jig, sensor, prior, config)


def _hypotheses(
    points: SurfacePoints, jig: Jig, sensor: SensorModel, prior: Prior | None, config: CalibConfig
) -> Hypotheses | None:
    spots = _spots(points, jig, sensor, prior, config)
    limits = config.labelling
    tilt = np.deg2rad(limits.max_tilt_deg)
    orientation = 1.0 if prior is None else float(np.sign(prior.T_sensor_jig.R[0, 0]))
    tolerance = 4 * np.sqrt(float(np.median(np.trace(spots.cov_mm2, axis1=1, axis2=2))) / 2)
    labels = five_spot_labels(spots.yz_mm, jig, orientation, tolerance, tilt, HYPOTHESES)
    if prior is not None:
        more = gated_labels(spots.yz_mm, spots.cov_mm2, jig, prior.T_sensor_jig, prior.covariance, spots.density, 400)
        labels = np.unique(np.concatenate([labels, more[:HYPOTHESES]]), axis=0)
    if len(labels) == 0:
        return None
    found = weigh(labels, spots, jig, prior, tilt)
    if prior is None and len(found) and len(jig.strings) > 5:
        found = _complete(found, spots, jig, tilt)
    return found


def _complete(found: Hypotheses, spots: Spots, jig: Jig, tilt: float) -> Hypotheses:
    """Further strings of the jig, sought where the poses of the five-spot labellings put them."""
    labels = [found.labels]
    for i in range(min(len(found), 5)):
        base = Prior(found.T_sensor_jig[i], found.covariance[i])
        labels.append(
            gated_labels(spots.yz_mm, spots.cov_mm2, jig, base.T_sensor_jig, base.covariance, spots.density, 50)
        )
    stacked = np.concatenate(labels)
    stacked = np.unique(stacked[np.sum(stacked >= 0, axis=1) >= 5], axis=0)
    return weigh(stacked, spots, jig, None, tilt)


def _spots(points: SurfacePoints, jig: Jig, sensor: SensorModel, prior: Prior | None, config: CalibConfig) -> Spots:
    """The spots less a mean surface offset, with everything that a labelling does not know yet in their covariance."""
    n = min(len(points), config.labelling.max_candidates)
    x_jig = np.array([1.0, 0.0, 0.0]) if prior is None else prior.T_sensor_jig.R[:, 0]
    radius = jig.string_diameter_mm / 2
    offset, _ = surface_offset(points.yz_mm[:n], np.broadcast_to(x_jig, (n, 3)), radius, sensor, config.surface)
    extra = config.labelling.floor_mm**2 + (OFFSET_SPREAD * radius) ** 2 + anchor_sigma(jig) ** 2
    cov = points.cov_yz_mm2[:n] + extra * np.eye(2)
    odds = 0.5 * np.log((points.score[:n] + 0.05) / (1.05 - points.score[:n]))
    area = (3 * jig.side_mm) ** 2
    return Spots(points.yz_mm[:n] - offset, cov, odds, max(len(points), 5) / area)


def _decide(found: Hypotheses, jig: Jig) -> IntArray | None:
    """Labels (S,) of the best hypothesis, less what rivals contest; None where none is sure."""
    none_found = len(jig.strings) * np.log(1 - DETECTED)
    if len(found) == 0 or found.log_evidence[0] - none_found < MIN_EVIDENCE:
        return None
    labels = found.labels[0].copy()
    anchors = found.T_sensor_jig @ jig.anchors_mm[None].repeat(len(found), 0)
    for i in range(1, len(found)):
        if found.log_evidence[i] < found.log_evidence[0] - MARGIN:
            break
        differs = found.labels[i] != found.labels[0]
        moved = np.sqrt(np.mean(np.sum((anchors[i] - anchors[0]) ** 2, -1)))
        if moved > SAME_POSE_MM:
            return None
        labels[differs] = -1
    return labels if np.sum(labels >= 0) >= 3 else None


def _finish(
    points: SurfacePoints,
    labels: IntArray,
    T: Pose,
    jig: Jig,
    sensor: SensorModel,
    prior: Prior | None,
    config: CalibConfig,
) -> LabelledFrame:
    """Axis points for the pose and the pose for the axis points, twice; then judge what is left."""
    guess = T if prior is None else prior.T_sensor_jig
    try:
        axis, pose = _refine(points, labels, T, guess, jig, sensor, config)
        if _misfit(pose, config) and len(axis) >= 5:
            axis, pose = _without_worst(points, labels, axis, pose, guess, jig, sensor, config)
    except NoAnswerError:
        return LabelledFrame(reason="not_labelled")
    if _misfit(pose, config):
        return LabelledFrame(reason="not_labelled")
    return LabelledFrame(axis, pose.T_sensor_jig, pose.candidates, pose.best.chi2, pose.dof)


def _refine(
    points: SurfacePoints, labels: IntArray, T: Pose, guess: Pose, jig: Jig, sensor: SensorModel, config: CalibConfig
) -> tuple[AxisPoints, JigPoseResult]:
    index = np.flatnonzero(labels >= 0)
    names = tuple(jig.strings[i] for i in index)
    spots = labels[index]
    chosen = take(points, spots)
    yz, cov = axis_points(chosen, names, jig, sensor, T, config)
    problem = PoseProblem(jig.starts[index], jig.directions[index], yz, whitening(cov))
    T = solve_poses(problem, T, max_iterations=8, tolerance=1e-4).T_sensor_jig
    yz, cov = axis_points(chosen, names, jig, sensor, T, config)
    axis = AxisPoints(names, spots, yz, cov, chosen.flag)
    return axis, jig_pose(axis, jig, guess)


def _misfit(pose: JigPoseResult, config: CalibConfig) -> bool:
    return pose.dof > 0 and pose.best.chi2 > config.labelling.max_chi2_per_dof * pose.dof


def _without_worst(
    points: SurfacePoints,
    labels: IntArray,
    axis: AxisPoints,
    pose: JigPoseResult,
    guess: Pose,
    jig: Jig,
    sensor: SensorModel,
    config: CalibConfig,
) -> tuple[AxisPoints, JigPoseResult]:
    """The frame less the one string whose absence lets the others agree; kept with a flag if it is near its string."""
    trials = []
    for s in np.flatnonzero(labels >= 0):
        fewer = labels.copy()
        fewer[s] = -1
        trials.append((s, *_refine(points, fewer, pose.T_sensor_jig, guess, jig, sensor, config)))
    s, rest, best = min(trials, key=lambda t: t[2].best.chi2)
    k = axis.label.index(jig.strings[s])
    predicted = _crossing(best.T_sensor_jig, jig, int(s))
    if np.linalg.norm(predicted - axis.yz_mm[k]) > KEEP_MM:
        return rest, best
    flag = tuple((f or "pose_residual") if i == k else f for i, f in enumerate(axis.flag))
    return replace(axis, flag=flag), best


def _crossing(T: Pose, jig: Jig, s: int) -> Array:
    return np.asarray(crossings(T, jig.starts[s : s + 1], jig.directions[s : s + 1])[0][0])


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


def half_turned(
    frame: LabelledFrame, points: SurfacePoints, jig: Jig, sensor: SensorModel, config: CalibConfig
) -> LabelledFrame:
    """The same frame with the jig seen the other way up (B and C change places); as it is where the jig has no such twin."""
    if frame.T_sensor_jig is None or any(half_turn_label(label) not in jig.strings for label in frame.axis.label):
        return frame
    labels = np.full(len(jig.strings), -1, dtype=np.intp)
    for label, spot in zip(frame.axis.label, frame.axis.spot, strict=True):
        labels[jig.strings.index(half_turn_label(label))] = spot
    flags = {int(s): f for s, f in zip(frame.axis.spot, frame.axis.flag, strict=True)}
    T = frame.T_sensor_jig @ jig.half_turn
    axis, pose = _refine(points, labels, T, T, jig, sensor, config)
    axis = replace(axis, flag=tuple(flags[int(s)] for s in axis.spot))
    return LabelledFrame(axis, pose.T_sensor_jig, pose.candidates, pose.best.chi2, pose.dof)


def with_pose(frame: LabelledFrame, near: Pose) -> LabelledFrame:
    """The frame with the candidate nearest to ``near`` chosen: a mirror resolved by other frames."""
    if len(frame.candidates) < 2:
        return frame
    order = sorted(frame.candidates, key=lambda c: float(np.linalg.norm((c.T_sensor_jig.inverse() @ near).log())))
    chosen = order[0]
    rest = tuple(c for c in frame.candidates if c is not chosen)
    return replace(frame, T_sensor_jig=chosen.T_sensor_jig, candidates=(chosen, *rest), cost=chosen.chi2)
