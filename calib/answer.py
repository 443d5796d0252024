"""The answer of calibrate: figures by location, points by frame, the verdict and the estimate."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from calib.config import CalibConfig
from calib.figures import Fit, agreeing_pose, fit_location, max_deviation, spread_3d
from calib.hands import chain_poses
from calib.pose import own_poses
from calib.result import CalibrationResult, DesignSolved, Distances, Estimate, LocationResult, Verdict
from geometry import Frame, Pose, Robot, SheetPoints, Target, locations_of, stack_poses, target_at

Array = NDArray[np.float64]
Chain = tuple[Pose, Robot | None]  # an SCP and the robot that carries it

_NONE = DesignSolved(None, None)
LEAST_FRAMES = 3  # of a location's figures: one frame fits itself, two agree in all that its pose leaves open
_NO_DISTANCES = Distances((), np.zeros(0), np.zeros(0))


@dataclass(frozen=True, eq=False)
class Figures:
    """A location's result, with the fit by the solved chain (or by design where there is none) and own poses."""

    result: LocationResult
    fit: Fit | None
    own: Mapping[int, Pose]


def answer(
    frames: tuple[Frame, ...],
    target: Target | Mapping[str, Target],
    robot: Robot | None,
    design: Pose,
    config: CalibConfig,
    verdict: Verdict,
    estimate: Estimate | None,
) -> CalibrationResult:
    """Everything that calibrate says; ``estimate`` is None where the data were refused."""
    solved = None if estimate is None else (estimate.T_hand_sensor, estimate.robot)
    locations, done = dict[str, LocationResult](), dict[int, Frame]()
    holds = CalibrationResult("", "", verdict, design, {}, (), robot, estimate).trusted is not None
    for name, group in locations_of(frames).items():
        result, answered = figured(group, target_at(target, name), (design, robot), solved, estimate)
        locations[name] = result if holds else replace(result, T_base_target=None)
        done |= {f.number: f for f in answered}
    ordered = tuple(done[f.number] for f in frames)
    return CalibrationResult(config.method, config.model, verdict, design, locations, ordered, robot, estimate)


def figured(
    group: Sequence[Frame], target: Target, design: Chain, solved: Chain | None, estimate: Estimate | None = None
) -> tuple[LocationResult, list[Frame]]:
    """A location's figures, none where too few of its frames are used, and the frames with what became of them."""
    figures = location_figures(group, target, design, solved)
    answered = _answered(group, figures, estimate)
    enough = sum(f.used for f in answered) >= LEAST_FRAMES
    return figures.result if enough else _without_figures(figures.result), answered


def location_figures(group: Sequence[Frame], target: Target, design: Chain, solved: Chain | None) -> Figures:
    """All figures of one location from its labelled frames."""
    role = group[0].role
    usable = measured(group)
    if not usable:
        return Figures(LocationResult(role, None, _NONE, _NONE, _NONE, _NO_DISTANCES), None, {})
    points = SheetPoints.of([f.axis for f in usable], target.features)
    by_design = _sensors(usable, design)
    sensors = by_design if solved is None else _sensors(usable, solved)
    fit = fit_location(points, sensors, target, _start(usable, sensors))
    design_fit = fit_location(points, by_design, target, _start(usable, by_design))
    own = own_poses(target, usable, sensors.inverse() @ fit.T_base_target)
    complete = [i for i, f in enumerate(usable) if set(f.axis.label) == set(target.features) and f.number in own]
    own_stack = stack_poses([own[usable[i].number] for i in complete])
    origins = (by_design[complete] @ own_stack).t
    solved_origins = np.zeros((0, 3)) if solved is None else (sensors[complete] @ own_stack).t
    length, solved_length = (np.linalg.norm(o, axis=-1) for o in (origins, solved_origins))
    result = LocationResult(
        role,
        fit.T_base_target if solved else None,
        DesignSolved(max_deviation(length), max_deviation(solved_length)),
        DesignSolved(spread_3d(origins), spread_3d(solved_origins)),
        DesignSolved(design_fit.rms_mm, fit.rms_mm if solved else None),
        Distances(tuple(usable[i].number for i in complete), length, solved_length),
    )
    return Figures(result, fit, own)


def location_pose(group: Sequence[Frame], target: Target, chain: Chain) -> Pose | None:
    """T_base_target fitted to all frames of a location by a chain, None where none is usable."""
    usable = measured(group)
    if not usable:
        return None
    sensors = _sensors(usable, chain)
    points = SheetPoints.of([f.axis for f in usable], target.features)
    return fit_location(points, sensors, target, _start(usable, sensors)).T_base_target


def measured(group: Sequence[Frame]) -> list[Frame]:
    """The frames that have labelled points and nothing against them."""
    return [f for f in group if f.usable and len(f.axis)]


def _answered(group: Sequence[Frame], figures: Figures, estimate: Estimate | None) -> list[Frame]:
    """The frames with what became of them: reason, flags of outliers, distances of points, own poses."""
    distances = {}
    if figures.fit is not None:
        distances = {f.number: figures.fit.distance_mm[i, : len(f.axis)] for i, f in enumerate(measured(group))}
    out = []
    for f in group:
        flag = f.axis.flag or ("",) * len(f.axis)
        reason = f.reason
        if estimate is not None:
            outlying = estimate.outliers.get(f.number)
            if outlying is not None:
                flag = tuple("outlier" if outlying[k] else one for k, one in enumerate(flag))
            reason = reason or estimate.reasons.get(f.number)
        out.append(
            replace(
                f,
                axis=replace(f.axis, flag=flag),
                reason=reason,
                used=reason is None,
                residual_mm=distances.get(f.number, np.full(len(f.axis), np.nan)),
                T_sensor_target=figures.own.get(f.number),
            )
        )
    return out


def _without_figures(result: LocationResult) -> LocationResult:
    """Where the target stands alone, of a location with too few used frames to judge by."""
    return LocationResult(result.role, result.T_base_target, _NONE, _NONE, _NONE, _NO_DISTANCES)


def _start(usable: Sequence[Frame], sensors: Pose) -> Pose:
    """Where most frames have the target."""
    return agreeing_pose([sensors[i] @ f.candidates for i, f in enumerate(usable)])[0]


def _sensors(usable: Sequence[Frame], chain: Chain) -> Pose:
    """Ts_base_sensor of frames by a chain."""
    T_hand_sensor, robot = chain
    return chain_poses(usable, robot) @ T_hand_sensor
