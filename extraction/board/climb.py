"""Many small least-squares fits at once: Levenberg and Marquardt's steps, each fit with a damping of its own."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

_STEPS = 25
_SETTLED_PX = 1e-4


def climb(
    model: Callable[[Array], tuple[Array, Array, Array]], start: Array, limits: tuple[Array, Array], most: Array
) -> tuple[Array, Array, Array]:
    """Parameters (N, K), the first two a place [px], at the least cost (N,), and the Jacobian (N, P, K) there.

    model: cost (N,), Jacobian (N, P, K) and residual (N, P) of parameters; limits: least and largest (K,); most: of a
    step (K,).
    """
    p, damping = start, np.full(len(start), 1e-3)
    cost, jac, res = model(p)
    for _ in range(_STEPS):
        normal = np.einsum("npi,npj->nij", jac, jac)
        gradient = np.einsum("npi,np->ni", jac, res)
        diagonal = np.einsum("nii->ni", normal)
        lifted = normal + damping[:, None, None] * np.einsum("ni,ij->nij", diagonal + 1e-9, np.eye(p.shape[1]))
        step = np.clip(-np.linalg.solve(lifted, gradient[..., None])[..., 0], -most, most)
        trial = np.clip(p + step, *limits)
        new_cost, new_jac, new_res = model(trial)
        better = new_cost <= cost
        p, cost = np.where(better[:, None], trial, p), np.where(better, new_cost, cost)
        jac, res = np.where(better[:, None, None], new_jac, jac), np.where(better[:, None], new_res, res)
        damping = np.where(better, damping / 5, np.minimum(damping * 10, 1e6))
        if np.all(~better | (np.abs(step[:, :2]).max(axis=1) < _SETTLED_PX)):
            break
    return p, cost, jac


def position_covariance(jac: Array, cost: Array, count: Array) -> Array:
    """Of the first two parameters (N, 2, 2), the noise told by the residuals of ``count`` (N,) pixels."""
    size = jac.shape[-1]
    normal = np.einsum("npi,npj->nij", jac, jac)
    scale = 1 / np.sqrt(np.maximum(np.einsum("nii->ni", normal), 1e-12))
    unit = normal * scale[:, :, None] * scale[:, None] + 1e-12 * np.eye(size)
    inverse = np.linalg.inv(unit) * scale[:, :, None] * scale[:, None]
    return np.asarray(inverse[:, :2, :2] * (cost / np.maximum(count - size, 1))[:, None, None])
