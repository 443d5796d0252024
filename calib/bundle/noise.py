"""Noise that is not known beforehand, estimated from the residuals by restricted maximum likelihood."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize

from calib.bundle.bundle import BundleResult
from calib.bundle.linearise import Linearised
from calib.bundle.normal import normal_equations, reduced, scaled_solve, with_prior
from calib.bundle.problem import Problem
from calib.bundle.weights import frame_covariance, removal, whitener

Array = NDArray[np.float64]

_MAX_EVALUATIONS = 80
_LOG_TOLERANCE = 0.02  # of a variance; far below its own uncertainty
_SCORE_STEP = 0.3
_MAX_LOG = 14.0  # a variance a million times smaller or larger than at the start: a σ a thousand times so
_SIMPLEX = -0.7  # first steps of the search, in the logarithm of a variance


def deviance(problem: Problem, result: BundleResult) -> float:
    """Minus twice the restricted log-likelihood (up to a constant) of ``problem``'s noise, at the linearised solution.

    All unknowns are integrated out: log|S| + log|H| + the cost once they are solved for (Patterson & Thompson 1971).
    """
    lin: Linearised = result.lin
    covariance = frame_covariance(problem, lin, removal(result.removed), problem.chain.noise)
    white = whitener(covariance)
    state, free = result.state, result.free
    values = np.concatenate([np.zeros(6), state.parameters, state.anchors.ravel()])
    sigma = np.where(free, result.prior_sigma, 0.0)
    normal = with_prior(normal_equations(problem, lin, white), sigma, values)
    schur, gain = reduced(normal)
    gradient = normal.gradient_common - np.einsum("lci,li->c", gain, normal.gradient_jigs)
    free = free & (np.diag(schur) > 0)  # an open direction saves nothing
    information = schur[np.ix_(free, free)]
    saved = gradient[free] @ scaled_solve(information, gradient[free])
    saved += np.sum(normal.gradient_jigs * np.linalg.solve(normal.jigs, normal.gradient_jigs[..., None])[..., 0])
    r = white @ lin.residual.reshape(*white.shape[:2], 1)
    prior = values[sigma > 0] / sigma[sigma > 0]
    cost = np.vdot(r, r) + prior @ prior - saved
    diagonals = np.diagonal(white, axis1=-2, axis2=-1)
    determinants = -2 * np.sum(np.log(diagonals)) + np.linalg.slogdet(information)[1]
    return float(cost + determinants + np.sum(np.linalg.slogdet(normal.jigs)[1]))


def with_noise(problem: Problem, point_scale: float, hand_noise: Array) -> Problem:
    """The problem with the points' covariances times ``point_scale`` and hand poses of covariance (F, 6, 6)."""
    points = replace(problem.points, cov_mm2=problem.points.cov_mm2 * point_scale)
    return replace(problem, points=points, chain=replace(problem.chain, noise=hand_noise))


@dataclass(frozen=True, eq=False)
class Variances:
    """Noise as variances to be found: of the points (a factor), then of each component of the hand poses' noise.

    components: covariances (F, 6, 6) of unit variance, whose sum, each times its variance, is the hand poses' noise.
    value: (1 + K,). free: which of them the data may change.
    """

    components: tuple[Array, ...]
    value: Array
    free: NDArray[np.bool_]

    def problem(self, problem: Problem, log_free: Array) -> Problem:
        """The problem with the free variances at exp(``log_free``)."""
        value = self.at(log_free)
        return with_noise(problem, value[0], np.einsum("k,kfij->fij", value[1:], np.array(self.components)))

    def at(self, log_free: Array) -> Array:
        """All variances (1 + K,) with the free ones at exp(``log_free``), held near their start.

        Further off nothing is gained, and the common unknowns' information is lost in the rounding of the points'.
        """
        value = self.value.copy()
        start = np.log(value[self.free])
        value[self.free] = np.exp(np.clip(log_free, start - _MAX_LOG, start + _MAX_LOG))
        return value


def contradiction(problem: Problem, result: BundleResult, variances: Variances) -> float:
    """About how much deviance the free variances would gain (a score test by finite differences)."""
    start = np.log(variances.value[variances.free])

    def of(x: Array) -> float:
        return deviance(variances.problem(problem, x), result)

    middle, gain = of(start), 0.0
    for e in np.eye(len(start)) * _SCORE_STEP:
        above, below = of(start + e), of(start - e)
        curvature = max((above + below - 2 * middle) / _SCORE_STEP**2, 1.0)
        gain += ((above - below) / (2 * _SCORE_STEP)) ** 2 / curvature
    return float(gain)


def estimate_noise(problem: Problem, result: BundleResult, variances: Variances) -> Array:
    """Variances (1 + K,) that make the residuals most likely, the solution's linearisation held."""

    def of(log_free: Array) -> float:
        return deviance(variances.problem(problem, log_free), result)

    start = np.log(variances.value[variances.free])
    simplex = np.vstack([start, start + _SIMPLEX * np.eye(len(start))])  # scipy's own is 0.00025 wide at zero
    options = {"maxfev": _MAX_EVALUATIONS, "xatol": _LOG_TOLERANCE, "fatol": 1e-2, "initial_simplex": simplex}
    return variances.at(minimize(of, start, method="Nelder-Mead", options=options).x)
