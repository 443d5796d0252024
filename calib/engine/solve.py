"""Levenberg-Marquardt over named blocks: the sum of all terms' squared whitened residuals and of the priors."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from calib.engine.normal import Normal, departure, normal_step, prior_weights, total_normal, whitener
from geometry import Linearised, State, Step, Term, Unknowns

Array = NDArray[np.float64]
Loss = Callable[[Array], Array]  # weights (G,) of a term's groups by their whitened lengths (G,)

_MAX_DAMPING = 1e10
_ROUNDING = 1e-16  # a decrement below this changes the cost by less than its last digits
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
        The iteration stops at a step shorter than this many σ of its unknowns.
    plain_iterations : int
        Iterations before the losses count, so that a poor start does not decide what is trusted.

    Returns
    -------
    Result
        Also where the iteration did not settle: then ``converged`` is False.
    """
    problem = _Problem(tuple(terms), unknowns, tuple(losses) if losses else (None,) * len(terms))
    robust = any(loss is not None for loss in problem.losses)
    here = _Point(problem, start, weighted=robust and plain_iterations == 0)
    damping, initial, iterations, converged = 0.0, here.cost, 0, False
    while iterations < max_iterations and not converged and damping < _MAX_DAMPING:
        iterations += 1
        state, damping, step = _advance(here, damping)
        weighted = robust and iterations >= plain_iterations
        try:
            here = _Point(problem, state, weighted)
        except np.linalg.LinAlgError:  # the data say nothing there (strings in the sheet): no place to go on from
            break
        converged = step.decrement < tolerance**2 and iterations >= plain_iterations
    return here.result(initial, iterations, converged)


def prior_cost(unknowns: Unknowns, state: State) -> float:
    """Squared departures of what is free from its priors, in σ."""
    total = float(prior_weights(unknowns.sigma, unknowns.free) @ departure(unknowns, state) ** 2)
    for block in unknowns.separate:
        if not block.is_pose and np.any(weight := prior_weights(block.sigma, block.free)):
            total += float(np.sum(state.vector(block.name) ** 2 @ weight))
    return total


def total_cost(unknowns: Unknowns, state: State, linearised: Sequence[Linearised]) -> float:
    """The cost at a state of terms linearised there, by their own covariances."""
    whitened = (whitener(lin.covariance) @ lin.residual[..., None] for lin in linearised)
    return sum((float(np.vdot(w, w)) for w in whitened), prior_cost(unknowns, state))


@dataclass(frozen=True, eq=False)
class _Problem:
    terms: tuple[Term, ...]
    unknowns: Unknowns
    losses: tuple[Loss | None, ...]

    @property
    def estimated(self) -> frozenset[str]:
        """Names of the blocks of which something is estimated."""
        return frozenset(b.name for b in self.unknowns.blocks if np.any(b.free))

    def cost(self, residuals: Sequence[Array], whites: Sequence[Array], state: State) -> float:
        """Squared whitened residuals and priors."""
        whitened = (white @ r[..., None] for r, white in zip(residuals, whites, strict=True))
        return sum((float(np.vdot(w, w)) for w in whitened), prior_cost(self.unknowns, state))


class _Point:
    """The linearised, weighted problem at one state."""

    def __init__(self, problem: _Problem, state: State, weighted: bool) -> None:
        self.problem, self.state = problem, state
        self.linearised = tuple(t.linearise(state, problem.estimated) for t in problem.terms)
        whites = [whitener(lin.covariance) for lin in self.linearised]
        self.weights = tuple(
            _weights(lin, white, loss if weighted else None)
            for lin, white, loss in zip(self.linearised, whites, problem.losses, strict=True)
        )
        self.whites = tuple(
            white if np.all(w == 1) else white * np.sqrt(w)[:, None, None]
            for white, w in zip(whites, self.weights, strict=True)
        )
        self.cost = problem.cost([lin.residual for lin in self.linearised], self.whites, state)

    def normal(self) -> Normal:
        """The normal equations of what is estimated."""
        u = self.problem.unknowns
        return total_normal(u, self.state, self.linearised, self.whites, u.free)

    def result(self, initial_cost: float, iterations: int, converged: bool) -> Result:
        """The end of the iteration, with the Jacobians of what was not estimated too."""
        u, lins = self.problem.unknowns, self.linearised
        if self.problem.estimated != {b.name for b in u.blocks}:
            lins = tuple(t.linearise(self.state, None) for t in self.problem.terms)
        normal = total_normal(u, self.state, lins, self.whites, np.ones(u.size, dtype=bool))
        return Result(
            u, self.state, lins, self.whites, normal, self.weights, initial_cost, self.cost, iterations, converged
        )


def _advance(here: _Point, damping: float) -> tuple[State, float, Step]:
    """The first damped step that lowers the cost, at weights held fixed; the same state where none does."""
    problem, normal = here.problem, here.normal()
    while True:
        step = normal_step(normal, problem.unknowns.free, damping)
        trial = here.state.moved(problem.unknowns, step)
        cost = problem.cost([t.residual(trial) for t in problem.terms], here.whites, trial)
        if cost <= here.cost * (1 + 1e-12) + 1e-18 or step.decrement < _ROUNDING:
            return trial, 0.0 if damping < 1e-6 else damping / 10, step
        damping = max(10 * damping, 1e-4)
        if damping >= _MAX_DAMPING:
            return here.state, damping, step


def _weights(lin: Linearised, white: Array, loss: Loss | None) -> Array:
    if loss is None:
        return np.ones(len(lin.residual))
    return loss(np.linalg.norm((white @ lin.residual[..., None])[..., 0], axis=1))
