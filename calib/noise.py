"""Noise that is not known beforehand, estimated from the residuals by restricted maximum likelihood."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize

from calib.bundle import BundleResult
from calib.linearise import Linearised
from calib.normal import normal_equations, reduced, scaled_solve, with_prior
from calib.problem import Problem
from calib.weights import frame_covariance, removal

Array = NDArray[np.float64]

_MAX_EVALUATIONS = 120
_LOG_TOLERANCE = 0.01  # of a variance; far below its own uncertainty


def deviance(problem: Problem, result: BundleResult) -> float:
    """Minus twice the restricted log-likelihood (up to a constant) of ``problem``'s noise, at the linearised solution.

    All unknowns are integrated out: log|S| + log|H| + the cost once they are solved for (Patterson & Thompson 1971).
    """
    lin: Linearised = result.lin
    covariance = frame_covariance(problem, lin, removal(result.removed), problem.chain.noise)
    root = np.linalg.cholesky(covariance)
    white = np.linalg.inv(root)
    state, free = result.state, result.free
    values = np.concatenate([np.zeros(6), state.parameters, state.anchors.ravel()])
    sigma = np.where(free, result.prior_sigma, 0.0)
    normal = with_prior(normal_equations(problem, lin, white), sigma, values)
    schur, gain = reduced(normal)
    gradient = normal.gradient_common - np.einsum("lci,li->c", gain, normal.gradient_jigs)
    information = schur[np.ix_(free, free)]
    saved = gradient[free] @ scaled_solve(information, gradient[free])
    saved += np.sum(normal.gradient_jigs * np.linalg.solve(normal.jigs, normal.gradient_jigs[..., None])[..., 0])
    r = white @ lin.residual.reshape(*white.shape[:2], 1)
    prior = values[sigma > 0] / sigma[sigma > 0]
    cost = np.vdot(r, r) + prior @ prior - saved
    diagonals = np.diagonal(root, axis1=-2, axis2=-1)
    determinants = 2 * np.sum(np.log(diagonals)) + np.linalg.slogdet(information)[1]
    return float(cost + determinants + np.sum(np.linalg.slogdet(normal.jigs)[1]))


def with_noise(problem: Problem, point_scale: float, hand_noise: Array) -> Problem:
    """The problem with the points' covariances times ``point_scale`` and hand poses of covariance (F, 6, 6)."""
    points = replace(problem.points, cov_mm2=problem.points.cov_mm2 * point_scale)
    return replace(problem, points=points, chain=replace(problem.chain, noise=hand_noise))


def estimate_noise(
    problem: Problem, result: BundleResult, components: Sequence[Array], start: Array, points: bool
) -> Array:
    """Variances that make the residuals most likely: of the points (where ``points``), then of each hand component.

    components: covariances (F, 6, 6) of unit variance whose sum, each times its variance, is the hand poses' noise.
    start: first guess of the same variances, the points' one included (their factor; kept where ``points`` is false).
    """
    free = np.ones(len(start), dtype=bool)
    free[0] = points

    def of(log_variance: Array) -> float:
        values = start.copy()
        values[free] = np.exp(log_variance)
        hand = np.einsum("k,kfij->fij", values[1:], np.array(components))
        return deviance(with_noise(problem, values[0], hand), result)

    options = {"maxfev": _MAX_EVALUATIONS, "xatol": _LOG_TOLERANCE, "fatol": 1e-3}
    found = minimize(of, np.log(start[free]), method="Nelder-Mead", options=options)
    out = start.copy()
    out[free] = np.exp(found.x)
    return out
