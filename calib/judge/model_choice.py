"""Does a larger model predict better? Each calibrate location is left out in turn and predicted from the others."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from calib.bundle.bundle import BundleResult, solve_bundle
from calib.bundle.linearise import State, corrected_robot
from calib.bundle.problem import at_frames
from calib.bundle.solution import Mask, Solution, estimated_parameters
from calib.config import CalibConfig, Model
from calib.figures import fit_location
from calib.judge.verdict import judge_motion, motion
from calib.stations import Station
from geometry import stack_poses

_OVERFIT = 1.05  # a larger model must not predict worse than this times the smaller one
_WORTH = 0.95  # where the smaller one fits, it must predict better than this
_UNCHECKED = (
    "fewer than two locations can be left out: how well model {model} predicts elsewhere could not be checked; measure "
    "the jig at two or more further places"
)


def left_out_rms(solution: Solution, used: tuple[Station, ...], config: CalibConfig, model: Model) -> float | None:
    """Rms distance [mm] of the points from their strings at locations that took no part in the solution.

    used: the stations of the solution's frames. Weights and outliers are those of the whole solution, everything
    estimated is solved again without the location. None where fewer than two can be left out, because the rest would
    not suffice.
    """
    squares = []
    for k in range(solution.problem.n_locations):
        rest = (solution.problem.location != k) & ~solution.frame_outlier
        if _enough(tuple(s for s, r in zip(used, rest, strict=True) if r), config):
            squares.append(_predicted(solution, k, estimated_parameters(solution.problem, model)))
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


def _enough(rest: tuple[Station, ...], config: CalibConfig) -> bool:
    if not rest:
        return False
    names = list(dict.fromkeys(s.observation.location for s in rest))
    place = np.array([names.index(s.observation.location) for s in rest], dtype=np.intp)
    firsts = stack_poses([s.candidates[0] for s in rest])
    return judge_motion(motion(stack_poses([s.T_base_hand for s in rest]), firsts, place), config) is None


def _predicted(solution: Solution, left_out: int, applied: Mask) -> np.ndarray:
    """Squared distances of a location's points, only its jig pose fitted, all else solved from the other locations."""
    problem = solution.problem
    fit = _without(solution, left_out, applied)
    own = at_frames(problem, (problem.location == left_out) & ~solution.frame_outlier)
    hands, parameters, joints = own.chain.T_base_hand, fit.state.parameters, own.chain.joints_rad
    if np.any(parameters) and joints is not None:
        hands = corrected_robot(problem, parameters).pose(joints)
    start = solution.bundle.state.Ts_base_jig[left_out]
    distance = fit_location(own.points, hands @ fit.state.T_hand_sensor, problem.anchors_mm, start).distance_mm
    return np.asarray(distance[np.isfinite(distance)] ** 2)


def _without(solution: Solution, left_out: int, applied: Mask) -> BundleResult:
    """The bundle of the other locations, started from the whole solution."""
    problem, state = solution.problem, solution.bundle.state
    rest = problem.location != left_out
    others = np.flatnonzero(np.arange(problem.n_locations) != left_out)
    same = np.array_equal(applied, solution.applied)
    nominal = replace(state, parameters=np.zeros_like(state.parameters), T_base_hand=problem.chain.T_base_hand)
    start: State = state if same else nominal
    start = replace(start, Ts_base_jig=state.Ts_base_jig[others], T_base_hand=start.T_base_hand[np.flatnonzero(rest)])
    return solve_bundle(at_frames(problem, rest), start, applied, solution.bundle.removed[rest])
