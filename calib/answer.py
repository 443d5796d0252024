"""The answer of calibrate: figures by location, points by frame, the verdict and the estimate."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from calib.config import CalibConfig
from calib.figures import Fit, agreeing_pose, distances, fit_location, max_deviation, spread_3d
from calib.hands import chain_poses
from calib.pose import own_poses
from calib.result import CalibrationResult, DesignSolved, Distances, Estimate, LocationResult, Verdict
from calib.surface import described, own_centres
from geometry import Frame, Pose, Robot, Role, SheetPoints, Surface, Target, locations_of, stack_poses, target_at
from jig_cad import Sphere, Wedge

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
    design: Pose | None,
    config: CalibConfig,
    verdict: Verdict,
    estimate: Estimate | None,
) -> CalibrationResult:
    """Everything that calibrate says; ``estimate`` is None where the data were refused."""
    solved = None if estimate is None else (estimate.T_hand_sensor, estimate.robot)
    locations, done = dict[str, LocationResult](), dict[int, Frame]()
    holds = CalibrationResult("", "", verdict, design, {}, (), robot, estimate).trusted is not None
    for name, group in locations_of(frames).items():
        by_design = None if design is None else (design, robot)
        result, answered = figured(group, target_at(target, name), by_design, solved, estimate)
        result = result if holds else replace(result, T_base_target=None)
        if estimate is not None and estimate.nominal is not None:
            nominal = (estimate.nominal.T_hand_sensor, robot)
            result = _with_nominal(result, figured(group, target_at(target, name), nominal, nominal, estimate)[0])
        locations[name] = result
        done |= {f.number: f for f in answered}
    ordered = tuple(done[f.number] for f in frames)
    return CalibrationResult(config.method, config.model, verdict, design, locations, ordered, robot, estimate)


def figured(
    group: Sequence[Frame],
    target: Target,
    design: Chain | None,
    solved: Chain | None,
    estimate: Estimate | None = None,
) -> tuple[LocationResult, list[Frame]]:
    """A location's figures, none where too few of its frames are used, and the frames with what became of them."""
    own = target if estimate is None else estimate.targets.get(group[0].location, target)
    kept = [f for f in group if estimate is None or f.number not in estimate.reasons]
    if isinstance(own, Surface):
        figures = surface_figures(group[0].role, kept, _like(own, estimate), design, solved)
    else:
        figures = location_figures(group[0].role, kept, own, design, solved)
    answered = _answered(group, figures, _distances(group, figures.fit, own, solved or design), estimate)
    enough = sum(f.used for f in answered) >= LEAST_FRAMES
    return figures.result if enough else _without_figures(figures.result), answered


def location_figures(
    role: Role, group: Sequence[Frame], target: Target, design: Chain | None, solved: Chain | None
) -> Figures:
    """All figures of one location from its labelled frames."""
    usable = measured(group)
    chain = solved or design
    if not usable or chain is None:
        return Figures(LocationResult(role, None, _NONE, _NONE, _NONE, _NO_DISTANCES), None, {})
    points = SheetPoints.of([f.axis for f in usable], target.features)
    sensors = _sensors(usable, chain)
    fit = fit_location(points, sensors, target, _start(usable, sensors))
    by_design = None if design is None else _sensors(usable, design)
    design_fit = None if by_design is None else fit_location(points, by_design, target, _start(usable, by_design))
    own = own_poses(target, usable, sensors.inverse() @ fit.T_base_target)
    complete = [i for i, f in enumerate(usable) if set(f.axis.label) == set(target.features) and f.number in own]
    own_stack = stack_poses([own[usable[i].number] for i in complete])
    origins = np.zeros((0, 3)) if by_design is None else (by_design[complete] @ own_stack).t
    solved_origins = np.zeros((0, 3)) if solved is None else (sensors[complete] @ own_stack).t
    length, solved_length = (np.linalg.norm(o, axis=-1) for o in (origins, solved_origins))
    numbers = tuple(usable[i].number for i in complete)
    result = LocationResult(
        role,
        fit.T_base_target if solved else None,
        DesignSolved(max_deviation(length), max_deviation(solved_length)),
        DesignSolved(spread_3d(origins), spread_3d(solved_origins)),
        DesignSolved(design_fit.rms_mm if design_fit else None, fit.rms_mm if solved else None),
        Distances(numbers, length if by_design is not None else np.full(len(numbers), np.nan), solved_length),
    )
    return Figures(result, fit, own)


def _with_nominal(result: LocationResult, by_nominal: LocationResult) -> LocationResult:
    """The figures with those of the nominal chain, which stand as solved in ``by_nominal``."""
    names = ("max_deviation_mm", "spread_3d_mm", "point_rms_mm")
    both = {n: replace(getattr(result, n), nominal=getattr(by_nominal, n).solved) for n in names}
    return replace(result, **both)


