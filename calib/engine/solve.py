"""Levenberg-Marquardt over named blocks: the sum of all terms' squared whitened residuals and of the priors."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from calib.engine.normal import Normal, departure, normal_step, total_normal, whitener
from geometry import Linearised, State, Term, Unknowns

Array = NDArray[np.float64]
Loss = Callable[[Array], Array]  # weights (G,) of a term's groups by their whitened lengths (G,)

_MAX_DAMPING = 1e10  # a step so short that rounding decides
_CHI3_MEDIAN = 1.538  # median of the length of three standard normal numbers


@dataclass(frozen=True, eq=False)
class Result:
    """Where the iteration ended.

    Parameters
    ----------
    unknowns, state
        What was asked and its values.
    linearised : tuple of Linearised
        One a term, at the solution, by all blocks whether estimated or not.
    whites : tuple of ndarray (G, r, r)
        What whitened them, robust weights included.
    normal : Normal
        The normal equations there, columns of considered unknowns included.
    weights : tuple of ndarray (G,)
        Robust weights, 1 where a group is trusted.
    initial_cost, cost : float
        Squared whitened residuals with the priors of what is estimated.
    iterations : int
    converged : bool
    """

    unknowns: Unknowns
    state: State
    linearised: tuple[Linearised, ...]
    whites: tuple[Array, ...]
    normal: Normal
    weights: tuple[Array, ...]
    initial_cost: float
    cost: float
    iterations: int
    converged: bool


def cauchy(width: float) -> Loss:
    """Cauchy weights of groups of three residuals, ``width`` robust σ wide, in units of their own median."""

    def weights(length: Array) -> Array:
        scale = np.median(length) / _CHI3_MEDIAN
        return np.asarray(1 / (1 + (length / (width * scale)) ** 2))

    return weights


def solve(
    terms: Sequence[Term],
    unknowns: Unknowns,
    start: State,
    losses: Sequence[Loss | None] | None = None,
    max_iterations: int = 60,
    tolerance: float = 1e-5,
    plain_iterations: int = 0,
) -> Result:
    """Minimise the sum of all terms and priors over the free components of all blocks.

    Parameters
    ----------
    terms : sequence of Term
        The evidence.
    unknowns : Unknowns
        Its blocks; those with members are eliminated one member at a time.
    start : State
        A value for every block.
    losses : sequence of Loss or None
        For each term a robust loss for its groups, or None.
    max_iterations : int
    tolerance : float
        The iteration stops at an undamped step shorter than this many σ of its unknowns (a damped one is short far from
        the optimum, too, where a valley bends). A step so short is taken as it is: what it gains is less than the
        rounding of the cost, which must not decide whether it is damped.
    plain_iterations : int
        Iterations before the losses count, so that a poor start does not decide what is trusted.

    Returns
    -------
    Result
        Also where the iteration did not settle: then ``converged`` is False.
    """
    problem = _Problem(tuple(terms), unknowns, tuple(losses) if losses else (None,) * len(terms))
    robust = any(loss is not None for loss in problem.losses)
    here = _Point.at(problem, problem.linearise(start), weighted=robust and plain_iterations == 0)
    damping, initial, iterations, converged = 0.0, here.cost, 0, False
    while iterations < max_iterations and not converged and damping < _MAX_DAMPING:
        iterations += 1
        found, damping, settled = _advance(here, damping, tolerance**2)
        try:
            here = _Point.at(problem, found, weighted=robust and iterations >= plain_iterations)
        except np.linalg.LinAlgError:  # the data say nothing there (strings in the sheet): no place to go on from
            break
        converged = settled and iterations >= plain_iterations
    every = np.ones(unknowns.size, dtype=bool)
    return Result(
        unknowns,
        here.found.state,
        here.found.linearised,
        here.whites,
        total_normal(unknowns, here.found.state, here.found.linearised, here.whites, every),
        here.weights,
        initial,
        here.cost,
        iterations,
        converged,
    )


def prior_cost(unknowns: Unknowns, state: State) -> float:
    """Squared departures of what is free from its priors, in σ."""
    total = float(unknowns.prior_weight @ departure(unknowns, state) ** 2)
    for block in unknowns.separate:
        if not block.is_pose and np.any(weight := block.prior_weight):
            total += float(np.sum(state.vector(block.name) ** 2 @ weight))
    return total


def total_cost(unknowns: Unknowns, state: State, linearised: Sequence[Linearised]) -> float:
    """The cost at a state of terms linearised there, by their own covariances."""
    whitened = (whitener(lin.covariance) @ lin.residual[..., None] for lin in linearised)
    return sum((float(np.vdot(w, w)) for w in whitened), prior_cost(unknowns, state))


@dataclass(frozen=True, eq=False)
class _Found:
    """All terms linearised at a state."""

    state: State
    linearised: tuple[Linearised, ...]


@dataclass(frozen=True, eq=False)
class _Problem:
    terms: tuple[Term, ...]
    unknowns: Unknowns
    losses: tuple[Loss | None, ...]

    def linearise(self, state: State) -> _Found:
        """All terms at a state."""
        return _Found(state, tuple(t.linearise(state) for t in self.terms))

    def cost(self, found: _Found, whites: Sequence[Array]) -> float:
        """Squared whitened residuals and priors."""
        whitened = (white @ lin.residual[..., None] for lin, white in zip(found.linearised, whites, strict=True))
        return sum((float(np.vdot(w, w)) for w in whitened), prior_cost(self.unknowns, found.state))


@dataclass(frozen=True, eq=False)
class _Point:
    """The weighted problem at one state."""

    problem: _Problem
    found: _Found
    whites: tuple[Array, ...]
    weights: tuple[Array, ...]
    cost: float

    @staticmethod
    def at(problem: _Problem, found: _Found, weighted: bool) -> _Point:
        """With the terms' own covariances; LinAlgError where one is none."""
        whites, weights = [], []
        for lin, loss in zip(found.linearised, problem.losses, strict=True):
            white = whitener(lin.covariance)
            weights.append(_weights(lin, white, loss if weighted else None))
            whites.append(white if np.all(weights[-1] == 1) else white * np.sqrt(weights[-1])[:, None, None])
        return _Point(problem, found, tuple(whites), tuple(weights), problem.cost(found, whites))


def _advance(here: _Point, damping: float, short: float) -> tuple[_Found, float, bool]:
    """The first damped step that lowers the cost, at weights held fixed; the same state where none does.

    short: a decrement below which a step is taken unjudged. Returned besides: the damping to go on with and whether the
    step was short without any.
    """
    problem, at = here.problem, here.found
    normal = total_normal(problem.unknowns, at.state, at.linearised, here.whites, problem.unknowns.free)
    while True:
        step = normal_step(normal, problem.unknowns.free, damping)
        trial = problem.linearise(at.state.moved(problem.unknowns, step))
        if step.decrement < short:
            return trial, 0.0, damping == 0
        if problem.cost(trial, here.whites) <= here.cost * (1 + 1e-12) + 1e-18:
            return trial, 0.0 if damping < 1e-6 else damping / 10, False
        damping = max(10 * damping, 1e-4)
        if damping >= _MAX_DAMPING:
            return at, damping, False


def _weights(lin: Linearised, white: Array, loss: Loss | None) -> Array:
    if loss is None:
        return np.ones(len(lin.residual))
    return loss(np.linalg.norm((white @ lin.residual[..., None])[..., 0], axis=1))
