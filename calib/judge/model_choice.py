"""Does a larger model predict better? Each calibrate location is left out in turn and predicted from the others."""

from __future__ import annotations

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
_UNCHECKED = (
    "fewer than two locations can be left out: how well model {model} predicts elsewhere could not be checked; measure "
    "the jig at two or more further places"
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


def choose_model(scores: dict[Model, float | None], asked: Model, *, nominal_fits: bool = False) -> tuple[Model, str]:
    """The model to keep of the one asked for and "scp", and why, in words.

    scores: rms [mm] at locations left out. nominal_fits: whether χ² finds no fault with the nominal robot.
    """
    small, large = scores.get("scp"), scores.get(asked)
    if small is None or large is None:
        return asked, _UNCHECKED.format(model=asked)
    words = f"leaving one location out, its points are predicted to {small:.3f} mm by scp and {large:.3f} mm by {asked}"
    if large > _OVERFIT * small:
        return "scp", f"{words}: {asked} overfits, scp is kept"
    if nominal_fits and large > _WORTH * small:
        return "scp", f"{words}, and χ² finds no fault with the nominal robot: {asked} gains nothing, scp is kept"
    return asked, words


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
