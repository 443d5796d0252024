"""Corners of a checkerboard to the limit of the pixels' noise: two blurred edges that cross, fitted to grey levels.

A corner's grey levels are m + a · E(d₁) · E(d₂) with E the error function of the distances from two edges over the
blur's width, and a plane of light on top: nine numbers, all corners of a picture at once.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from extraction.board.climb import climb, position_covariance
from geometry.special import erf

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

_BLUR_PX = (0.3, 12.0)  # Gaussian σ of an edge: from as sharp as pixels allow to far out of focus
_MIN_SHARE = 0.6  # of a window's pixels that must be usable
_PARAMETERS = 9  # u, v, θ₁, θ₂, log blur, level, contrast, two slopes of the light


@dataclass(frozen=True, eq=False)
class Saddles:
    """Fitted corners.

    uv_px (N, 2), covariance_px2 (N, 2, 2), blur_px (N,): σ of the edges, contrast_dn (N,): half the step between dark
    and bright, positive where the quadrant between the two directions is bright, misfit_dn (N,): root mean square
    residual, good (N,): settled near its start with usable pixels enough.
    """

    uv_px: Array
    covariance_px2: Array
    blur_px: Array
    contrast_dn: Array
    misfit_dn: Array
    good: Mask


def fit_saddles(image: NDArray[np.generic], start_px: Array, along: Array, radius_px: int, usable: Mask) -> Saddles:
    """Fit corners near ``start_px`` (N, 2) whose edges run along two directions (N, 2, 2), one a row.

    radius_px: of the round window. usable (H, W): pixels that may be used.
    """
    n = len(start_px)
    grey, weight, grid = _windows(image, usable, start_px, radius_px)
    p = np.zeros((n, _PARAMETERS))
    p[:, :2] = start_px - np.round(start_px)
    p[:, 2:4] = np.arctan2(along[:, :, 1], along[:, :, 0])
    p[:, 4] = np.log(1.0)
    p[:, 5:] = _linear(p, grey, weight, grid)
    low, high = np.full(_PARAMETERS, -np.inf), np.full(_PARAMETERS, np.inf)
    low[4], high[4] = np.log(_BLUR_PX)
    most = np.array([1.0, 1.0, np.inf, np.inf, 0.5, *[np.inf] * 4])
    p, cost, jac = climb(lambda q: _model(q, grey, weight, grid), p, (low, high), most)
    count = weight.sum(axis=1)
    uv = np.round(start_px) + p[:, :2]
    moved = np.linalg.norm(uv - start_px, axis=1)
    good = (count > _MIN_SHARE * weight.shape[1]) & (moved < 0.5 * radius_px) & np.isfinite(cost)
    return Saddles(
        uv,
        position_covariance(jac, cost, count),
        np.exp(p[:, 4]),
        p[:, 6],
        np.sqrt(cost / np.maximum(count, 1)),
        good,
    )


def _windows(image: NDArray[np.generic], usable: Mask, at: Array, radius: int) -> tuple[Array, Array, Array]:
    """Grey levels and weights (N, P) of the pixels of round windows, and their places (P, 2) about the middle one."""
    span = np.arange(-radius, radius + 1)
    grid = np.stack(np.meshgrid(span, span), -1).reshape(-1, 2)
    grid = grid[np.hypot(*grid.T) <= radius + 0.5]
    height, width = image.shape
    places = np.round(at).astype(int)[:, None] + grid
    inside = (places >= 0).all(-1) & (places[..., 0] < width) & (places[..., 1] < height)
    u, v = np.clip(places[..., 0], 0, width - 1), np.clip(places[..., 1], 0, height - 1)
    return image[v, u].astype(float), (inside & usable[v, u]).astype(float), grid.astype(float)


def _edges(p: Array, grid: Array) -> tuple[Array, Array, Array, Array]:
    """Distances (N, 2, P) of pixels from both edges, the edges' levels, their slopes, and x, y from the corner."""
    x, y = grid[None, :, 0] - p[:, :1], grid[None, :, 1] - p[:, 1:2]
    xy = np.stack([x, y], 1)
    c, s = np.cos(p[:, 2:4, None]), np.sin(p[:, 2:4, None])
    d = c * y[:, None] - s * x[:, None]
    blur = np.exp(p[:, 4])[:, None, None]
    return d, erf(d / (np.sqrt(2) * blur)), np.sqrt(2 / np.pi) / blur * np.exp(-0.5 * (d / blur) ** 2), xy


def _model(p: Array, grey: Array, weight: Array, grid: Array) -> tuple[Array, Array, Array]:
    """Cost (N,), weighted Jacobian (N, P, 9) and residual (N, P)."""
    d, level, slope, xy = _edges(p, grid)
    product = level[:, 0] * level[:, 1]
    a = p[:, 6, None]
    res = (p[:, 5, None] + a * product + p[:, 7, None] * xy[:, 0] + p[:, 8, None] * xy[:, 1] - grey) * weight
    jac = np.empty((*grey.shape, _PARAMETERS))
    by_d = [a * slope[:, 0] * level[:, 1], a * slope[:, 1] * level[:, 0]]
    c, s = np.cos(p[:, 2:4, None]), np.sin(p[:, 2:4, None])
    jac[..., 0] = by_d[0] * s[:, 0] + by_d[1] * s[:, 1] - p[:, 7, None]
    jac[..., 1] = -by_d[0] * c[:, 0] - by_d[1] * c[:, 1] - p[:, 8, None]
    for k in range(2):
        jac[..., 2 + k] = by_d[k] * (-s[:, k] * xy[:, 1] - c[:, k] * xy[:, 0])
    jac[..., 4] = -by_d[0] * d[:, 0] - by_d[1] * d[:, 1]
    jac[..., 5], jac[..., 6], jac[..., 7], jac[..., 8] = 1.0, product, xy[:, 0], xy[:, 1]
    jac *= weight[..., None]
    return np.sum(res**2, axis=1), jac, res


def _linear(p: Array, grey: Array, weight: Array, grid: Array) -> Array:
    """Level, contrast and slopes (N, 4) that fit best at the start."""
    _, level, _, xy = _edges(p, grid)
    basis = np.stack([np.ones_like(grey), level[:, 0] * level[:, 1], xy[:, 0], xy[:, 1]], -1) * weight[..., None]
    normal = np.einsum("npi,npj->nij", basis, basis) + 1e-9 * np.eye(4)
    return np.asarray(np.linalg.solve(normal, np.einsum("npi,np->ni", basis, grey * weight)[..., None])[..., 0])
