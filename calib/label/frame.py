"""Which spot is which string: labels from the jig's geometry, among clutter."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from calib.config import CalibConfig
from calib.label.any_lines import Assignments, any_labels, first_images
from calib.label.evidence import SAME_NATS, Hypotheses, Prior, Spots, weigh
from calib.label.faces import face_pairs, five_spot_labels
from calib.label.gates import DETECTED, gated_labels
from calib.label.refine import FULL, LabelledFrame, refine_labels, turned_over, upright_turn
from calib.label.surface_offset import rough_offset
from calib.pose import MIN_STRINGS
from geometry import Pose, Sensor, SurfacePoints, skew, stack_poses
from geometry.ties import ascending
from jig_cad import Jig

IntArray = NDArray[np.intp]

# benchmarks/calib_labelling.py counts the labels that these let through and the frames that they cost
ANY_HYPOTHESES = 240  # of any lines: ranked by a coarse grid of planes, so that more have to be solved
HYPOTHESES = 60  # solved in full; the true labelling is among the first few
MIN_EVIDENCE = 9.0  # nats over "all clutter"
MARGIN = 7.0  # nats over any other labelling: 1 in 1,100
FULL_MARGIN = 5.0  # nats over another pose's labelling where five strings or more agree with the true offsets
RIVALS = 15.0  # nats within which another pose's labelling is refined too: its χ² was coarse
STRING_NATS = 10.0  # about what one string's spot adds to the evidence
SAME_POSE_MM = 3.0  # rms of the anchors; a mirror pose is ten times farther
TIGHT_MM = 4.0  # σ of a prior's position below which its gates alone find every labelling
CUT_MM = 0.25  # σ of a spot cut short by an occluder, for a second, more doubtful round
OFFSET_SPREAD = 0.5  # radii: how much the lit surface's offset differs between strings of unknown direction


def label_frame(
    points: SurfacePoints,
    jig: Jig,
    sensor: Sensor,
    T_sensor_jig_guess: Pose | None,
    config: CalibConfig,
) -> LabelledFrame:
    """Label one frame's spots.

    With a guess of the pose (wrong by several mm and a few degrees) three or four strings suffice; without, five are
    needed, and of the poses that the jig's symmetries join the one with x_jig · x_sensor > 0 is chosen.
    """
    if T_sensor_jig_guess is not None:
        return label_spots(points, jig, sensor, guess_prior(T_sensor_jig_guess, jig, config), config)
    frame = label_spots(points, jig, sensor, None, config)
    turn = upright_turn([frame.T_sensor_jig], jig)
    return frame if turn is None else turned_over(frame, turn, points, jig, sensor, config)


def guess_prior(guess: Pose, jig: Jig, config: CalibConfig) -> Prior:
    """A guess with the σ of the configuration, which are meant at the jig's middle."""
    c = jig.anchors_mm.mean(0)
    sigma = np.repeat([config.labelling.guess_sigma_mm, np.deg2rad(config.labelling.guess_sigma_deg)], 3)
    to_origin = np.block([[np.eye(3), skew(c)], [np.zeros((3, 3)), np.eye(3)]])
    return Prior(guess, to_origin @ np.diag(sigma**2) @ to_origin.T)


def label_spots(
    points: SurfacePoints, jig: Jig, sensor: Sensor, prior: Prior | None, config: CalibConfig
) -> LabelledFrame:
    """Label one frame's spots with a prior of any covariance, or none."""
    if len(points) == 0:
        return LabelledFrame(reason="no_spots")
    if len(points) < (5 if prior is None else 3):
        return LabelledFrame(reason="too_few_spots")
    for doubt_mm in (0.0, CUT_MM):
        found = _hypotheses(points, jig, sensor, prior, config, doubt_mm)
        frame = None if found is None else _choose(points, found, jig, sensor, prior, config)
        if frame is not None:
            return frame
    return LabelledFrame(reason="not_labelled")


def _choose(
    points: SurfacePoints,
    found: Hypotheses,
    jig: Jig,
    sensor: Sensor,
    prior: Prior | None,
    config: CalibConfig,
) -> LabelledFrame | None:
    """The best labelling, judged with the true surface offsets; None where none is sure."""
    refined: list[tuple[float, LabelledFrame | None]] = []
    for i, labels in _rivals(found, jig):
        if np.sum(labels >= 0) < MIN_STRINGS:  # too contested for an answer, too likely to be passed over
            refined.append((float(found.log_evidence[i]), None))
            continue
        own = prior is None and np.array_equal(labels, found.labels[i])
        starts = found.minima[i] if own else None
        frame = refine_labels(points, labels, found.T_sensor_jig[i], prior, jig, sensor, config, starts)
        if frame is not None and frame.T_sensor_jig is not None:
            lost = np.sum(found.labels[i] >= 0) - sum(f != "pose_residual" for f in frame.axis.flag)
            exact = frame.cost + (0.0 if prior is None else prior.chi2(frame.T_sensor_jig))
            change = 0.5 * (found.chi2[i] - exact) - STRING_NATS * float(lost)
            refined.append((float(found.log_evidence[i]) + change, frame))
    refined = [refined[i] for i in ascending([-nats for nats, _ in refined], SAME_NATS)]
    if not refined or (best := refined[0][1]) is None:
        return None
    margin = FULL_MARGIN if len(best.axis) >= FULL else MARGIN
    return best if len(refined) == 1 or refined[0][0] > refined[1][0] + margin else None


