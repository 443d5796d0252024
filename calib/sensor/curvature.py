"""What the bend of the cost's valley adds to a covariance: tilt, tangential terms and principal point trade places.

Along directions of which the views tell little, the parameters that agree with them lie on a curve. A covariance at its
middle is that of the tangent there; far out on the curve the parameters that are known well have moved by many of their
σ. What is stated are second moments about the solution, the curve's sag to second order in them.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from calib.engine import Covariance, Result
from calib.sensor.bundle import SensorBundle
from calib.sensor.left_out import stacked_rows
from calib.sensor.terms import BOARD
from geometry import State, Step

Array = NDArray[np.float64]

DIRECTIONS = 3  # of least knowledge: a tilt about two axes, and focal length with distance


def with_bend(bundle: SensorBundle, result: Result, cov: Covariance) -> Covariance:
    """The covariance of the common unknowns with what the valley's bend adds.

    With t independent of unit variance along directions d_k, what agrees with the views is Σ d_k t_k and
    ½ Σ b_kl t_k t_l beside it; the mean of t_k t_l t_m t_n sums over the three ways to pair them.
    """
    free = result.unknowns.free
    tangent = cov.total[np.ix_(free, free)]
    bends = _bends(bundle, result, tangent, _least_known(tangent))
    mean = np.trace(bends)
    more = (np.outer(mean, mean) + 2 * np.einsum("kli,klj->ij", bends, bends)) / 4
    total = cov.total.copy()
    total[np.ix_(free, free)] += more
    return replace(cov, total=total)


def _least_known(covariance: Array) -> Array:
    """Directions (K, C), each a standard deviation long, in which most parameters move together."""
    scale = np.sqrt(np.diag(covariance))
    values, vectors = np.linalg.eigh(covariance / np.outer(scale, scale))
    return np.asarray((np.sqrt(np.maximum(values, 0.0)) * vectors * scale[:, None]).T[: -DIRECTIONS - 1 : -1])


def _bends(bundle: SensorBundle, result: Result, covariance: Array, along: Array) -> Array:
    """How the free common unknowns follow second differences along pairs of directions (K, K, C)."""
    rows = stacked_rows(bundle, result)
    follow = np.zeros((len(bundle.views), rows.pose.shape[1], covariance.shape[0]))  # of the boards
    clear = rows.common.copy()
    for v in range(len(bundle.views)):
        mine = rows.view == v
        a, b = rows.common[mine], rows.pose[mine]
        follow[v] = -np.linalg.lstsq(b, a, rcond=None)[0]
        clear[mine] = a + b @ follow[v]

    def at(direction: Array) -> Array:
        return _residual(bundle, _moved(result, direction, follow @ direction))

    k, here = len(along), _residual(bundle, result.state)
    twice = {(i, j): at(along[i] + along[j]) + at(-along[i] - along[j]) - 2 * here for i in range(k) for j in range(i)}
    out = np.zeros((k, k, covariance.shape[0]))
    own = [at(d) + at(-d) - 2 * here for d in along]
    for i in range(k):
        out[i, i] = -covariance @ (clear.T @ own[i])
        for j in range(i):
            mixed = (twice[i, j] - own[i] - own[j]) / 2
            out[i, j] = out[j, i] = -covariance @ (clear.T @ mixed)
    return out


def _moved(result: Result, common: Array, boards: Array) -> State:
    u = result.unknowns
    step = np.zeros(u.size)
    step[u.free] = common
    return result.state.moved(u, Step(step, {BOARD: boards}, 0.0))


def _residual(bundle: SensorBundle, state: State) -> Array:
    return np.concatenate([term.independent_rows(state).residual for term in bundle.evidence])
