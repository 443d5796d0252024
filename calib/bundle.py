"""The bundle: SCP, a jig pose a location, robot parameters and anchors from the raw axis points of all frames."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from calib.linearise import Linearised, State, linearise, moved, residuals
from calib.normal import Normal, Step, normal_equations, solve, with_prior
from calib.problem import Problem
from calib.weights import frame_covariance, removal, whitener

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

_MAX_DAMPING = 1e10


@dataclass(frozen=True, eq=False)
class BundleResult:
    """Where the iteration ended. ``lin`` and ``normal`` stand at the solution, all robot parameters' columns included.

    cost: squared whitened residuals with the priors of what is estimated, joint noise in the weights.
    free: which common unknowns were estimated. prior_sigma: of the common unknowns, infinite where there is none.
    """

    state: State
    lin: Linearised
    normal: Normal
    free: Mask
    prior_sigma: Array
    removed: Mask
    initial_cost: float
    cost: float
    iterations: int
    converged: bool


def solve_bundle(
    problem: Problem,
    start: State,
    estimated: Mask,
    removed: Mask | None = None,
    max_iterations: int = 60,
    tolerance: float = 1e-6,
) -> BundleResult:
    """Levenberg-Marquardt over the bundle's unknowns.

    estimated: which robot parameters (P,) are unknowns under their prior; the others stay at their nominal value.
    removed: points (F, M) that do not count. tolerance: stop when a step is shorter than this many σ of its unknowns.
    """
    removed = ~problem.points.present if removed is None else removed
    sigma, free = _priors(problem, estimated)
    state, damping, initial, cost = start, 0.0, np.nan, np.inf
    iterations, converged = 0, False
    while iterations < max_iterations and not converged:
        iterations += 1
        lin = linearise(problem, state)
        white = whitener(frame_covariance(problem, lin, removal(removed), problem.chain.noise))
        cost = _cost(lin.residual, white, state, sigma)
        initial = cost if iterations == 1 else initial
        normal = with_prior(normal_equations(problem, lin, white), np.where(free, sigma, 0.0), _values(state))
        state, damping, step = _advance(problem, state, normal, free, sigma, white, cost, damping)
        converged = step.decrement < tolerance**2
        if damping >= _MAX_DAMPING:
            break
    return _result(problem, state, free, sigma, removed, float(initial), iterations, converged)


def _advance(
    problem: Problem,
    state: State,
    normal: Normal,
    free: Mask,
    sigma: Array,
    white: Array,
    cost: float,
    damping: float,
) -> tuple[State, float, Step]:
    """The first damped step that lowers the cost, at weights held fixed."""
    while True:
        step = solve(normal, free, damping)
        trial = _moved(problem, state, step)
        trial_cost = _cost(residuals(problem, trial), white, trial, sigma)
        if trial_cost <= cost * (1 + 1e-12) + 1e-18 or step.decrement < 1e-16:
            return trial, 0.0 if damping < 1e-6 else damping / 10, step
        damping = max(10 * damping, 1e-4)
        if damping >= _MAX_DAMPING:
            return state, damping, step


def _moved(problem: Problem, state: State, step: Step) -> State:
    return moved(problem, state, step.common[:6], step.jigs, step.common[6:-12], step.common[-12:])


def _values(state: State) -> Array:
    return np.concatenate([np.zeros(6), state.parameters, state.anchors.ravel()])


def _cost(residual: Array, white: Array, state: State, sigma: Array) -> float:
    r = white @ residual.reshape(*white.shape[:2], 1)
    prior = _values(state) / np.where(sigma > 0, sigma, 1.0)
    return float(np.vdot(r, r) + prior @ prior)


def _priors(problem: Problem, estimated: Mask) -> tuple[Array, Mask]:
    """Prior σ (C,) of the common unknowns and which are free."""
    anchors = np.full(12, problem.anchor_sigma_mm)
    sigma = np.concatenate([np.full(6, np.inf), problem.chain.parameter_sigma, anchors])
    free = np.concatenate([np.ones(6, dtype=bool), estimated, anchors > 0])
    return sigma, free


def _result(
    problem: Problem,
    state: State,
    free: Mask,
    sigma: Array,
    removed: Mask,
    initial: float,
    iterations: int,
    converged: bool,
) -> BundleResult:
    lin = linearise(problem, state)
    white = whitener(frame_covariance(problem, lin, removal(removed), problem.chain.noise))
    normal = with_prior(normal_equations(problem, lin, white), np.where(free, sigma, 0.0), _values(state))
    cost = _cost(lin.residual, white, state, sigma)
    return BundleResult(state, lin, normal, free, sigma, removed, initial, cost, iterations, converged)
