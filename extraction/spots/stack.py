"""Localisation of single spots in a stack of small images: the compiled fit for users who bring their own windows."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from extraction.spots.fit import PIXEL_VARIANCE_PX2, RESULT_COLUMNS, Array, Mask, fit_window
from geometry import InputError
from geometry.compiled import kernel


@dataclass(frozen=True, eq=False)
class StackFits:
    """One spot per image: uv_px (N, 2), cov_uv_px2 (N, 2, 2), height and background (N,) in the image's unit,
    shape_px2 (N, 2, 2) without the pixel's own share, chi2 (N,), converged (N,).
    """

    uv_px: Array
    cov_uv_px2: Array
    height: Array
    background: Array
    shape_px2: Array
    chi2: Array
    converged: NDArray[np.bool_]


def fit_stack(
    images: ArrayLike,
    read_variance: float,
    gain: float = 1.0,
    speckle_contrast: float = 0.0,
    saturation: float = np.inf,
    max_iterations: int = 30,
) -> StackFits:
    """Maximum-likelihood position of the one spot in each image of a stack (N, H, W), H and W at least 5.

    The noise of a pixel of mean μ is read_variance + gain · μ + (speckle_contrast · signal)², in the images' unit; with
    electrons gain is 1. Pixels at or above ``saturation`` are left out.
    """
    data = np.ascontiguousarray(images, dtype=np.float64)
    if data.ndim != 3 or min(data.shape[1:]) < 5:
        raise InputError(f"a stack of images must have shape (N, H, W) with H, W ≥ 5, not {data.shape}")
    if not read_variance > 0:
        raise InputError(f"read_variance {read_variance:g}: must be above 0, quantisation alone gives 1/12 grey level²")
    if not np.all(np.isfinite(data)):
        raise InputError("the stack holds values that are not finite")
    table = np.zeros((len(data), RESULT_COLUMNS + 1))
    noise = np.array([read_variance, gain, 0.0, speckle_contrast**2, 0.0])
    _fit_all(data, noise, saturation, max_iterations, table)
    shape = np.linalg.inv(table[:, [3, 4, 4, 5]].reshape(-1, 2, 2)) - PIXEL_VARIANCE_PX2 * np.eye(2)
    return StackFits(
        uv_px=table[:, :2], cov_uv_px2=table[:, [9, 10, 10, 11]].reshape(-1, 2, 2), height=table[:, 2],
        background=table[:, 6], shape_px2=shape, chi2=table[:, 12], converged=table[:, RESULT_COLUMNS] > 0,
    )  # fmt: skip


@kernel
def _fit_all(data: Array, noise: Array, saturation: float, max_iterations: int, table: Array) -> None:
    start = np.zeros(9)
    use = np.ones((data.shape[1], data.shape[2]), np.bool_)
    for k in range(data.shape[0]):
        for j in range(data.shape[1]):
            for i in range(data.shape[2]):
                use[j, i] = data[k, j, i] < saturation
        values, valid = data[k, :, :], use[:, :]
        _start(values, valid, start)
        table[k, RESULT_COLUMNS] = fit_window(values, valid, start, 7, noise, max_iterations, table[k])


@kernel
def _start(data: Array, use: Mask, p: Array) -> None:
    """Start parameters: background from the border, centre and widths from moments around the brightest 3 × 3."""
    rows, columns = data.shape
    border, count = 0.0, 0
    for j in range(rows):
        for i in range(columns):
            if (j == 0 or i == 0 or j == rows - 1 or i == columns - 1) and use[j, i]:
                border += data[j, i]
                count += 1
    background = border / max(count, 1)
    best, u, v = -1e300, 0, 0
    for j in range(1, rows - 1):
        for i in range(1, columns - 1):
            total = 0.0
            for b in range(-1, 2):
                for a in range(-1, 2):
                    total += data[j + b, i + a]
            if total > best:
                best, u, v = total, i, j
    total, x, y, xx, xy, yy = 1e-12, 0.0, 0.0, 0.0, 0.0, 0.0
    for j in range(max(0, v - 3), min(rows, v + 4)):
        for i in range(max(0, u - 3), min(columns, u + 4)):
            w = max(data[j, i] - background, 0.0)
            a, b = i - u, j - v
            total += w
            x += w * a
            y += w * b
            xx += w * a * a
            xy += w * a * b
            yy += w * b * b
    x, y = x / total, y / total
    xx, yy = min(max(xx / total - x * x, 0.5), 6.0), min(max(yy / total - y * y, 0.5), 6.0)
    limit = 0.7 * (xx * yy) ** 0.5
    xy = min(max(xy / total - x * y, -limit), limit)
    det = xx * yy - xy * xy
    p[0], p[1], p[2] = u + x, v + y, max(best / 9.0 - background, 1e-3 * abs(best) + 1e-6) * 1.3
    p[3], p[4], p[5], p[6], p[7], p[8] = yy / det, -xy / det, xx / det, background, 0.0, 0.0
