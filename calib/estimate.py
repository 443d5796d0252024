"""The bundle's solution as an estimate."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from calib.answer import Estimate
from calib.bundle.solution import Solution
from calib.config import CalibConfig
from calib.judge.identifiability import weak_directions
from calib.judge.verdict import Facts
from calib.stations import Station


def bundle_estimate(solution: Solution, used: tuple[Station, ...], config: CalibConfig) -> Estimate:
    """What the bundle says of SCP, robot, anchors, and the ``used`` frames and their points."""
    bundle, found, chain = solution.bundle, solution.uncertainty, solution.problem.chain
    n = 0 if chain.robot is None else chain.robot.n_joints
    delta, sigma = np.zeros((5, n)), np.zeros((5, n))
    rows, joints = chain.parameters.T
    posterior = np.sqrt(np.diag(found.covariance))
    delta[rows, joints] = solution.parameters
    sigma[rows, joints] = np.where(solution.applied, posterior[6:-12], chain.parameter_sigma)
    anchors, anchors_sigma = np.zeros((6, 3)), np.zeros((6, 3))
    anchors[:, 1:], anchors_sigma[:, 1:] = bundle.state.anchors, posterior[-12:].reshape(6, 2)
    numbers = [s.observation.frame for s in used]
    floor = hand_floor(config) if chain.robot is None else np.zeros((6, 6))
    return Estimate(
        T_hand_sensor=solution.T_hand_sensor,
        covariance=found.scp + floor,
        robot=solution.robot,
        robot_delta=delta,
        robot_sigma=sigma,
        chi2_per_dof=solution.chi2_per_dof,
        degrees_of_freedom=solution.dof,
        converged=bundle.converged,
        iterations=bundle.iterations,
        initial_cost=bundle.initial_cost,
        final_cost=bundle.cost,
        condition=found.condition,
        noise=solution.noise | {"explained_chi2_per_dof": solution.explained},
        reasons={k: "outlier" for k, out in zip(numbers, solution.frame_outlier, strict=True) if out},
        outliers={k: out for k, out in zip(numbers, solution.outlier, strict=True) if np.any(out)},
        anchors_delta_mm=anchors,
        anchors_sigma_mm=anchors_sigma,
        weak_directions=weak_directions(solution),
    )


def hand_floor(config: CalibConfig) -> NDArray[np.float64]:
    """Covariance (6, 6) of ξ from systematic errors of hand poses whose joints are not known."""
    sigma = [config.hand_floor_mm] * 3 + [np.deg2rad(config.hand_floor_deg)] * 3
    return np.diag(np.square(sigma))


def bundle_facts(solution: Solution, used: tuple[Station, ...], refused: tuple[Station, ...]) -> Facts:
    """What the bundle is judged by; ``refused`` are calibrate frames whose given labels no jig pose explains."""
    out = (solution.outlier | solution.frame_outlier[:, None])[solution.problem.points.present]
    contradicted = int(out.sum()) + sum(len(s.axis) for s in refused)
    return Facts(
        solution.bundle.converged,
        solution.bundle.iterations,
        solution.chi2_per_dof,
        solution.explained,
        solution.dof,
        solution.uncertainty.condition,
        solution.uncertainty.noise_covariance[:6, :6],
        contradicted / max(len(out) + sum(len(s.axis) for s in refused), 1),
        _outlying_strings(solution, used),
        solution.rival,
        solution.problem.n_locations,
    )


def _outlying_strings(solution: Solution, used: tuple[Station, ...]) -> tuple[str, ...]:
    """Strings whose points are outliers in more than half of their frames, of which there are three or more."""
    counts: dict[str, list[bool]] = {}
    for s, out in zip(used, solution.outlier, strict=True):
        for label, o in zip(s.axis.label, out, strict=False):
            counts.setdefault(label, []).append(bool(o))
    return tuple(k for k, v in counts.items() if sum(v) > max(len(v) / 2, 2))
