"""Which noise makes the weights: what was stated, unless the residuals contradict it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from calib.bundle.bundle import BundleResult
from calib.bundle.linearise import linearise
from calib.bundle.noise import Variances, contradiction, deviance, estimate_noise, with_noise
from calib.bundle.problem import Problem
from calib.bundle.weights import frame_covariance, removal, whitener
from calib.config import CalibConfig

Array = NDArray[np.float64]

_CONTRADICTION = 13.8  # deviance gained by two variances; 0.1 % by chance
_POINT_BOUNDS = (0.5, 2.5)  # factors of a variance beyond which the model, not the noise, is wrong
_JOINT_BOUNDS = (0.01, 9.0)
_OWN_START = 0.1  # share of the robot's variance that is a frame's own, where its search starts
_MAX_CHI2 = 10.0  # per degree of freedom; beyond this something else than the noise is wrong
_MIN_FREEDOM = 40  # fewer degrees of freedom say too little of a variance


@dataclass(frozen=True, eq=False)
class Weighed:
    """The problem with the noise that makes the weights, and with the noise by which χ² is formed.

    stated: the points' own covariances; the joints' noise as stated or, where smaller, as found. noise: the σ, by name.
    """

    problem: Problem
    stated: Problem
    changed: bool
    noise: dict[str, float]


def weigh(problem: Problem, result: BundleResult, config: CalibConfig) -> Weighed:
    """Keep the noise stated, or estimate the factors of the points' and the joints' variances from the residuals."""
    if problem.chain.robot is None:
        return _weigh_poses(problem, result, config)
    if problem.chain.inferred:
        return _weigh_inferred(problem, result, config)
    factors = np.ones(2)
    hand = problem.chain.noise
    freedom = 2 * int((~result.removed).sum()) - 6 - 6 * problem.n_locations
    sane = result.converged and result.cost < _MAX_CHI2 * freedom
    if config.noise == "auto" and freedom >= _MIN_FREEDOM and np.any(hand) and sane:
        variances = Variances((hand,), np.ones(2), np.ones(2, dtype=bool))
        if contradiction(problem, result, variances) > _CONTRADICTION / 2:
            found = estimate_noise(problem, result, variances)
            found = np.clip(found, *np.transpose([_POINT_BOUNDS, _JOINT_BOUNDS]))
            gain = deviance(problem, result) - deviance(with_noise(problem, found[0], found[1] * hand), result)
            factors = found if gain > _CONTRADICTION else factors
    joint = np.rad2deg(problem.chain.robot.uncertainty.joint_sigma_rad)
    noise = {
        "joint_sigma_deg": float(joint * np.sqrt(factors[1])),
        "joint_sigma_stated_deg": float(joint),
        "point_sigma_factor": float(np.sqrt(factors[0])),
        "anchor_sigma_mm": problem.anchor_sigma_mm,
    }
    changed = bool(np.any(factors != 1))
    stated = with_noise(problem, 1.0, min(1.0, factors[1]) * hand)
    return Weighed(with_noise(problem, factors[0], factors[1] * hand), stated, changed, noise)


def stated_cost(stated: Problem, fit: BundleResult) -> float:
    """Cost of a fit by the noise stated."""
    lin = linearise(stated, fit.state)
    white = whitener(frame_covariance(stated, lin, removal(fit.removed), stated.chain.noise))
    r = white @ lin.residual.reshape(*white.shape[:2], 1)
    values = np.concatenate([np.zeros(6), fit.state.parameters, fit.state.anchors.ravel()])
    prior = np.where(fit.prior_sigma > 0, values / np.where(fit.prior_sigma > 0, fit.prior_sigma, 1.0), 0.0)
    return float(np.vdot(r, r) + prior @ prior)


def _weigh_inferred(problem: Problem, result: BundleResult, config: CalibConfig) -> Weighed:
    """Joints inferred from poses: what of the robot's errors is a frame's own, its joints being another solution's.

    Kept at nothing, with the joints' noise as stated, unless the residuals contradict it.
    """
    hand, robot = problem.chain.noise, problem.chain.robot
    columns = result.lin.parameters * problem.chain.parameter_sigma
    own = columns @ np.swapaxes(columns, -1, -2)
    factors = np.array([1.0, 0.0])
    given = config.noise == "given" or (config.hand_sigma_mm is not None and config.hand_sigma_deg is not None)
    if not given and result.converged:
        variances = Variances((hand, own), np.array([1.0, 1.0, _OWN_START]), np.array([False, True, True]))
        found = np.clip(estimate_noise(problem, result, variances)[1:], *np.transpose([_JOINT_BOUNDS, (0.0, 1.0)]))
        noise = with_noise(problem, 1.0, found[0] * hand + found[1] * own)
        gain = deviance(problem, result) - deviance(noise, result)
        factors = found if gain > _CONTRADICTION else factors
    joint = 0.0 if robot is None else np.rad2deg(robot.uncertainty.joint_sigma_rad)
    noise_words = {
        "joint_sigma_deg": float(joint * np.sqrt(factors[0])),
        "joint_sigma_stated_deg": float(joint),
        "own_robot_error_share": float(factors[1]),
        "anchor_sigma_mm": problem.anchor_sigma_mm,
    }
    used = with_noise(problem, 1.0, factors[0] * hand + factors[1] * own)
    stated = with_noise(problem, 1.0, min(1.0, factors[0]) * hand + factors[1] * own)
    return Weighed(used, stated, bool(np.any(factors != [1.0, 0.0])), noise_words)


def _weigh_poses(problem: Problem, result: BundleResult, config: CalibConfig) -> Weighed:
    """Hand poses alone: their noise, where it was not given, as one σ of translation and one of rotation."""
    sigma = np.sqrt(np.diagonal(problem.chain.noise[0]))[[0, 3]]
    given = config.hand_sigma_mm is not None and config.hand_sigma_deg is not None
    if not given:
        parts = [np.diag([1.0] * 3 + [0.0] * 3), np.diag([0.0] * 3 + [1.0] * 3)]
        components = tuple(np.broadcast_to(p, problem.chain.noise.shape) for p in parts)
        start = Variances(components, np.array([1.0, *sigma**2]), np.array([False, True, True]))
        sigma = np.sqrt(estimate_noise(problem, result, start)[1:])
    noise = {
        "hand_sigma_mm": float(sigma[0]),
        "hand_sigma_deg": float(np.rad2deg(sigma[1])),
        "anchor_sigma_mm": problem.anchor_sigma_mm,
    }
    hand = np.broadcast_to(np.diag(np.repeat(sigma, 3) ** 2), problem.chain.noise.shape).copy()
    used = with_noise(problem, 1.0, hand)
    return Weighed(used, used, not given, noise)
