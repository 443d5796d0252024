"""What a solution knows: covariances with considered parameters, conditions, the likelihood of its noise."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from calib.engine.normal import (
    common_columns,
    considered_covariance,
    departure,
    reduced,
    reduced_gradient,
    scaled_solve,
    separate_block,
    solve_own,
    total_normal,
    whitener,
)
from calib.engine.solve import Result
from geometry import Linearised, Unknowns

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Covariance:
    """Covariances by block name, in the tangent of each block.

    total, noise (C, C): of the common unknowns, with the errors of considered ones and from noise alone. In total the
    considered ones stand with their priors and their correlation with what was estimated; fixed ones are zero.
    separate: by block (L, n, n), considered errors included.
    """

    unknowns: Unknowns
    total: Array
    noise: Array
    separate: Mapping[str, Array]

    def of(self, name: str) -> Array:
        """Covariance of a block: (n, n), or (L, n, n) of its members."""
        if name in self.separate:
            return self.separate[name]
        i = self.unknowns[name]
        return self.total[i, i]

    def noise_of(self, name: str) -> Array:
        """Covariance (n, n) of a common block from noise alone."""
        i = self.unknowns[name]
        return self.noise[i, i]

    def sigma(self, name: str) -> Array:
        """σ (n,) of a common block: after the data where it was estimated, else its prior's."""
        block = self.unknowns.block(name)
        variance = np.diag(self.of(name))
        sound = np.where(variance >= 0, variance, np.inf)  # rounding leaves a negative one where nothing is determined
        return np.where(block.free, np.sqrt(sound), block.sigma)


def covariance(result: Result) -> Covariance:
    """Covariances at a solution (Schmidt's consider analysis for what was left at its start under a prior)."""
    u = result.unknowns
    schur, gains = reduced(result.normal)
    free, considered = u.free, u.considered
    coupling, sigma = schur[np.ix_(free, considered)], u.sigma[considered]
    noise = scaled_solve(schur[np.ix_(free, free)], np.eye(int(free.sum())))
    total, from_noise = np.zeros((u.size, u.size)), np.zeros((u.size, u.size))
    from_noise[np.ix_(free, free)] = noise
    total[np.ix_(free, free)] = considered_covariance(noise, coupling, sigma)
    shift = -noise @ (coupling * sigma)  # of the free unknowns, for each considered one's σ
    total[np.ix_(considered, considered)] = np.diag(sigma**2)
    total[np.ix_(free, considered)] = shift * sigma
    total[np.ix_(considered, free)] = (shift * sigma).T
    separate = {}
    for name, gain in gains.items():
        # a member's own error: η = -own⁻¹ (g + crossᵀ c), with c the errors of the common unknowns
        to_free = np.swapaxes(gain[:, free], -1, -2)  # (L, n, C_free)
        bias = -to_free @ shift - np.swapaxes(gain[:, considered], -1, -2) * sigma
        own = solve_own(result.normal.own[name], np.eye(gain.shape[-1]))
        separate[name] = own + to_free @ noise @ np.swapaxes(to_free, -1, -2) + bias @ np.swapaxes(bias, -1, -2)
    return Covariance(u, total, from_noise, separate)


