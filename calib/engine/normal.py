"""Normal equations over named blocks: accumulated from terms, separate blocks eliminated by their Schur complement."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from geometry import Linearised, State, Step, Unknowns

Array = NDArray[np.float64]
Index = NDArray[np.intp]
Mask = NDArray[np.bool_]

_OPEN = 1e100  # variance of a direction that the data leave open: large, and its square is still finite
_HARDLY = 1e-13  # share of the diagonal that a singular block of a member gets: what is open then has a σ of 10⁶ others
_JITTER = 1e-14  # share of a group's variance that keeps one whose rows hardly differ factorisable


@dataclass(frozen=True, eq=False)
class Normal:
    """Hessian and gradient of half the cost, by the common unknowns (C) and by the members of each separate block.

    common (C, C), gradient (C,). By block name: cross (L, C, n), own (L, n, n), own_gradient (L, n).
    """

    common: Array
    gradient: Array
    cross: Mapping[str, Array]
    own: Mapping[str, Array]
    own_gradient: Mapping[str, Array]


@dataclass(frozen=True, eq=False)
class GroupNormals:
    """Normal equations of every group of one term alone: common (G, C, C), cross (G, C, n), own (G, n, n).

    member (G,): whose copy of the separate block each group meets.
    """

    common: Array
    cross: Array
    own: Array
    member: Index

    def __getitem__(self, index: Index) -> GroupNormals:
        """The groups of ``index``."""
        return GroupNormals(self.common[index], self.cross[index], self.own[index], self.member[index])

    def followed_by(self, other: GroupNormals) -> GroupNormals:
        """These groups and then the ``other`` ones, of the same unknowns."""
        return GroupNormals(
            np.concatenate([self.common, other.common]),
            np.concatenate([self.cross, other.cross]),
            np.concatenate([self.own, other.own]),
            np.concatenate([self.member, other.member]),
        )


def whitener(covariance: Array) -> Array:
    """Matrices (G, r, r) that make each group's residuals independent with unit variance; LinAlgError where none is."""
    size = covariance.shape[-1]
    level = np.trace(covariance, axis1=-2, axis2=-1)[:, None, None] / size
    return np.asarray(np.linalg.inv(np.linalg.cholesky(covariance + _JITTER * level * np.eye(size))))


def total_normal(
    unknowns: Unknowns, state: State, linearised: Sequence[Linearised], whites: Sequence[Array], chosen: Mask
) -> Normal:
    """The normal equations of all terms and priors.

    whites: one (G, r, r) a term. chosen (C,): whose columns to form, the others stay zero.
    """
    c = unknowns.size
    common, gradient = np.zeros((c, c)), np.zeros(c)
    separate = {b.name: (len(b.members), b.size) for b in unknowns.separate}
    cross = {k: np.zeros((count, c, n)) for k, (count, n) in separate.items()}
    own = {k: np.zeros((count, n, n)) for k, (count, n) in separate.items()}
    own_gradient = {k: np.zeros(shape) for k, shape in separate.items()}
    for lin, white in zip(linearised, whites, strict=True):
        index, a = common_columns(unknowns, lin, chosen)
        name = separate_block(unknowns, lin)
        b = lin.jacobian[name] if name else np.zeros((*lin.residual.shape, 0))
        columns = white @ np.concatenate([a, b, lin.residual[..., None]], -1)
        a, b, r = columns[..., : len(index)], columns[..., len(index) : -1], columns[..., -1:]
        flat = a.reshape(lin.residual.size, len(index))
        common[np.ix_(index, index)] += flat.T @ flat
        gradient[index] += flat.T @ r.reshape(-1)
        if name:
            count, n = separate[name]
            at_member = (np.arange(count)[:, None] == lin.member[name]).astype(float)  # (L, G)
            b_t, g, k = np.swapaxes(b, -1, -2), len(b), len(index)
            cross[name][:, index] += (at_member @ (np.swapaxes(a, -1, -2) @ b).reshape(g, k * n)).reshape(count, k, n)
            own[name] += (at_member @ (b_t @ b).reshape(g, n * n)).reshape(count, n, n)
            own_gradient[name] += at_member @ (b_t @ r)[..., 0]
    _add_priors(unknowns, state, common, gradient, own, own_gradient)
    for block in unknowns.separate:
        _hold(block.free, cross[block.name], own[block.name], own_gradient[block.name])
    return Normal(common, gradient, cross, own, own_gradient)


def group_normals(unknowns: Unknowns, lin: Linearised) -> GroupNormals:
    """The information of every group of a term about all common unknowns and about the copy that it meets."""
    name = separate_block(unknowns, lin)
    index, columns = common_columns(unknowns, lin, np.ones(unknowns.size, dtype=bool))
    white = whitener(lin.covariance)
    a = np.zeros((*lin.residual.shape, unknowns.size))
    a[..., index] = white @ columns
    b = white @ lin.jacobian[name]
    a_t, b_t = np.swapaxes(a, -1, -2), np.swapaxes(b, -1, -2)
    return GroupNormals(a_t @ a, a_t @ b, b_t @ b, lin.member[name])


def departure(unknowns: Unknowns, state: State) -> Array:
    """How far the common unknowns (C,) are from their priors' mean, which is where vectors are zero."""
    out = np.zeros(unknowns.size)
    for block in unknowns.common:
        if not block.is_pose:
            out[unknowns[block.name]] = state.vector(block.name)
    return out


