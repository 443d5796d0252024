"""Localisation of single spots in a stack of small images: the compiled fit for users who bring their own windows."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from extraction.noise import PixelNoise
from extraction.spots.fit import FIT, FittedSpots, Window, fit_window, write_fit
from extraction.spots.model import FLAT, SPOT, Array, Spot, precision, shapes_px2
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
    """Maximum-likelihood position of the one spot in each image of a stack.

    Parameters
    ----------
    images
        (N, H, W), H and W at least 5, in any unit in which the noise below holds.
    read_variance
        Variance of a pixel without light, in that unit squared.
    gain
        The noise of a pixel of mean μ is read_variance + gain · μ + (speckle_contrast · signal)²; 1 for electrons.
    speckle_contrast
        See there.
    saturation
        Pixels at or above it are left out.
    max_iterations
        Steps of a fit before it is given up.

    Returns
    -------
    fits
        Position, covariance [px²], height, background and shape of each.

    Raises
    ------
    InputError
        For another shape, values that are not finite, or no noise at all.

    Examples
    --------
    >>> from extraction.spots import TrueSpot, mean_image
    >>> spot = mean_image(TrueSpot(5.2, 4.9, 3000.0, 1.3, 1.3), (11, 11))
    >>> fit_stack(spot[None], 25.0).uv_px.round(2)
    array([[5.2, 4.9]])
    """
    data = np.ascontiguousarray(images, dtype=np.float64)
    if data.ndim != 3 or min(data.shape[1:]) < 5:
        raise InputError(f"a stack of images must have shape (N, H, W) with H, W ≥ 5, not {data.shape}")
    if not read_variance > 0:
        raise InputError(f"read_variance {read_variance:g}: must be above 0, quantisation alone gives 1/12 grey level²")
    if not np.all(np.isfinite(data)):
        raise InputError("the stack holds values that are not finite")
    found = FittedSpots(np.zeros(len(data), SPOT), np.zeros(len(data), FIT))
    noise = PixelNoise(float(read_variance), float(gain), 0.0, float(speckle_contrast) ** 2)
    _fit_all(data, noise, float(saturation), max_iterations, found)
    spot, fit = found
    covariance = np.stack([fit[name] for name in ("cov_uu", "cov_uv", "cov_uv", "cov_vv")], axis=1)
    return StackFits(
        uv_px=np.column_stack([spot["u"], spot["v"]]), cov_uv_px2=covariance.reshape(-1, 2, 2),
        height=spot["height"], background=spot["level"], shape_px2=shapes_px2(spot), chi2=fit["chi2"],
        converged=fit["converged"],
    )  # fmt: skip


@kernel
def _fit_all(data: Array, noise: PixelNoise, saturation: float, max_iterations: int, found: FittedSpots) -> None:
    """Fit every image (N, H, W); fill what was found (N,)."""
    use = np.ones((data.shape[1], data.shape[2]), np.bool_)
    for k in range(data.shape[0]):
        for j in range(data.shape[1]):
            for i in range(data.shape[2]):
                use[j, i] = data[k, j, i] < saturation
        window = Window(data[k, :, :], use[:, :])
        write_fit(fit_window(window, _start(window), FLAT, noise, max_iterations), found, k)


@kernel
def _start(window: Window) -> Spot:
    """Start: background from the border, centre and widths from moments around the brightest 3 × 3."""
    data, use = window.grey, window.use
    rows, columns = data.shape
    border, count = 0.0, 0
    for j in range(rows):
        for i in range(columns):
            if (j == 0 or i == 0 or j == rows - 1 or i == columns - 1) and use[j, i]:
                border += data[j, i]
                count += 1
    level = border / max(count, 1)
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
            w = max(data[j, i] - level, 0.0)
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
    height = max(best / 9.0 - level, 1e-3 * abs(best) + 1e-6) * 1.3  # the mean of nine pixels lies below the peak
    form = precision(xx, xy, yy)
    return Spot(u + x, v + y, height, form[0], form[1], form[2], level, 0.0, 0.0)
