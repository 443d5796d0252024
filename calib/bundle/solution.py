"""One solve of the labelled frames: starts, robust bundle, uncertainty, and what the data say of the answer."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from calib.bundle.bundle import BundleResult, solve_bundle
from calib.bundle.linearise import corrected_robot
from calib.bundle.problem import Problem, pad_points, pose_chain, robot_chain
from calib.bundle.robust import RobustResult, solve_robust
from calib.bundle.starts import chain_start, hand_eye_start
from calib.bundle.uncertainty import Uncertainty, uncertainty
from calib.bundle.weighing import stated_cost, weigh
from calib.config import CalibConfig
from calib.figures import pose_distance
from calib.stations import Station
from geometry import InputError, Pose, RobotModel, stack_poses
from jig_cad import Jig

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

_HAND_SIGMA_MM, _HAND_SIGMA_DEG = 0.3, 0.03  # of poses from an arm's nominal table, until the residuals tell it

_OTHER_MM = 5.0  # poses of the jig that are farther apart are different answers


@dataclass(frozen=True, eq=False)
class Solution:
    """The answer to the used calibrate frames.

    bundle: the solve that answers. applied: robot parameters (P,) that its robot takes over. outlier (F, M),
    frame_outlier (F,): what was left out. Ts_sensor_jig: each frame's own pose, of its candidates the one that agrees
    with the others. chi2_per_dof: of the model's own fit, by the noise of points and joints and the anchors' tolerance.
    explained, nominal: the same with all robot errors free within their priors, and with none. noise: the σ that made
    the weights.
    rival: how much larger the χ² of the next best answer is (other jig poses of the same points); infinite where none.
    """

    problem: Problem
    bundle: BundleResult
    applied: Mask
    outlier: Mask
    frame_outlier: Mask
    uncertainty: Uncertainty
    Ts_sensor_jig: Pose
    dof: int
    chi2_per_dof: float
    explained: float
    nominal: float
    noise: dict[str, float]
    rival: float

    @property
    def T_hand_sensor(self) -> Pose:
        """The solved SCP."""
        return self.bundle.state.T_hand_sensor

    @property
    def outlier_share(self) -> float:
        """Share of the points that the solution left out."""
        out = self.outlier | self.frame_outlier[:, None]
        return float(out[self.problem.points.present].mean())

    @property
    def parameters(self) -> Array:
        """Corrections (P,) of the robot that belong to the answer."""
        return np.where(self.applied, self.bundle.state.parameters, 0.0)

    @property
    def robot(self) -> RobotModel | None:
        """The robot with its corrections."""
        if self.problem.chain.robot is None or not np.any(self.applied):
            return self.problem.chain.robot
        return corrected_robot(self.problem, self.parameters)


def make_problem(used: tuple[Station, ...], jig: Jig, robot: RobotModel | None, config: CalibConfig) -> Problem:
    """The bundle's problem of labelled frames; locations are numbered in the order of their first frame."""
    names = list(dict.fromkeys(s.observation.location for s in used))
    joints = [s.observation.joints_rad for s in used]
    if robot is not None and all(q is not None for q in joints):
        chain = robot_chain(robot, np.array(joints), float(np.deg2rad(config.beta_sigma_deg)))
        inferred = any(s.observation.joints_inferred for s in used)
        chain = replace(chain, inferred=inferred)
        if inferred and config.hand_sigma_mm is not None and config.hand_sigma_deg is not None:
            chain = replace(chain, noise=np.broadcast_to(_hand_noise(config), chain.noise.shape).copy())
    else:
        chain = pose_chain(stack_poses([s.T_base_hand for s in used]), _hand_noise(config))
    location = np.array([names.index(s.observation.location) for s in used], dtype=np.intp)
    anchor_sigma = 0.0 if jig.measured else jig.tolerance_mm / np.sqrt(12)  # uniform within the full width
    points = pad_points([s.axis for s in used], jig)
    return Problem(points, chain, location, len(names), jig.anchors_mm, float(anchor_sigma))


def _hand_noise(config: CalibConfig) -> Array:
    """Covariance (6, 6) of given hand poses, hand axes."""
    mm, deg = config.hand_sigma_mm or _HAND_SIGMA_MM, config.hand_sigma_deg or _HAND_SIGMA_DEG
    return np.diag(np.square([mm] * 3 + [np.deg2rad(deg)] * 3))


