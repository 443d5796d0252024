"""Does a larger model predict better? Each calibrate location is left out in turn and predicted from the others."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from calib.bundle import Mask, Solution, estimated_parameters, solve_bundle
from calib.config import CalibConfig, Model
from calib.engine import Result
from calib.figures import fit_location
from calib.judge.verdict import frames_motion, judge_motion
from geometry import Frame

# benchmarks/calib_model_choice.py: how often each rule keeps the model that predicts better
_OVERFIT = 1.05  # a larger model must not predict worse than this times the smaller one
_WORTH = 0.95  # where the smaller one fits, it must predict better than this
UNCHECKED = (
    "fewer than two locations can be left out: how well points elsewhere are predicted could not be checked; measure "
    "the target at two or more further places"
)
ENTER = (
    "enter T_hand_sensor where the estimated table is used (robot_corrected), and T_hand_sensor_nominal where the "
    "controller keeps its nominal table"
)


def left_out_rms(solution: Solution, used: tuple[Frame, ...], config: CalibConfig, model: Model) -> float | None:
    """Rms distance [mm] of the points from their strings at locations that took no part in the solution.

    used: the solution's frames. Weights and outliers are those of the whole solution, everything
    estimated is solved again without the location. None where fewer than two can be left out, because the rest would
    not suffice.
    """
    squares = []
    for k in range(len(solution.bundle.locations)):
        rest = (solution.bundle.location != k) & ~solution.frame_outlier
        if _enough(tuple(f for f, r in zip(used, rest, strict=True) if r), config):
            squares.append(_predicted(solution, k, estimated_parameters(solution.bundle.hands, model)))
    return float(np.sqrt(np.mean(np.concatenate(squares)))) if len(squares) > 1 else None


def table_advice(scores: Mapping[Model, float | None], asked: Model, *, nominal_fits: bool = False) -> str:
    """Which SCP to enter with which of the robot's tables, and why.

    scores: rms [mm] at locations left out. nominal_fits: whether χ² finds no fault with the nominal robot.
    """
    small, large = scores.get("scp"), scores.get(asked)
    if small is None or large is None:
        return f"{UNCHECKED} ({ENTER})"
    words = (
        f"leaving one location out, its points are predicted to {small:.3f} mm with the robot's nominal table and "
        f"{large:.3f} mm with the estimated one"
    )
    if large > _OVERFIT * small or (nominal_fits and large > _WORTH * small):
        return f"{words}: the nominal table is as good; enter T_hand_sensor_nominal and leave the table as it is"
    return f"{words}: {ENTER}"


def _enough(rest: tuple[Frame, ...], config: CalibConfig) -> bool:
    return bool(rest) and judge_motion(frames_motion(rest), config) is None


def _predicted(solution: Solution, left_out: int, applied: Mask) -> np.ndarray:
    """Squared distances of a location's points, only its place fitted, all else solved from the other locations."""
    bundle = solution.bundle
    state = _without(solution, left_out, applied).state
    own = bundle.at_frames((bundle.location == left_out) & ~solution.frame_outlier)
    sensors = own.hands.pose(state.vector("robot")) @ state.pose("scp")
    start = solution.places[bundle.locations[left_out]]
    distance = fit_location(own.term.points, sensors, own.target, start).distance_mm
    return np.asarray(distance[np.isfinite(distance)] ** 2)


def _without(solution: Solution, left_out: int, applied: Mask) -> Result:
    """The bundle of the other locations, started from the whole solution."""
    bundle, state = solution.bundle, solution.result.state
    others = np.flatnonzero(np.arange(len(bundle.locations)) != left_out)
    rest = bundle.at_frames(bundle.location != left_out)
    start = rest.with_places(state, bundle.places(state)[others])
    if not np.array_equal(applied, solution.applied):
        start = start.with_value("robot", np.zeros(len(applied)))
    return solve_bundle(rest.estimating(applied), start)
