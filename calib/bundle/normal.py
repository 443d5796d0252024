"""Normal equations of the bundle: unknowns common to all frames, and a jig pose a location, eliminated by Schur."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from calib.bundle.linearise import Linearised
from calib.bundle.problem import Problem

Array = NDArray[np.float64]

_OPEN = 1e100  # variance of a direction that the data leave open: large, and its square is still finite


@dataclass(frozen=True, eq=False)
class Normal:
    """Hessian and gradient of half the cost: common unknowns (C) = SCP 6, robot P, anchors 12; jigs (L, 6).

    common (C, C), cross (L, C, 6), jigs (L, 6, 6); gradient_common (C,), gradient_jigs (L, 6).
    """

    common: Array
    cross: Array
    jigs: Array
    gradient_common: Array
    gradient_jigs: Array


@dataclass(frozen=True, eq=False)
class Step:
    """A step of the common unknowns (C,) and the jigs (L, 6); ``decrement`` is its squared length in units of σ."""

    common: Array
    jigs: Array
    decrement: float


def normal_equations(problem: Problem, lin: Linearised, white: Array, robot: NDArray[np.bool_] | None = None) -> Normal:
    """Accumulate over frames.

    white (F, 2M, 2M): whitens the residuals. robot (P,): whose columns to form, the others stay zero; None: all.
    """
    f, rows = white.shape[:2]
    p = lin.parameters.shape[-1]
    chosen = np.arange(p) if robot is None else np.flatnonzero(robot)
    moved = lin.hand.reshape(f, rows, 6) @ lin.parameters[..., chosen]
    parts = (lin.scp.reshape(f, rows, 6), moved, lin.anchors.reshape(f, rows, 12))
    columns = white @ np.concatenate([*parts, lin.jig.reshape(f, rows, 6), lin.residual.reshape(f, rows, 1)], -1)
    a, b, r = columns[..., :-7], columns[..., -7:-1], columns[..., -1:]
    flat, b_t = a.reshape(f * rows, -1), np.swapaxes(b, -1, -2)
    at_location = (np.arange(problem.n_locations)[:, None] == problem.location).astype(float)  # (L, F)
    cross = (at_location @ (np.swapaxes(a, -1, -2) @ b).reshape(f, -1)).reshape(-1, a.shape[-1], 6)
    jigs = (at_location @ (b_t @ b).reshape(f, -1)).reshape(-1, 6, 6)
    small = Normal(flat.T @ flat, cross, jigs, flat.T @ r.reshape(-1), at_location @ (b_t @ r)[..., 0])
    return small if len(chosen) == p else _spread(small, chosen, p)


def _spread(small: Normal, chosen: NDArray[np.intp], p: int) -> Normal:
    """The normal equations with zeros for the robot parameters that were not ``chosen`` of ``p``."""
    c = 18 + p
    index = np.concatenate([np.arange(6), 6 + chosen, np.arange(c - 12, c)])
    common, cross, gradient = np.zeros((c, c)), np.zeros((len(small.jigs), c, 6)), np.zeros(c)
    common[np.ix_(index, index)], cross[:, index], gradient[index] = small.common, small.cross, small.gradient_common
    return Normal(common, cross, small.jigs, gradient, small.gradient_jigs)


def with_prior(normal: Normal, sigma: Array, value: Array) -> Normal:
    """Add priors of the common unknowns: mean 0, ``sigma`` (C,), 0 where fixed and infinite where free."""
    weight = np.where(sigma > 0, 1 / np.where(sigma > 0, sigma, 1.0) ** 2, 0.0)
    return Normal(
        normal.common + np.diag(weight),
        normal.cross,
        normal.jigs,
        normal.gradient_common + weight * value,
        normal.gradient_jigs,
    )


def reduced(normal: Normal, damping: float = 0.0) -> tuple[Array, Array]:
    """Schur complement on the common unknowns (C, C), and cross · jigs⁻¹ (L, C, 6)."""
    jigs = normal.jigs * (1 + damping * np.eye(normal.jigs.shape[-1]))
    gain = np.swapaxes(np.linalg.solve(jigs, np.swapaxes(normal.cross, -1, -2)), -1, -2)
    common = normal.common * (1 + damping * np.eye(len(normal.common)))
    return common - np.einsum("lci,ldi->cd", gain, normal.cross), gain


def solve(normal: Normal, free: NDArray[np.bool_], damping: float) -> Step:
    """Levenberg-Marquardt step of the ``free`` (C,) common unknowns and all jigs (columns scaled by their own norm)."""
    schur, gain = reduced(normal, damping)
    gradient = normal.gradient_common - np.einsum("lci,li->c", gain, normal.gradient_jigs)
    common = np.zeros(len(free))
    free = free & (np.diag(schur) > 0)  # rounding takes a direction that is open to zero or below: no step along it
    common[free] = -scaled_solve(schur[np.ix_(free, free)], gradient[free])
    jigs_gradient = normal.gradient_jigs + np.einsum("lci,c->li", normal.cross, common)
    jigs = -np.linalg.solve(normal.jigs * (1 + damping * np.eye(normal.jigs.shape[-1])), jigs_gradient[..., None])[
        ..., 0
    ]
    total = normal.gradient_common @ common + float(np.sum(normal.gradient_jigs * jigs))
    return Step(common, jigs, max(0.0, -float(total)))


def scaled_solve(matrix: Array, right: Array) -> Array:
    """Solve a symmetric system after scaling its diagonal to one; by least squares where it is singular.

    Rounding takes the diagonal of an open direction to zero or below. What couples it to the others is rounding then
    too and is left out; its own solution is _OPEN times its right side.
    """
    diagonal = np.diag(matrix)
    closed = diagonal > 1 / _OPEN
    scale = np.where(closed, 1 / np.sqrt(np.where(closed, diagonal, 1.0)), np.sqrt(_OPEN))
    scaled = np.where(closed[:, None] & closed, matrix, 0.0) * scale[:, None] * scale + np.diag(1.0 * ~closed)
    shape = (slice(None), *(None,) * (right.ndim - 1))
    try:
        return np.asarray(scale[shape] * np.linalg.solve(scaled, scale[shape] * right))
    except np.linalg.LinAlgError:
        return np.asarray(scale[shape] * (np.linalg.pinv(scaled, rcond=1e-14, hermitian=True) @ (scale[shape] * right)))