def exact_covariance(result: Result) -> Array:
    """Covariance (C, C) of the free common unknowns, zero elsewhere, by orthogonal transformations.

    As ``covariance`` has it from noise alone, to twice the digits: normal equations lose those by which unknowns that
    trade places are told apart. LinAlgError where a combination of unknowns is open.

    References
    ----------
    Golub & Van Loan, Matrix Computations, 4th ed., 5.3: least squares by QR.
    """
    u = result.unknowns
    free = np.flatnonzero(u.free)
    # with the members' own unknowns before the common ones, what is left below these has them eliminated
    eliminated = [np.diag(np.sqrt(u.prior_weight[free]))]
    rows: dict[tuple[str, int], list[Array]] = {}
    for lin, white in zip(result.linearised, result.whites, strict=True):
        index, columns = common_columns(u, lin, u.free)
        common = np.zeros((*lin.residual.shape, len(free)))
        common[..., np.searchsorted(free, index)] = white @ columns
        if not (name := separate_block(u, lin)):
            eliminated.append(common.reshape(-1, len(free)))
            continue
        table = np.concatenate([white @ lin.jacobian[name], common], -1)
        for member in np.unique(lin.member[name]):
            mine = table[lin.member[name] == member]
            rows.setdefault((name, int(member)), []).append(mine.reshape(-1, table.shape[-1]))
    for (name, _), parts in rows.items():
        own = u.block(name)
        kept = np.concatenate([own.free, np.ones(len(free), dtype=bool)])
        prior = np.diag(np.sqrt(own.prior_weight)) @ np.eye(own.size, len(kept))
        triangle = np.asarray(np.linalg.qr(np.concatenate([*parts, prior])[:, kept], mode="r"))
        first = int(own.free.sum())
        eliminated.append(triangle[first:, first:])
    table = np.concatenate(eliminated)
    scale = np.linalg.norm(table, axis=0)
    if not np.all(scale > 0):
        raise np.linalg.LinAlgError("an unknown is open")
    root = np.linalg.inv(np.asarray(np.linalg.qr(table / scale, mode="r"))) / scale[:, None]
    out = np.zeros((u.size, u.size))
    out[np.ix_(free, free)] = root @ root.T
    return out


def scaled_condition(result: Result, name: str) -> float:
    """Condition number of a common block's scaled Jacobian once everything else that is free is marginalised."""
    u = result.unknowns
    schur, _ = reduced(result.normal)
    mine = u.indices(name, u.block(name).free)
    rest = np.setdiff1d(np.flatnonzero(u.free), mine)
    block = schur[np.ix_(mine, mine)]
    if len(rest):
        cross = schur[np.ix_(mine, rest)]
        block = block - cross @ scaled_solve(schur[np.ix_(rest, rest)], cross.T)
    scale = 1 / np.sqrt(np.maximum(np.diag(block), 1e-300))
    values = np.linalg.eigvalsh(block * scale[:, None] * scale)
    return float(np.sqrt(values[-1] / values[0])) if values[0] > 1e-16 * values[-1] else float("inf")


def deviance(result: Result, linearised: Sequence[Linearised] | None = None) -> float:
    """Minus twice the restricted log-likelihood (up to a constant) of the noise, at the linearised solution.

    linearised: the result's own with other covariances, to compare one noise with another. All unknowns are integrated
    out: log|S| + log|H| + the cost once they are solved for.

    References
    ----------
    Patterson & Thompson, Biometrika 58 (1971) 545.
    """
    lins = result.linearised if linearised is None else tuple(linearised)
    u, state = result.unknowns, result.state
    whites = [whitener(lin.covariance) for lin in lins]
    normal = total_normal(u, state, lins, whites, u.free)
    schur, gains = reduced(normal)
    gradient = reduced_gradient(normal, gains)
    free = u.free & (np.diag(schur) > 0)  # an open direction saves nothing
    information = schur[np.ix_(free, free)]
    saved = float(gradient[free] @ scaled_solve(information, gradient[free]))
    determinants = float(np.linalg.slogdet(information)[1])
    for name, own in normal.own.items():
        g = normal.own_gradient[name]
        saved += float(np.sum(g * solve_own(own, g[..., None])[..., 0]))
        determinants += float(np.sum(np.linalg.slogdet(own)[1]))
    cost = float(u.prior_weight @ departure(u, state) ** 2)
    for lin, white in zip(lins, whites, strict=True):
        w = white @ lin.residual[..., None]
        cost += float(np.vdot(w, w))
        determinants -= 2 * float(np.sum(np.log(np.diagonal(white, axis1=-2, axis2=-1))))
    return cost - saved + determinants


def evidence(result: Result) -> float:
    """Minus twice the log marginal likelihood (up to a constant), comparable between priors and models on like data."""
    u = result.unknowns
    schur, _ = reduced(result.normal)
    known = u.free & np.isfinite(u.sigma)
    total = result.cost + float(np.linalg.slogdet(schur[np.ix_(u.free, u.free)])[1])
    total += 2 * float(np.sum(np.log(u.sigma[known])))
    total += sum(float(np.sum(np.linalg.slogdet(own)[1])) for own in result.normal.own.values())
    diagonals = (np.diagonal(white, axis1=-2, axis2=-1) for white in result.whites)
    return total - 2 * sum(float(np.sum(np.log(d))) for d in diagonals)
