"""The Cramér-Rao bound of a spot's position: the best that any unbiased method can do.

F = Σ ∂μ ∂μᵀ / (μ + r² + q²/12) over the pixels, μ the spot integrated over the pixel plus background, all in electrons,
r the read noise, q electrons per grey level; free are u, v, N, background and the shape (σ, or three of an ellipse).
Clipped pixels are left out. (Rieger & Stallinga, ChemPhysChem 15, 2014; the pixel's integral by quadrature, not by the
approximation that the fit makes.)
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

NODES = 7  # Gauss-Legendre nodes a pixel and axis: exact to 1e-9 of the height for σ ≥ 0.5


@dataclass(frozen=True)
class TrueSpot:
    """A spot as a test knows it: centre [px], electrons in all, widths along and across [px], direction of the long
    axis [rad], background [e⁻/px].
    """

    u_px: float
    v_px: float
    electrons: float
    along_px: float
    across_px: float
    axis_rad: float = 0.0
    background_e: float = 0.0


def mean_image(spot: TrueSpot, shape: tuple[int, int]) -> Array:
    """The mean image of a true spot, integrated over every pixel by quadrature.

    Parameters
    ----------
    spot
        The truth.
    shape
        Rows and columns of the image.

    Returns
    -------
    mean
        Electrons (rows, columns).
    """
    return _moments(spot, shape)[0] * spot.electrons + spot.background_e


def position_bound(
    spot: TrueSpot, shape: tuple[int, int], read_noise_e: float, e_per_dn: float = 0.0, round_spot: bool = False,
    clip_e: float = np.inf,
) -> Array:  # fmt: skip
    """Cramér-Rao bound of a spot's position, with height, background and shape unknown.

    Parameters
    ----------
    spot
        The truth.
    shape
        Rows and columns of the image.
    read_noise_e
        Standard deviation of a pixel in the dark [e⁻].
    e_per_dn
        Electrons per grey level, for the noise of rounding; 0 for none.
    round_spot
        One width is unknown instead of an ellipse's three.
    clip_e
        Pixels whose mean is above it are left out [e⁻].

    Returns
    -------
    bound
        Covariance (2, 2) of (u, v) [px²] that no unbiased method can beat.

    References
    ----------
    Rieger & Stallinga, ChemPhysChem 15 (2014) 664.
    """
    g, by = _moments(spot, shape)
    mean = g * spot.electrons + spot.background_e
    shape_terms = [by["xx"] + by["yy"]] if round_spot else [by["xx"], by["xy"], by["yy"]]
    columns = [spot.electrons * by["x"], spot.electrons * by["y"], g, np.ones_like(g), *shape_terms]
    jacobian = np.stack([c.ravel() for c in columns], axis=1)
    weight = np.where(mean.ravel() < clip_e, 1.0 / (mean.ravel() + read_noise_e**2 + e_per_dn**2 / 12.0), 0.0)
    scale = np.sqrt(np.sum(jacobian**2, axis=0))
    jacobian = jacobian / scale
    bound = np.linalg.inv(jacobian.T @ (jacobian * weight[:, None]))
    return np.asarray(bound[:2, :2] / np.outer(scale[:2], scale[:2]))


def _moments(spot: TrueSpot, shape: tuple[int, int]) -> tuple[Array, dict[str, Array]]:
    """Pixel integrals of the unit spot, and of its derivatives by centre (x, y) and by covariance up to factors."""
    nodes, weights = np.polynomial.legendre.leggauss(NODES)
    u = (np.arange(shape[1])[:, None] + 0.5 * nodes).ravel() - spot.u_px
    v = (np.arange(shape[0])[:, None] + 0.5 * nodes).ravel() - spot.v_px
    turn = np.array([[np.cos(spot.axis_rad), -np.sin(spot.axis_rad)], [np.sin(spot.axis_rad), np.cos(spot.axis_rad)]])
    precision = turn @ np.diag([spot.along_px**-2, spot.across_px**-2]) @ turn.T
    x, y = np.meshgrid(u, v)
    a = precision[0, 0] * x + precision[0, 1] * y
    b = precision[0, 1] * x + precision[1, 1] * y
    density = np.exp(-0.5 * (a * x + b * y)) / (2 * np.pi * spot.along_px * spot.across_px)
    weight = 0.25 * np.outer(weights, weights)

    def integrate(values: Array) -> Array:
        blocks = values.reshape(shape[0], NODES, shape[1], NODES)
        return np.asarray(np.einsum("iajb,ab->ij", blocks, weight))

    p = precision
    by = {
        "x": integrate(a * density),
        "y": integrate(b * density),
        "xx": integrate((a * a - p[0, 0]) * density),
        "xy": integrate((a * b - p[0, 1]) * density),
        "yy": integrate((b * b - p[1, 1]) * density),
    }
    return integrate(density), by
