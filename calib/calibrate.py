"""From observed frames to the sensor centre position: labels, axis points, poses, SCP, verdict."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from calib.answer import answer
from calib.assemble import Chains, by_location, location_figures
from calib.config import CalibConfig
from calib.observation import Observations
from calib.result import CalibrationResult, Verdict
from calib.solution import Solution, solve_stations
from calib.stations import Station, label, stations
from calib.verdict import judge_motion, judge_solution, motion
from geometry import InputError, Pose, RobotModel, stack_poses
from jig_cad import Jig

Array = NDArray[np.float64]


def calibrate(
    observations: Observations, jig: Jig, robot: RobotModel | None, config: CalibConfig | None = None
) -> CalibrationResult:
    """Solve the sensor centre position from all frames with role calibrate; judge it on all locations.

    robot: its nominal table; None where every frame has T_base_hand. Raises InputError where the input can not be used
    at all; data from which no trustworthy answer follows give a result whose verdict says why.
    """
    config = config or CalibConfig()
    if not observations.frames:
        raise InputError("the dataset has no frames")
    design, given = observations.T_hand_sensor_design, observations.T_base_jig
    ready = label(stations(observations, robot), observations.sensor, design, given, jig, config)
    verdict, solution = _solve(ready, jig, robot, design, config)
    for _ in range(config.relabel_rounds if any(s.observation.axis is None for s in ready) else 0):
        if solution is None or not verdict.trustworthy:
            break
        T_base_jig = _jigs(observations, ready, jig, solution) | given
        again = label(
            stations(observations, solution.robot),
            observations.sensor,
            solution.T_hand_sensor,
            T_base_jig,
            jig,
            config,
            refined=True,
        )
        ready = again
        verdict, solution = _solve(ready, jig, robot, solution.T_hand_sensor, config)
    return answer(observations, ready, jig, robot, config, verdict, solution)


def _solve(
    ready: tuple[Station, ...], jig: Jig, robot: RobotModel | None, T_hand_sensor: Pose, config: CalibConfig
) -> tuple[Verdict, Solution | None]:
    """Solve the usable calibrate frames, or say why they can not be."""
    used = tuple(s for s in ready if s.observation.role == "calibrate" and s.usable)
    names = list(dict.fromkeys(s.observation.location for s in used))
    place = np.array([names.index(s.observation.location) for s in used], dtype=np.intp)
    firsts = stack_poses([s.candidates[0] for s in used])
    moved = motion(stack_poses([s.T_base_hand for s in used]), firsts, place)
    verdict = judge_motion(moved, config)
    if verdict is not None:
        return verdict, None
    solution = solve_stations(used, jig, robot, T_hand_sensor, config)
    return judge_solution(solution, moved, config), solution


def _jigs(observations: Observations, ready: tuple[Station, ...], jig: Jig, solution: Solution) -> dict[str, Pose]:
    """Jig poses of all locations by the solved chain."""
    chains = Chains((observations.T_hand_sensor_design, solution.robot), (solution.T_hand_sensor, solution.robot))
    fits = {n: location_figures(g, jig, chains).fit for n, g in by_location(observations, ready).items()}
    return {n: f.T_base_jig for n, f in fits.items() if f is not None} | solution.T_base_jig