def reduced(normal: Normal, damping: float = 0.0) -> tuple[Array, dict[str, Array]]:
    """Schur complement on the common unknowns (C, C), and cross · own⁻¹ (L, C, n) of every separate block."""
    schur = normal.common * (1 + damping * np.eye(len(normal.common)))
    gains = {}
    for name, cross in normal.cross.items():
        own = normal.own[name] * (1 + damping * np.eye(cross.shape[-1]))
        gains[name] = np.swapaxes(solve_own(own, np.swapaxes(cross, -1, -2)), -1, -2)
        schur = schur - np.einsum("lci,ldi->cd", gains[name], cross)
    return schur, gains


def reduced_gradient(normal: Normal, gains: Mapping[str, Array]) -> Array:
    """Gradient (C,) of the common unknowns once the separate blocks are eliminated."""
    taken = [np.einsum("lci,li->c", gain, normal.own_gradient[name]) for name, gain in gains.items()]
    return np.asarray(normal.gradient - sum(taken, np.zeros(len(normal.gradient))))


def normal_step(normal: Normal, free: Mask, damping: float) -> Step:
    """Levenberg-Marquardt step of the ``free`` (C,) common unknowns and all separate blocks, in scaled columns."""
    schur, gains = reduced(normal, damping)
    gradient = reduced_gradient(normal, gains)
    common = np.zeros(len(free))
    free = free & (np.diag(schur) > 0)  # rounding takes a direction that is open to zero or below: no step along it
    common[free] = -scaled_solve(schur[np.ix_(free, free)], gradient[free])
    total = normal.gradient @ common
    separate = {}
    for name, cross in normal.cross.items():
        slope = normal.own_gradient[name] + np.einsum("lci,c->li", cross, common)
        own = normal.own[name] * (1 + damping * np.eye(cross.shape[-1]))
        separate[name] = -solve_own(own, slope[..., None])[..., 0]
        total += float(np.sum(normal.own_gradient[name] * separate[name]))
    return Step(common, separate, max(0.0, -float(total)))


def solve_own(own: Array, right: Array) -> Array:
    """Solve (L, n, n) x = (L, n, k); a combination that no datum of a member touches counts as hardly known."""
    try:
        return np.asarray(np.linalg.solve(own, right))
    except np.linalg.LinAlgError:
        diagonal = np.diagonal(own, axis1=-2, axis2=-1)
        return np.asarray(np.linalg.solve(own + _HARDLY * diagonal[..., None] * np.eye(own.shape[-1]), right))


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


def considered_covariance(noise: Array, coupling: Array, sigma: Array) -> Array:
    """Covariance (…, k, k) with considered parameters (Schmidt): ``noise`` of k unknowns, and what σ's errors move.

    coupling (…, k, s): of the reduced information, between those unknowns and the s considered ones of prior ``sigma``.
    """
    bias = noise @ (coupling * sigma)
    return np.asarray(noise + bias @ np.swapaxes(bias, -1, -2))


def common_columns(unknowns: Unknowns, lin: Linearised, chosen: Mask) -> tuple[Index, Array]:
    """Positions (k,) of the chosen common unknowns that a term depends on, and their columns (G, r, k)."""
    index, columns = [np.zeros(0, dtype=np.intp)], [np.zeros((*lin.residual.shape, 0))]
    for block in unknowns.common:
        mine = chosen[unknowns[block.name]]
        if block.name in lin.jacobian and np.any(mine):
            index.append(unknowns.indices(block.name, mine))
            jacobian = lin.jacobian[block.name]
            columns.append(jacobian if np.all(mine) else jacobian[..., mine])
    return np.concatenate(index), np.concatenate(columns, -1)


def separate_block(unknowns: Unknowns, lin: Linearised) -> str:
    """The separate block whose copies a term's groups meet, "" for none; more than one could not be eliminated."""
    names = [b.name for b in unknowns.separate if b.name in lin.jacobian]
    if len(names) > 1:
        raise ValueError(f"a term meets two separate blocks, {names[0]} and {names[1]}: make one of them common")
    return names[0] if names else ""


def _add_priors(
    unknowns: Unknowns,
    state: State,
    common: Array,
    gradient: Array,
    own: Mapping[str, Array],
    own_gradient: Mapping[str, Array],
) -> None:
    weight = unknowns.prior_weight
    common[np.diag_indices(len(weight))] += weight
    gradient += weight * departure(unknowns, state)
    for block in unknowns.separate:
        if np.any(weight := block.prior_weight):
            own[block.name][:] += np.diag(weight)
            if not block.is_pose:
                own_gradient[block.name][:] += weight * state.vector(block.name)


def _hold(free: Mask, cross: Array, own: Array, gradient: Array) -> None:
    """Take components that are not free, or that no datum touches, out of the equations: no step along them."""
    open_ones = ~free | (np.diagonal(own, axis1=-2, axis2=-1) <= 0)  # (L, n)
    if np.any(open_ones):
        closed = (~open_ones).astype(float)
        cross *= closed[:, None, :]
        own *= closed[:, :, None] * closed[:, None, :]
        own += open_ones[:, :, None] * np.eye(own.shape[-1])
        gradient *= closed
