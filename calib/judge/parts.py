"""What the others say of a part of the data: locations left out in turn, or frames where there is one location."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from calib.bundle import Mask, Solution, estimated_parameters, given_noise, reweighed, scaled, solve_bundle
from calib.config import CalibConfig, Model
from calib.engine import Result, covariance
from calib.figures import OffsetsFromTarget, fit_location
from calib.judge.verdict import frames_motion, judge_motion
from calib.result import LeftOut, LeftOutPart
from geometry import Frame, Pose, SheetPoints, State, Surface, Target

Array = NDArray[np.float64]

_OPEN_MM = 20.0  # σ at 300 mm from noise alone: the rest does not tell the SCP, as of planes of two orientations
_LEVER_MM = 300.0
_LEAST_PARTS = 2


def left_out(
    solution: Solution, used: tuple[Frame, ...], raw: Mapping[int, Frame], config: CalibConfig, model: Model
) -> LeftOut | None:
    """Points predicted by a solution of which they were no part.

    By location: SCP and robot from the others, the location's place fitted to its own frames. Where fewer than two
    locations can be left out, by frame: nothing is fitted to the frame. Outliers are those of the whole solution, and
    weights; of hand poses alone the noise is found anew. None where neither is possible.

    Parameters
    ----------
    solution
        Of all of them.
    used
        The solution's frames, in its order.
    raw
        By number the same frames with all of their points.
    config
        Of calibration.
    model
        What is estimated of the robot.
    """
    applied = estimated_parameters(solution.bundle.hands, model)
    count = len(solution.bundle.locations)
    by_location = [_location(solution, used, raw, config, applied, k) for k in range(count)] if count > 1 else []
    parts = [p for p in by_location if p is not None]
    if len(parts) >= _LEAST_PARTS:
        return _together("location", parts)
    frames = [i for i in range(len(used)) if not solution.frame_outlier[i]]
    by_frame = [_frame(solution, used, raw, config, applied, i) for i in frames] if count == 1 else []
    parts = [p for p in by_frame if p is not None]
    return _together("frame", parts) if len(parts) >= _LEAST_PARTS else None


def _together(by: str, parts: list[tuple[LeftOutPart, Array]]) -> LeftOut:
    squares = np.concatenate([s for _, s in parts])
    return LeftOut(by, float(np.sqrt(np.mean(squares))), tuple(p for p, _ in parts))


def _location(
    solution: Solution,
    used: tuple[Frame, ...],
    raw: Mapping[int, Frame],
    config: CalibConfig,
    applied: Mask,
    k: int,
) -> tuple[LeftOutPart, Array] | None:
    bundle = solution.bundle
    result = _without(solution, used, config, applied, bundle.location != k)
    if result is None:
        return None
    state, name = result.state, bundle.locations[k]
    mine = (bundle.location == k) & ~solution.frame_outlier
    target, points, sensors = _points(solution, used, raw, state, mine)
    start = solution.places[name]
    if isinstance(target, Surface):
        seen = points.present
        start = target.place((sensors @ points.xyz_mm)[seen], points.feature[seen]) or start
    distance = fit_location(points, sensors, target, start).distance_mm
    return _part(name, solution, state, distance[np.isfinite(distance)] ** 2)


def _frame(
    solution: Solution,
    used: tuple[Frame, ...],
    raw: Mapping[int, Frame],
    config: CalibConfig,
    applied: Mask,
    i: int,
) -> tuple[LeftOutPart, Array] | None:
    every = np.arange(len(used))
    result = _without(solution, used, config, applied, every != i)
    if result is None:
        return None
    state = result.state
    target, points, sensors = _points(solution, used, raw, state, every == i)
    place = state.pose(solution.bundle.terms[0].place_block)[0]
    seen = points.present
    term = OffsetsFromTarget((sensors @ points.xyz_mm)[seen], points.feature[seen], target)
    squares = np.sum(term.residual(State({"target": place})) ** 2, axis=-1)
    return _part(str(used[i].number), solution, state, squares)


def _part(name: str, solution: Solution, state: State, squares: Array) -> tuple[LeftOutPart, Array]:
    xi = (solution.T_hand_sensor.inverse() @ state.pose("scp")).log()
    return LeftOutPart(name, float(np.sqrt(np.mean(squares))), xi), squares


def _points(
    solution: Solution, used: tuple[Frame, ...], raw: Mapping[int, Frame], state: State, mine: Mask
) -> tuple[Target, SheetPoints, Pose]:
    """The target of some frames of one location, all of their points that count, and Ts_base_sensor."""
    bundle = solution.bundle
    own = bundle.at_frames(mine)
    term = own.term
    frames = [raw[f.number] for f, m in zip(used, mine, strict=True) if m]
    points = SheetPoints.of([f.axis for f in frames], term.target.features)
    if points.present.shape == solution.outlier[mine].shape:  # not condensed: points that were taken out stay out
        points = replace(points, present=points.present & ~solution.outlier[mine])
    target: Target = term.target
    if isinstance(target, Surface):
        target = target.shaped(state.vector(next(t.shape_block for t in bundle.terms if t.target is term.target)))
    return target, points, own.hands.pose(state.vector("robot")) @ state.pose("scp")


def _without(
    solution: Solution, used: tuple[Frame, ...], config: CalibConfig, applied: Mask, kept: Mask
) -> Result | None:
    """The bundle of the ``kept`` frames, started from the whole solution; None where they do not suffice."""
    bundle, state = solution.bundle, solution.result.state
    rest = tuple(f for f, k, out in zip(used, kept, solution.frame_outlier, strict=True) if k and not out)
    if not rest or judge_motion(frames_motion(rest), config) is not None:
        return None
    smaller = bundle.at_frames(kept)
    start = smaller.with_places(state, bundle.places(state)[[bundle.locations.index(n) for n in smaller.locations]])
    if not np.array_equal(applied, solution.applied):
        start = start.with_value("robot", np.zeros(len(applied)))
    try:
        found = solve_bundle(smaller.estimating(applied), start)
        if smaller.hands.poses_only and not given_noise(config):  # it was found from the frame left out, too
            found = solve_bundle(reweighed(smaller, found).estimating(applied), found.state)
    except np.linalg.LinAlgError:
        return None
    open_mm = np.sqrt(np.linalg.eigvalsh(scaled(covariance(found).noise_of("scp"), _LEVER_MM))[-1])
    if not open_mm < _OPEN_MM:
        return None
    lost = {
        b: state.vector(b) for b in bundle.shape_blocks if b not in smaller.shape_blocks
    }  # of what stood there alone
    return replace(found, state=State({**found.state.values, **lost}))
