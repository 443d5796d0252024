"""The bundle's solution as an estimate, and the facts that its verdict rests on."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from calib.bundle import Solution
from calib.config import CalibConfig
from calib.judge.identifiability import weak_directions
from calib.judge.verdict import Facts
from calib.result import Estimate
from geometry import Frame


def bundle_estimate(solution: Solution, used: tuple[Frame, ...], config: CalibConfig) -> Estimate:
    """What the bundle says of SCP, robot, shape, and the ``used`` frames and their points."""
    result, found = solution.result, solution.covariance
    numbers = [f.number for f in used]
    floor = hand_floor(config) if solution.bundle.hands.poses_only else np.zeros((6, 6))
    return Estimate(
        T_hand_sensor=solution.T_hand_sensor,
        covariance=found.of("scp") + floor,
        robot=solution.robot,
        robot_delta=solution.parameters,
        robot_sigma=found.sigma("robot"),
        shape_delta=np.concatenate([result.state.vector(b) for b in solution.bundle.shape_blocks]),
        shape_sigma=np.concatenate([found.sigma(b) for b in solution.bundle.shape_blocks]),
        chi2_per_dof=solution.chi2_per_dof,
        degrees_of_freedom=solution.dof,
        converged=result.converged,
        iterations=result.iterations,
        initial_cost=result.initial_cost,
        final_cost=result.cost,
        condition=solution.condition,
        noise=solution.noise | {"explained_chi2_per_dof": solution.explained},
        reasons={k: "outlier" for k, out in zip(numbers, solution.frame_outlier, strict=True) if out},
        outliers={k: out for k, out in zip(numbers, solution.outlier, strict=True) if np.any(out)},
        weak_directions=weak_directions(solution),
    )


def hand_floor(config: CalibConfig) -> NDArray[np.float64]:
    """Covariance (6, 6) of ξ from systematic errors of hand poses whose joints are not known."""
    sigma = [config.hand_floor_mm] * 3 + [np.deg2rad(config.hand_floor_deg)] * 3
    return np.diag(np.square(sigma))


def bundle_facts(solution: Solution, used: tuple[Frame, ...], refused: tuple[Frame, ...]) -> Facts:
    """What the bundle is judged by; ``refused`` are calibrate frames whose given labels no pose explains."""
    out = (solution.outlier | solution.frame_outlier[:, None])[solution.bundle.present]
    lost = sum(len(f.axis) for f in refused)
    return Facts(
        converged=solution.result.converged,
        iterations=solution.result.iterations,
        chi2_per_dof=solution.chi2_per_dof,
        explained=solution.explained,
        dof=solution.dof,
        condition=solution.condition,
        noise_covariance=solution.covariance.noise_of("scp"),
        outlier_share=(int(out.sum()) + lost) / max(len(out) + lost, 1),
        outlying_strings=_outlying_features(solution, used),
        rival=solution.rival,
        locations=len(solution.bundle.locations),
    )


def _outlying_features(solution: Solution, used: tuple[Frame, ...]) -> tuple[str, ...]:
    """Strings whose points are outliers in more than half of their frames, of which there are three or more."""
    counts: dict[str, list[bool]] = {}
    for f, out in zip(used, solution.outlier, strict=True):
        for label, o in zip(f.axis.label, out, strict=False):
            counts.setdefault(label, []).append(bool(o))
    return tuple(k for k, v in counts.items() if sum(v) > max(len(v) / 2, 2))