def surface_figures(
    role: Role, group: Sequence[Frame], target: Surface, design: Chain | None, solved: Chain | None
) -> Figures:
    """All figures of one location of a surface; max deviation and spread are of each frame's own centre of a ball."""
    usable = measured(group)
    n_points = sum(max(f.n_points, len(f.axis)) for f in group)
    chain = solved or design
    if not usable or chain is None:
        none = LocationResult(role, None, _NONE, _NONE, _NONE, _NO_DISTANCES)
        return Figures(replace(none, n_points=n_points), None, {})
    by_design = None if design is None else _surface_fit(usable, target, design)
    by_solved = None if solved is None else _surface_fit(usable, target, solved)
    if by_design is None and by_solved is None:
        none = LocationResult(role, None, _NONE, _NONE, _NONE, _NO_DISTANCES)
        return Figures(replace(none, n_points=n_points, n_found=sum(len(f.axis) for f in usable)), None, {})
    fit = by_solved or by_design
    kept, length, origins = _centres(usable, target, design, by_design)
    solved_kept, solved_length, solved_origins = _centres(usable, target, solved, by_solved)
    numbers = tuple(usable[i].number for i in (solved_kept if solved else kept))
    both = length if len(length) == len(numbers) else np.full(len(numbers), np.nan)
    result = LocationResult(
        role,
        by_solved.T_base_target if by_solved else None,
        DesignSolved(max_deviation(length), max_deviation(solved_length)),
        DesignSolved(spread_3d(origins), spread_3d(solved_origins)),
        DesignSolved(by_design.rms_mm if by_design else None, by_solved.rms_mm if by_solved else None),
        Distances(numbers, both, solved_length),
        None if by_solved is None else described(target, by_solved.T_base_target, _sensors(usable, chain).t),
        n_points,
        sum(len(f.axis) for f in usable),
        len(usable) - len(numbers) if isinstance(target, Sphere) else 0,
    )
    return Figures(result, fit, {})


def _surface_fit(usable: Sequence[Frame], target: Surface, chain: Chain) -> Fit | None:
    """The surface fitted to a location's points by a chain, None where nothing tells where it stands."""
    sensors = _sensors(usable, chain)
    points = SheetPoints.of([f.axis for f in usable], target.features)
    seen = points.present
    start = target.place((sensors @ points.xyz_mm)[seen], points.feature[seen])
    if start is None and any(not len(f.candidates) for f in usable):
        return None
    return fit_location(points, sensors, target, _start(usable, sensors) if start is None else start)


def _centres(
    usable: Sequence[Frame], target: Surface, chain: Chain | None, fit: Fit | None
) -> tuple[list[int], Array, Array]:
    """Which frames tell a ball's centre of their own, its distance from the base, and the centre (N, 3)."""
    if chain is None or fit is None or not isinstance(target, Sphere):
        return [], np.zeros(0), np.zeros((0, 3))
    centres, tells = own_centres(target, usable, _sensors(usable, chain), fit.T_base_target)
    return [int(i) for i in np.flatnonzero(tells)], np.linalg.norm(centres[tells], axis=1), centres[tells]


def _like(target: Surface, estimate: Estimate | None) -> Surface:
    """The same ball or wedge as one that was solved, at a location that was not."""
    for solved in () if estimate is None else estimate.targets.values():
        if isinstance(solved, type(target)) and isinstance(solved, Sphere | Wedge) and target.shape.labels:
            unknown = not np.all(np.isfinite(target.shape.sigma))
            return solved if unknown else target
    return target


def location_pose(group: Sequence[Frame], target: Target, chain: Chain) -> Pose | None:
    """T_base_target fitted to all frames of a location by a chain, None where none is usable."""
    usable = measured(group)
    if not usable:
        return None
    if isinstance(target, Surface):
        found = _surface_fit(usable, target, chain)
        return None if found is None else found.T_base_target
    sensors = _sensors(usable, chain)
    points = SheetPoints.of([f.axis for f in usable], target.features)
    return fit_location(points, sensors, target, _start(usable, sensors)).T_base_target


def measured(group: Sequence[Frame]) -> list[Frame]:
    """The frames that have labelled points and nothing against them."""
    return [f for f in group if f.usable and len(f.axis)]


def _distances(group: Sequence[Frame], fit: Fit | None, target: Target, chain: Chain | None) -> dict[int, Array]:
    """How far each frame's points lie from the target where the location's used frames have it, by frame's number."""
    usable = measured(group)
    if fit is None or chain is None or not usable:
        return {}
    points = SheetPoints.of([f.axis for f in usable], target.features)
    far = distances(points, _sensors(usable, chain), target, fit.T_base_target)
    return {f.number: far[i, : len(f.axis)] for i, f in enumerate(usable)}


def _answered(
    group: Sequence[Frame], figures: Figures, far: Mapping[int, Array], estimate: Estimate | None
) -> list[Frame]:
    """The frames with what became of them: reason, flags of outliers, distances of points, own poses."""
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
                residual_mm=far.get(f.number, np.full(len(f.axis), np.nan)),
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
