"""The fast method: the parabola through the logarithm of the blurred peak's 3 × 3 pixels."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

# least-squares coefficients of 1, x, y, x², xy, y² from nine values in reading order
_X, _Y = np.tile([-1.0, 0.0, 1.0], 3), np.repeat([-1.0, 0.0, 1.0], 3)
_FIT = np.linalg.pinv(np.column_stack([np.ones(9), _X, _Y, _X**2, _X * _Y, _Y**2]))
LEAST_SHARE = 1e-3  # of the peak: a pixel below the background has no logarithm


@dataclass(frozen=True, eq=False)
class PeakFits:
    """uv_px (N, 2), cov_uv_px2 (N, 2, 2), height_dn (N,) and shape_px2 (N, 2, 2) of peaks; converged (N,)."""

    uv_px: Array
    cov_uv_px2: Array
    height_dn: Array
    shape_px2: Array
    converged: NDArray[np.bool_]


def fit_peaks(
    smooth: NDArray[np.float32], peaks: NDArray[np.intp], background: Array, variance: Array, kernel: Array
) -> PeakFits:
    """Sub-pixel position of the peaks of a blurred image: the parabola through the logarithm of 3 × 3 pixels.

    A Gaussian's logarithm is a parabola, so that for a Gaussian spot only the pixel's integration and noise are left;
    the covariance carries the pixel noise through the blur and the parabola.

    Parameters
    ----------
    smooth
        The blurred image (H, W) [DN].
    peaks
        Brightest pixels (N, 2), column first.
    background
        Level around each (N,) [DN].
    variance
        Of a raw pixel at each peak (N,) [DN²].
    kernel
        The separable blur's row (K,), of sum 1.

    Returns
    -------
    fits
        Position and covariance [px], height and shape of the raw spots; converged where the parabola has a top nearby.
    """
    rows, columns = smooth.shape
    u, v = np.clip(peaks[:, 0], 1, columns - 2), np.clip(peaks[:, 1], 1, rows - 2)
    values = smooth[v[:, None] + _Y.astype(int), u[:, None] + _X.astype(int)] - background[:, None]
    values = np.maximum(values, LEAST_SHARE * np.maximum(values[:, 4:5], 1e-6))
    c = np.log(values) @ _FIT.T
    curvature = -np.stack([np.stack([2 * c[:, 3], c[:, 4]], -1), np.stack([c[:, 4], 2 * c[:, 5]], -1)], -2)
    good = (curvature[:, 0, 0] > 0) & (np.linalg.det(curvature) > 1e-6)
    blurred = np.linalg.inv(np.where(good[:, None, None], curvature, np.eye(2)))
    offset = np.einsum("nij,nj->ni", blurred, c[:, 1:3])
    moves = np.einsum("nij,jk,nk->nik", blurred, _FIT[1:3], 1.0 / values)
    cov = np.einsum("nik,kl,njl->nij", moves, _blurred_noise(kernel), moves) * variance[:, None, None]
    height = np.exp(c[:, 0] + 0.5 * np.einsum("ni,ni->n", c[:, 1:3], offset))
    width = np.sum(kernel * (np.arange(len(kernel)) - len(kernel) // 2) ** 2)  # the blur's own variance
    good &= np.all(np.abs(offset) < 1.5, axis=1)
    shape = blurred - width * np.eye(2)
    raw = height * np.sqrt(np.maximum(np.linalg.det(blurred), 0.0) / np.maximum(np.linalg.det(shape), 1e-3))
    return PeakFits(np.column_stack([u, v]) + offset, cov, raw, shape, good)


def _blurred_noise(kernel: Array) -> Array:
    """Covariance (9, 9) of the 3 × 3 blurred pixels from white noise of variance 1."""
    auto = np.correlate(kernel, kernel, mode="full")
    middle = len(kernel) - 1
    lag = auto[middle : middle + 3]
    return np.asarray(lag[np.abs(_X[:, None] - _X).astype(int)] * lag[np.abs(_Y[:, None] - _Y).astype(int)])
