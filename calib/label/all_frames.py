"""Frames labelled, location by location: axis points and the poses that explain them, or a reason why not."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import singledispatch

import numpy as np

from calib.config import CalibConfig
from calib.label.frame import label_frame
from calib.label.location import label_location
from calib.pose import fit_pose
from geometry import (
    NO_POSES,
    AxisPoints,
    Frame,
    NoAnswerError,
    Pose,
    Sensor,
    Target,
    locations_of,
    log_so3,
    stack_poses,
)
from jig_cad import Jig

MIN_STRINGS = 3
NEAR_MM, NEAR_RAD = 5.0, float(np.deg2rad(1.0))  # the surface offset needs the pose to a degree


def label_frames(
    frames: Sequence[Frame],
    target: Target,
    sensor: Sensor,
    T_hand_sensor: Pose,
    places: Mapping[str, Pose],
    config: CalibConfig,
    refined: bool = False,
) -> tuple[Frame, ...]:
    """Label all frames that nothing speaks against.

    places: T_base_target by location, where known. refined: SCP and places were solved for, so that gates may be
    narrow.
    """
    out = {f.number: f for f in frames}
    for name, group in locations_of(tuple(f for f in frames if f.reason is None)).items():
        place = places.get(name)
        out |= {f.number: with_candidates(target, f, _guess(f, T_hand_sensor, place)) for f in group if f.labels_given}
        open_ones = [f for f in group if not f.labels_given]
        if open_ones:
            labelled = label_group(target, open_ones, sensor, T_hand_sensor, place, config, refined)
            out |= {f.number: f for f in labelled}
    return tuple(out[f.number] for f in frames)


def label_alone(frames: Sequence[Frame], jig: Jig, sensor: Sensor, config: CalibConfig) -> tuple[Frame, ...]:
    """Each frame labelled by itself, with no guess of its pose: five strings are needed, mirrors stay."""
    out = []
    for f in frames:
        if f.labels_given:
            out.append(with_candidates(jig, f, None))
            continue
        found = label_frame(f.points, jig, sensor, None, config)
        poses = [c.T_sensor_jig for c in found.candidates]
        out.append(replace(f, axis=found.axis, candidates=stack_poses(poses), reason=found.reason))
    return tuple(out)


@singledispatch
def label_group(
    target: Target,
    frames: Sequence[Frame],
    sensor: Sensor,
    T_hand_sensor: Pose,
    place: Pose | None,
    config: CalibConfig,
    refined: bool,
) -> list[Frame]:
    """The frames of one location labelled; of a target with one feature all points lie on that, without an offset."""
    out = []
    for f in frames:
        axis, p, n = f.axis, f.points, len(f.points)
        if not len(axis):
            axis = AxisPoints(target.features[:1] * n, np.arange(n), p.yz_mm, p.cov_yz_mm2, p.flag)
        out.append(with_candidates(target, replace(f, axis=axis), _guess(f, T_hand_sensor, place)))
    return out


@label_group.register
def _(
    target: Jig,
    frames: Sequence[Frame],
    sensor: Sensor,
    T_hand_sensor: Pose,
    place: Pose | None,
    config: CalibConfig,
    refined: bool,
) -> list[Frame]:
    hands = stack_poses([f.at for f in frames])
    spots = [f.points for f in frames]
    found = label_location(spots, hands, T_hand_sensor, target, sensor, config, place, refined)
    out = []
    for f, labelled in zip(frames, found, strict=True):
        poses = [c.T_sensor_jig for c in labelled.candidates]
        if not poses and labelled.T_sensor_jig is not None:
            poses = [labelled.T_sensor_jig]
        reason = labelled.reason or (None if poses else "not_labelled")
        out.append(replace(f, axis=labelled.axis, candidates=stack_poses(poses), reason=reason))
    return out


@singledispatch
def with_candidates(target: Target, f: Frame, guess: Pose | None) -> Frame:
    """A frame with labelled points and the poses that explain them; one that no pose explains is left out.

    A single curve hardly ever tells a surface's pose: by default the guess is the one candidate.
    """
    if len(f.axis) == 0 or guess is None:
        return replace(f, reason="not_labelled" if len(f.axis) else "no_target" if f.n_points else "no_spots")
    return replace(f, candidates=stack_poses([guess]), reason=None)


@with_candidates.register
def _(target: Jig, f: Frame, guess: Pose | None) -> Frame:
    if len(set(f.axis.label)) < MIN_STRINGS:
        return replace(f, candidates=NO_POSES, reason="too_few_spots" if len(f.axis) else "no_spots")
    try:
        found = fit_pose(f.axis, target)
    except NoAnswerError:
        return replace(f, candidates=NO_POSES, reason="not_labelled")
    return replace(f, candidates=stack_poses([c.T_sensor_jig for c in found.candidates]), reason=None)


def stays(f: Frame, predicted: Pose) -> bool:
    """Whether a labelled frame has no point far from its string, and its pose is near the chain's: labels are right."""
    if not f.usable or "pose_residual" in f.axis.flag:
        return False
    apart = predicted.inverse() @ f.candidates[0]
    turn = float(np.linalg.norm(log_so3(apart.R)))
    return bool(np.linalg.norm(apart.t) < NEAR_MM and turn < NEAR_RAD)


def _guess(f: Frame, T_hand_sensor: Pose, place: Pose | None) -> Pose | None:
    return None if place is None else (f.at @ T_hand_sensor).inverse() @ place
