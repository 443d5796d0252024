"""Does a larger model predict better? Each calibrate location is left out in turn and predicted from the others."""

from __future__ import annotations

import numpy as np

from calib.config import CalibConfig, Model
from calib.figures import agreeing_pose, fit_location
from calib.problem import pad_points
from calib.solution import Solution, make_problem, solve_problem
from calib.stations import Station
from calib.verdict import judge_motion, motion
from geometry import Pose, RobotModel, stack_poses
from jig_cad import Jig

_OVERFIT = 1.05  # a larger model must not predict worse than this times the smaller one


def left_out_rms(
    used: tuple[Station, ...],
    jig: Jig,
    robot: RobotModel | None,
    T_hand_sensor: Pose,
    config: CalibConfig,
    model: Model,
) -> float | None:
    """Rms distance [mm] of the points from their strings at locations that took no part in the solution.

    None where fewer than two locations can be left out, because the rest would not suffice.
    """
    squares, count = [], 0
    chosen = config.model_copy(update={"model": model})
    for name in dict.fromkeys(s.observation.location for s in used):
        rest = tuple(s for s in used if s.observation.location != name)
        own = [s for s in used if s.observation.location == name]
        if not _enough(rest, config):
            continue
        problem = make_problem(rest, jig, robot, chosen)
        solution = solve_problem(problem, [s.candidates for s in rest], T_hand_sensor, chosen)
        squares.append(_predict(own, jig, solution))
        count += 1
    return float(np.sqrt(np.mean(np.concatenate(squares)))) if count > 1 else None


def choose_model(scores: dict[Model, float | None], asked: Model) -> tuple[Model, str]:
    """The model to keep of the one asked for and "scp", and why, in words."""
    small, large = scores.get("scp"), scores.get(asked)
    if small is None or large is None:
        return asked, "too few locations to leave one out: the choice of the model could not be checked"
    words = f"leaving one location out, its points are predicted to {small:.3f} mm by scp and {large:.3f} mm by {asked}"
    if large > _OVERFIT * small:
        return "scp", f"{words}: {asked} overfits, scp is kept"
    return asked, words


def _enough(rest: tuple[Station, ...], config: CalibConfig) -> bool:
    if not rest:
        return False
    names = list(dict.fromkeys(s.observation.location for s in rest))
    place = np.array([names.index(s.observation.location) for s in rest], dtype=np.intp)
    firsts = stack_poses([s.candidates[0] for s in rest])
    return judge_motion(motion(stack_poses([s.T_base_hand for s in rest]), firsts, place), config) is None


def _predict(own: list[Station], jig: Jig, solution: Solution) -> np.ndarray:
    """Squared distances of a location's points with only its jig pose fitted."""
    robot = solution.robot
    hands = [
        s.T_base_hand
        if s.observation.joints_rad is None or robot is None
        else robot.hand_pose(s.observation.joints_rad)
        for s in own
    ]
    sensors = stack_poses(hands) @ solution.T_hand_sensor
    start, _ = agreeing_pose([sensors[i] @ s.candidates for i, s in enumerate(own)])
    fit = fit_location(pad_points([s.axis for s in own]), sensors, jig.anchors_mm, start)
    distance = fit.distance_mm[np.isfinite(fit.distance_mm)]
    return np.asarray(distance**2)
