"""The result of a calibration from its solution: figures by location, points by frame."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from calib.bundle.problem import pad_points
from calib.figures import Fit, agreeing_pose, fit_location, max_deviation, spread_3d
from calib.observation import Observations
from calib.pose.own import own_poses
from calib.result import DesignSolved, Distances, FramePoints, FrameResult, LocationResult
from calib.stations import Station
from geometry import Pose, RobotModel, stack_poses
from jig_cad import Jig

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Chains:
    """Two chains to judge: (SCP, robot) by design and as solved; ``solved`` is None where there is no answer."""

    design: tuple[Pose, RobotModel | None]
    solved: tuple[Pose, RobotModel | None] | None


@dataclass(frozen=True, eq=False)
class LocationFigures:
    """A location's result, with the fit by the solved chain (or by design where there is none) and own poses."""

    result: LocationResult
    fit: Fit | None
    own: dict[int, Pose]


def location_figures(group: Sequence[Station], jig: Jig, chains: Chains) -> LocationFigures:
    """All figures of one location from its labelled frames."""
    role = group[0].observation.role
    usable = [s for s in group if s.usable and len(s.axis)]
    if not usable:
        none = DesignSolved(None, None)
        empty = Distances((), np.zeros(0), np.zeros(0))
        return LocationFigures(LocationResult(role, None, none, none, none, empty), None, {})
    design_sensors = _sensors(usable, chains.design)
    solved_sensors = _sensors(usable, chains.solved) if chains.solved else None
    sensors = solved_sensors if solved_sensors is not None else design_sensors
    points = pad_points([s.axis for s in usable], jig)
    start, _ = agreeing_pose([sensors[i] @ s.candidates for i, s in enumerate(usable)])
    fit = fit_location(points, sensors, jig.anchors_mm, start)
    design_start, _ = agreeing_pose([design_sensors[i] @ s.candidates for i, s in enumerate(usable)])
    design_fit = fit_location(points, design_sensors, jig.anchors_mm, design_start)
    own = own_poses(usable, jig, sensors.inverse() @ fit.T_base_jig)
    complete = [i for i, s in enumerate(usable) if set(s.axis.label) == set(jig.strings)]
    own_stack = stack_poses([own[usable[i].observation.frame] for i in complete])
    origins = (design_sensors[complete] @ own_stack).t
    solved_origins = (solved_sensors[complete] @ own_stack).t if solved_sensors is not None else np.zeros((0, 3))
    length, solved_length = (np.linalg.norm(o, axis=-1) for o in (origins, solved_origins))
    result = LocationResult(
        role,
        fit.T_base_jig if chains.solved else None,
        DesignSolved(max_deviation(length), max_deviation(solved_length)),
        DesignSolved(spread_3d(origins), spread_3d(solved_origins)),
        DesignSolved(design_fit.rms_mm, fit.rms_mm if chains.solved else None),
        Distances(tuple(usable[i].observation.frame for i in complete), length, solved_length),
    )
    return LocationFigures(result, fit, own)


def location_pose(group: Sequence[Station], jig: Jig, chain: tuple[Pose, RobotModel | None]) -> Pose | None:
    """T_base_jig fitted to all frames of a location by a chain, None where none is usable."""
    usable = [s for s in group if s.usable and len(s.axis)]
    if not usable:
        return None
    sensors = _sensors(usable, chain)
    start, _ = agreeing_pose([sensors[i] @ s.candidates for i, s in enumerate(usable)])
    return fit_location(pad_points([s.axis for s in usable], jig), sensors, jig.anchors_mm, start).T_base_jig


def frame_result(
    s: Station, reason: str | None, flags: Sequence[str], distance_mm: Array | None, own: Pose | None
) -> FrameResult:
    """One frame's result; ``reason`` is why its points did not count, flags and distances are of its points."""
    n, o = len(s.axis), s.observation
    uv = np.full((n, 2), np.nan)
    given = s.axis.spot >= 0
    if len(o.points):
        uv[given] = o.points.uv_px[s.axis.spot[given]]
    sigma = np.sqrt(np.diagonal(s.axis.cov_yz_mm2, axis1=-2, axis2=-1))
    residual = np.full(n, np.nan) if distance_mm is None else distance_mm
    points = FramePoints(s.axis.label, uv, s.axis.yz_mm, sigma, residual, tuple(flags))
    return FrameResult(o.frame, o.location, o.role, reason is None, reason, points, o.image, own)


def frame_distances(group: Sequence[Station], fit: Fit | None) -> dict[int, Array]:
    """Distances (N,) of the points of each usable frame of a location."""
    if fit is None:
        return {}
    usable = [s for s in group if s.usable and len(s.axis)]
    return {s.observation.frame: fit.distance_mm[i, : len(s.axis)] for i, s in enumerate(usable)}


def by_location(observations: Observations, ready: Sequence[Station]) -> dict[str, list[Station]]:
    """The frames of every location."""
    return {n: [s for s in ready if s.observation.location == n] for n in observations.locations}


def _sensors(usable: Sequence[Station], chain: tuple[Pose, RobotModel | None]) -> Pose:
    """Ts_base_sensor of frames by a chain."""
    T_hand_sensor, robot = chain
    hands = stack_poses([s.T_base_hand for s in usable])
    read = {i: q for i, s in enumerate(usable) if (q := s.observation.joints_rad) is not None}
    if robot is not None and read:
        moved = robot.pose(np.array(list(read.values())))
        hands.R[list(read)], hands.t[list(read)] = moved.R, moved.t
    return hands @ T_hand_sensor