def _hypotheses(
    points: SurfacePoints, jig: Jig, sensor: Sensor, prior: Prior | None, config: CalibConfig, doubt_mm: float
) -> Hypotheses | None:
    spots = _spots(points, jig, sensor, prior, config, doubt_mm)
    limits = config.labelling
    tilt = np.deg2rad(limits.max_tilt_deg)
    tolerance = 4 * np.sqrt(float(np.median(np.trace(spots.cov_mm2, axis1=1, axis2=2))) / 2)
    tight = prior is not None and np.trace(prior.covariance[:3, :3]) < TIGHT_MM**2
    labels, near = np.zeros((0, len(jig.strings)), dtype=np.intp), None
    if not tight and face_pairs(jig):
        sides = [five_spot_labels(spots.yz_mm, jig, o, tolerance, tilt, HYPOTHESES) for o in _orientations(jig, prior)]
        labels = np.concatenate(sides)
    elif not tight:
        assigned = any_labels(spots.yz_mm, spots.log_odds, jig, tolerance, tilt, ANY_HYPOTHESES)
        assigned = first_images(assigned, jig) if prior is None else assigned
        labels, near = assigned.labels, assigned.T_sensor_jig
    if prior is not None:
        more = gated_labels(spots.yz_mm, spots.cov_mm2, jig, prior.T_sensor_jig, prior.covariance, spots.density, 400)
        labels = np.unique(np.concatenate([labels, more[:HYPOTHESES]]), axis=0)
    if len(labels) == 0:
        return None
    found = weigh(labels, spots, jig, prior, tilt, near if prior is None else None)
    if prior is None and len(found) and len(jig.strings) > 5:
        found = _complete(found, spots, jig, tilt)
    return found


def _orientations(jig: Jig, prior: Prior | None) -> tuple[float, ...]:
    """The signs of x_jig · x_sensor to be tried: of poses that a symmetry joins the one by convention."""
    if prior is not None:
        return (float(np.sign(prior.T_sensor_jig.R[0, 0])),)
    return (1.0,) if any(s.pose.R[0, 0] < 0 for s in jig.symmetries) else (1.0, -1.0)


def _complete(found: Hypotheses, spots: Spots, jig: Jig, tilt: float) -> Hypotheses:
    """Further strings of the jig, sought where the poses of the five-spot labellings put them."""
    labels, near = [found.labels], [found.T_sensor_jig]
    for i in range(min(len(found), 5)):
        T, covariance = found.T_sensor_jig[i], found.covariance[i]
        more = gated_labels(spots.yz_mm, spots.cov_mm2, jig, T, covariance, spots.density, 50)
        labels.append(more)
        near.append(stack_poses([T] * len(more)))
    stacked = np.concatenate(labels)
    enough = np.sum(stacked >= 0, axis=1) >= 5
    if face_pairs(jig):
        return weigh(np.unique(stacked[enough], axis=0), spots, jig, None, tilt)
    poses = Pose(np.concatenate([T.R for T in near])[enough], np.concatenate([T.t for T in near])[enough])
    each = first_images(Assignments(stacked[enough], poses), jig)
    return weigh(each.labels, spots, jig, None, tilt, each.T_sensor_jig)


def _spots(
    points: SurfacePoints, jig: Jig, sensor: Sensor, prior: Prior | None, config: CalibConfig, doubt_mm: float
) -> Spots:
    """The spots less a mean surface offset, with everything that a labelling does not know yet in their covariance."""
    n = min(len(points), config.labelling.max_candidates)
    along = np.array([1.0, 0.0, 0.0]) if prior is None else prior.T_sensor_jig.R @ jig.axis
    radius = jig.string_diameter_mm / 2
    offset = rough_offset(points.yz_mm[:n], along, radius, sensor)
    extra = config.labelling.floor_mm**2 + (OFFSET_SPREAD * radius) ** 2 + jig.anchor_sigma_mm**2 + doubt_mm**2
    cov = points.cov_yz_mm2[:n] + extra * np.eye(2)
    odds = 0.5 * np.log((points.score[:n] + 0.05) / (1.05 - points.score[:n]))
    width, depth = np.ptp(points.yz_mm[:n], axis=0)
    area = max(width, jig.side_mm) * max(depth, jig.side_mm)
    return Spots(points.yz_mm[:n] - offset, cov, odds, max(n, 5) / area)


def _rivals(found: Hypotheses, jig: Jig) -> list[tuple[int, IntArray]]:
    """Labellings (S,) that are about as good as the best, one a pose, each less what others of its pose contest."""
    nothing = len(jig.strings) * np.log(1 - DETECTED)
    if len(found) == 0 or found.log_evidence[0] - nothing < MIN_EVIDENCE:
        return []
    near = np.flatnonzero(found.log_evidence >= found.log_evidence[0] - MARGIN - RIVALS)
    anchors = found.T_sensor_jig[near] @ np.broadcast_to(jig.anchors_mm, (len(near), *jig.anchors_mm.shape))
    out: list[tuple[int, IntArray]] = []
    for i in near:
        mine = found.labels[i]
        for k, labels in out:
            part = bool(np.all((mine == found.labels[k]) | (mine < 0)))  # says nothing that k does not say
            if part or np.sqrt(np.mean(np.sum((anchors[i] - anchors[k]) ** 2, -1))) < SAME_POSE_MM:
                if found.log_evidence[i] >= found.log_evidence[k] - MARGIN:
                    labels[mine != found.labels[k]] = -1
                break
        else:
            out.append((int(i), mine.copy()))
    return out
