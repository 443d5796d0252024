"""The engine where nothing is common: many small problems at once, each with a damping of its own."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from calib.engine.normal import whitener
from geometry import Pose, State, Term, Unknowns

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

_MAX_DAMPING = 1e8  # a step so short that rounding decides
_FIRST_DAMPING = 2e-3  # share of the diagonal: starts are near, but a mirror's basin may be nearer
_FLAT = 1e-3  # a last step that gained less cost has reached the floor, where two minima merge and steps stay long
_ROUNDING = 1e-10  # of a cost about 1: points to 1e-13 mm over σ of some 0.01 mm leave it no better known


@dataclass(frozen=True, eq=False)
class MembersResult:
    """Where each member's iteration ended: the state, cost (L,), converged (L,), and what stood there.

    jacobian (L, r, n): whitened, by the member's own tangent. residual (L, r): not whitened.
    """

    state: State
    cost: Array
    converged: Mask
    jacobian: Array
    residual: Array


def solve_members(
    term: Term, unknowns: Unknowns, start: State, max_iterations: int = 30, tolerance: float = 1e-9
) -> MembersResult:
    """Levenberg-Marquardt for L independent members of one block, one group of the term for each.

    tolerance: a member has converged when every component of its step is below [mm, rad].
    """
    (block,) = unknowns.separate
    here = _Members(term, block.name, start)
    damping = np.full(len(here.cost), _FIRST_DAMPING)
    gain, step = np.full(len(damping), np.inf), np.full(len(damping), np.inf)
    converged = np.zeros(len(damping), dtype=bool)
    for _ in range(max_iterations):
        moved = here.step(damping, block.free)
        trial = _Members(term, block.name, here.state.with_value(block.name, here.poses @ Pose.exp(moved)))
        # near the minimum the cost is rounding noise and the step says more than it does
        better = (trial.cost <= here.cost + _ROUNDING * (1 + here.cost)) & ~converged
        gain = np.where(better, here.cost - trial.cost, gain)
        step = np.where(converged, step, np.max(np.abs(moved), axis=1))
        here = here.taking(trial, better)
        damping = np.where(better, damping * 0.05 + 1e-14, damping * 8.0)
        # a tiny step that no longer helps is rounding at the minimum
        converged |= (step < tolerance) | (~better & ((step < 1e3 * tolerance) | (damping > _MAX_DAMPING)))
        if np.all(converged):
            break
    converged |= gain < _FLAT
    return MembersResult(here.state, here.cost, converged & np.isfinite(here.cost), here.jacobian, here.residual)


class _Members:
    """The linearised members at one state."""

    def __init__(self, term: Term, name: str, state: State) -> None:
        lin = term.linearise(state)
        white = whitener(lin.covariance)
        self.name, self.state, self.residual = name, state, lin.residual
        self.white_residual = (white @ lin.residual[..., None])[..., 0]
        self.jacobian = white @ lin.jacobian[name]
        self.cost = np.sum(self.white_residual**2, axis=1)

    @property
    def poses(self) -> Pose:
        """The members' values."""
        return self.state.pose(self.name)

    def step(self, damping: Array, free: Mask) -> Array:
        """Damped steps (L, n), in scaled columns; none along what is not free or not seen."""
        J = self.jacobian * free
        normal = np.swapaxes(J, -1, -2) @ J
        diagonal = np.einsum("lii->li", normal)  # a view
        diagonal *= 1 + damping[:, None]
        diagonal[diagonal <= 0] = 1.0
        gradient = np.swapaxes(J, -1, -2) @ self.white_residual[..., None]
        return np.asarray(-np.linalg.solve(normal, gradient)[..., 0])

    def taking(self, other: _Members, chosen: Mask) -> _Members:
        """These members with the ``chosen`` (L,) ones of another state."""
        if np.all(chosen):
            return other
        out = object.__new__(_Members)
        mine, its = self.poses, other.poses
        poses = Pose(np.where(chosen[:, None, None], its.R, mine.R), np.where(chosen[:, None], its.t, mine.t))
        out.name, out.state = self.name, self.state.with_value(self.name, poses)
        out.residual = np.where(chosen[:, None], other.residual, self.residual)
        out.white_residual = np.where(chosen[:, None], other.white_residual, self.white_residual)
        out.jacobian = np.where(chosen[:, None, None], other.jacobian, self.jacobian)
        out.cost = np.where(chosen, other.cost, self.cost)
        return out
