"""The bundle: SCP, a jig pose a location, robot parameters and anchors from the raw axis points of all frames."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from calib.bundle.linearise import Linearised, State, linearise, moved, residuals
from calib.bundle.normal import Normal, Step, normal_equations, solve, with_prior
from calib.bundle.problem import Problem
from calib.bundle.weights import frame_covariance, removal, whitener

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

_MAX_DAMPING = 1e10
_ROUNDING = 1e-16  # a decrement below this changes the cost by less than its last digits


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
    tolerance: float = 1e-5,
) -> BundleResult:
    """Levenberg-Marquardt over the bundle's unknowns.

    estimated: which robot parameters (P,) are unknowns under their prior; the others stay at their nominal value.
    removed: points (F, M) that do not count. tolerance: stop when a step is shorter than this many σ of its unknowns.
    """
    removed = ~problem.points.present if removed is None else removed
    sigma, free = _priors(problem, estimated)
    here = _Point(problem, start, sigma, free, removed)
    damping, initial, iterations, converged = 0.0, here.cost, 0, False
    while iterations < max_iterations and not converged and damping < _MAX_DAMPING:
        iterations += 1
        state, damping, step = _advance(problem, here, damping)
        try:
            here = _Point(problem, state, sigma, free, removed)
        except np.linalg.LinAlgError:  # the strings lie in the sheet: no place to go on from
            break
        converged = step.decrement < tolerance**2
    normal = here.normal_equations(None)
    return BundleResult(here.state, here.lin, normal, free, sigma, removed, initial, here.cost, iterations, converged)


class _Point:
    """The linearised, weighted problem at one state."""

    def __init__(self, problem: Problem, state: State, sigma: Array, free: Mask, removed: Mask) -> None:
        self.problem, self.state, self.sigma, self.free = problem, state, sigma, free
        self.lin = linearise(problem, state)
        self.white = whitener(frame_covariance(problem, self.lin, removal(removed), problem.chain.noise))
        self.cost = _cost(self.lin.residual, self.white, state, sigma)
        self.normal = self.normal_equations(free[6:-12])

    def normal_equations(self, robot: Mask | None) -> Normal:
        """The normal equations with the columns of ``robot``'s parameters, all where None."""
        prior = np.where(self.free, self.sigma, 0.0)
        return with_prior(normal_equations(self.problem, self.lin, self.white, robot), prior, _values(self.state))


def _advance(problem: Problem, here: _Point, damping: float) -> tuple[State, float, Step]:
    """The first damped step that lowers the cost, at weights held fixed; the same state where none does."""
    while True:
        step = solve(here.normal, here.free, damping)
        trial = _moved(problem, here.state, step)
        cost = _cost(residuals(problem, trial), here.white, trial, here.sigma)
        if cost <= here.cost * (1 + 1e-12) + 1e-18 or step.decrement < _ROUNDING:
            return trial, 0.0 if damping < 1e-6 else damping / 10, step
        damping = max(10 * damping, 1e-4)
        if damping >= _MAX_DAMPING:
            return here.state, damping, step


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