def estimated_parameters(problem: Problem, model: str) -> Mask:
    """Which robot parameters (P,) a model estimates; InputError where there is no robot to correct."""
    rows = problem.chain.parameters[:, 0]
    if model == "scp":
        return np.zeros(len(rows), dtype=bool)
    if problem.chain.robot is None or problem.chain.inferred:
        raise InputError(
            f"model {model} corrects the robot's table and needs joint readings j1_deg …, but these frames give hand "
            "poses T_base_hand only: use model scp"
        )
    return np.asarray(rows == 0) if model == "scp+offsets" else np.ones(len(rows), dtype=bool)


def solve_problem(problem: Problem, candidates: Sequence[Pose], T_hand_sensor: Pose, config: CalibConfig) -> Solution:
    """Solve the bundle from the SCP given or, where that fails, from a closed form.

    candidates: poses T_sensor_jig of each frame. Outliers and noise are judged with all robot errors free within their
    priors, so that a misfit of the nominal robot is not taken for either. χ² is by the stated noise of the points.
    """
    applied = estimated_parameters(problem, config.model)
    robust, own = _robust(problem, candidates, T_hand_sensor, config)
    every, removed = robust.bundle, robust.bundle.removed
    if problem.chain.inferred:
        every = solve_bundle(problem, every.state, np.ones_like(applied), removed)
    weighed = weigh(problem, every, config)
    if weighed.changed:
        every = solve_bundle(weighed.problem, every.state, every.free[6:-12], removed)
    model = every if np.all(applied) else _fit_model(weighed.problem, every, applied)
    nominal = _fit_model(weighed.problem, every, np.zeros_like(applied)) if np.any(applied) else model
    dof = 2 * int((~removed).sum()) - 6 - 6 * problem.n_locations
    chi2, explained, alone = (stated_cost(weighed.stated, fit) / max(dof, 1) for fit in (model, every, nominal))
    return Solution(
        weighed.problem,
        model,
        applied,
        robust.outlier,
        robust.frame_outlier,
        uncertainty(model),
        own,
        dof,
        chi2,
        explained,
        alone,
        weighed.noise,
        _rival(problem, candidates, own, robust),
    )


def _rival(problem: Problem, candidates: Sequence[Pose], own: Pose, best: RobustResult) -> float:
    """How much more χ² the answer from the frames' other candidates has, or infinity where there is none."""
    if any(len(c) == 1 for c in candidates):
        return float("inf")
    others = [c[np.flatnonzero(pose_distance(c, own[i : i + 1]) > _OTHER_MM)] for i, c in enumerate(candidates)]
    if any(len(c) == 0 for c in others):
        return float("inf")
    start, _ = chain_start(problem, best.bundle.state.T_hand_sensor, others)
    free = best.bundle.free[6:-12]
    try:
        rival = solve_bundle(problem, start, free, best.bundle.removed, max_iterations=30)
    except np.linalg.LinAlgError:
        return float("inf")
    apart = pose_distance(rival.state.Ts_base_jig, best.bundle.state.Ts_base_jig)
    different = rival.converged and float(np.max(apart)) > _OTHER_MM
    return max(0.0, rival.cost - best.bundle.cost) if different else float("inf")


def _robust(
    problem: Problem, candidates: Sequence[Pose], T_hand_sensor: Pose, config: CalibConfig
) -> tuple[RobustResult, Pose]:
    # of a pose's several joint solutions the wrong one may be taken: its robot errors are then its own, in the gates
    every = np.full(len(problem.chain.parameter_sigma), not problem.chain.inferred)
    start, own = chain_start(problem, T_hand_sensor, candidates)
    robust = solve_robust(problem, start, every, config.outlier_chi2, config.max_outlier_share)
    if not _doubtful(robust):
        return robust, own
    other = hand_eye_start(problem.chain.T_base_hand, own, problem.location)
    if other is None:
        return robust, own
    start, again = chain_start(problem, other, candidates)
    second = solve_robust(problem, start, every, config.outlier_chi2, config.max_outlier_share)
    return (second, again) if _score(second) < _score(robust) else (robust, own)


def _fit_model(problem: Problem, every: BundleResult, applied: Mask) -> BundleResult:
    """The bundle with only the ``applied`` robot parameters as unknowns."""
    none = np.zeros_like(every.state.parameters)
    start = replace(every.state, parameters=none, T_base_hand=problem.chain.T_base_hand)
    return solve_bundle(problem, start, applied, every.removed)


def _doubtful(robust: RobustResult) -> bool:
    return not robust.bundle.converged or bool(np.mean(robust.outlier) > 0.05 or np.any(robust.frame_outlier))


def _score(robust: RobustResult) -> tuple[bool, int, float]:
    out = robust.outlier | robust.frame_outlier[:, None]
    return not robust.bundle.converged, int(out.sum()), robust.bundle.cost
