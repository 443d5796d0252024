"""The answer of calibrate, put together from the solution, the figures and the verdict."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from calib.assemble import Chains, by_location, frame_distances, frame_result, location_figures
from calib.config import CalibConfig
from calib.identifiability import weak_directions
from calib.observation import Observations
from calib.result import CalibrationResult, FrameResult, LocationResult, Verdict
from calib.solution import Solution
from calib.stations import Station
from calib.uncertainty import printed_sigmas
from geometry import RobotModel
from jig_cad import Jig

Array = NDArray[np.float64]


def answer(
    observations: Observations,
    ready: tuple[Station, ...],
    jig: Jig,
    robot: RobotModel | None,
    config: CalibConfig,
    verdict: Verdict,
    solution: Solution | None,
) -> CalibrationResult:
    """Everything that calibrate says; ``solution`` is None where the data were refused."""
    design = observations.T_hand_sensor_design
    solved = None if solution is None else (solution.T_hand_sensor, solution.robot)
    locations, frames = dict[str, LocationResult](), dict[int, FrameResult]()
    for name, group in by_location(observations, ready).items():
        figures = location_figures(group, jig, Chains((design, robot), solved))
        distances = frame_distances(group, figures.fit)
        locations[name] = figures.result
        for s in group:
            number = s.observation.frame
            reason, flags = _marks(s, solution)
            frames[number] = frame_result(s, reason, flags, distances.get(number), figures.own.get(number))
    n = 0 if robot is None else robot.n_joints
    empty = CalibrationResult(
        method=config.method,
        model=config.model,
        verdict=verdict,
        T_hand_sensor_design=design,
        locations=locations,
        frames=tuple(frames[s.observation.frame] for s in ready),
        robot=robot,
        robot_delta=np.zeros((5, n)),
        robot_sigma=np.zeros((5, n)),
    )
    return empty if solution is None else _with_solution(empty, solution)


def _marks(s: Station, solution: Solution | None) -> tuple[str | None, list[str]]:
    """Why a frame does not count, and its points' flags with the outliers of the solution marked."""
    flags = list(s.axis.flag) if s.axis.flag else [""] * len(s.axis)
    if solution is None or s not in solution.stations:
        return s.reason, flags
    i = solution.stations.index(s)
    out = solution.outlier[i]
    flags = ["outlier" if out[k] else f for k, f in enumerate(flags)]
    return ("outlier" if solution.frame_outlier[i] else s.reason), flags


def _with_solution(empty: CalibrationResult, solution: Solution) -> CalibrationResult:
    bundle, found = solution.bundle, solution.uncertainty
    rotation, translation = printed_sigmas(solution.T_hand_sensor, found.scp)
    chain = solution.problem.chain
    delta, sigma = empty.robot_delta.copy(), empty.robot_sigma.copy()
    rows, joints = chain.parameters.T
    posterior = np.sqrt(np.diag(found.covariance))
    delta[rows, joints] = solution.parameters
    sigma[rows, joints] = np.where(solution.applied, posterior[6:-12], chain.parameter_sigma)
    anchors, anchors_sigma = np.zeros((6, 3)), np.zeros((6, 3))
    anchors[:, 1:], anchors_sigma[:, 1:] = bundle.state.anchors, posterior[-12:].reshape(6, 2)
    return replace(
        empty,
        chi2_per_dof=solution.chi2_per_dof,
        T_hand_sensor=solution.T_hand_sensor,
        covariance=found.scp,
        sigma_rotation_deg=rotation,
        sigma_translation_mm=translation,
        robot=solution.robot,
        robot_delta=delta,
        robot_sigma=sigma,
        anchors_delta_mm=anchors,
        anchors_sigma_mm=anchors_sigma,
        converged=bundle.converged,
        iterations=bundle.iterations,
        initial_cost=bundle.initial_cost,
        final_cost=bundle.cost,
        degrees_of_freedom=solution.dof,
        condition=found.condition,
        noise=solution.noise | {"explained_chi2_per_dof": solution.explained},
        weak_directions=weak_directions(solution),
    )
