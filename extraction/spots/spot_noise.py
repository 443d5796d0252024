"""Error budget of fitted spots: what camera noise and correlated speckle do to them, and what their residuals say.

Speckle puts the error c · s_i · e_i into pixel i: s the spot's signal, e of unit variance, correlated by ρ(distance).
A linear estimate moves by Σ h_i · error_i with the influence h_i = F⁻¹ J_i w_i, so that whatever the weights w were

    Cov = Σ_i h_i V_i h_iᵀ + c² Σ_ij h_i s_i ρ_ij s_j h_jᵀ,    V the camera's variance,

and the residuals r = (1 - H) error, H_ij = J_iᵀ F⁻¹ J_j w_j, have moments of the same form. Both are sums over the
pairs whose distance is of class k, so that the contrast c and the correlation ρ can be chosen afterwards.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import NDArray

from extraction.spots.budget import CAMERA, CLASSES, NEIGHBOUR, OWN, PRODUCT, SPECKLE, budgets

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class SpotNoise:
    """Error budget of N spots; the last axis of what comes from speckle of contrast 1 is the class of distance (K,).

    camera (N, 3, 3), speckle (N, 3, 3, K): Cov of (u, v, skew), NaN where the fit has none. white (N, 3, 3): the same
    of independent errors as large as the spot's height. skew (N,): third moment
    along the long axis that the fit left. variance, neighbour (N,): Σ residual² over the core and Σ of neighbours'
    products, over the height's square, the camera's part taken off; variance_camera (N,): that part of the former.
    variance_speckle, neighbour_speckle (N, K): expectation of both.
    """

    camera: Array
    speckle: Array
    white: Array
    skew: Array
    variance: Array
    neighbour: Array
    variance_camera: Array
    variance_speckle: Array
    neighbour_speckle: Array


def concatenate(parts: Sequence[SpotNoise]) -> SpotNoise:
    """The budgets of several groups of spots as one."""
    return SpotNoise(*(np.concatenate([getattr(part, f.name) for part in parts]) for f in fields(SpotNoise)))


def take(about: SpotNoise, index: NDArray[np.intp]) -> SpotNoise:
    """The budgets of the spots ``index``."""
    return SpotNoise(*(getattr(about, f.name)[index] for f in fields(SpotNoise)))


def spot_noise(
    data: Array, use: Mask, size: NDArray[np.int64], parameters: Array, terms: NDArray[np.int64], noises: Array
) -> SpotNoise:
    """Error budget of the fits ``parameters`` (N, 9) of the windows data (N, R, C) over the pixels ``use``.

    size (N, 2): columns and rows that a window fills. terms (N,), noises (N, 5): as in `gaussian_fit.fit_window`;
    positions from each window's first pixel.
    """
    n = len(parameters)
    camera, speckle, white = np.zeros((n, 3, 3)), np.zeros((n, 3, 3, CLASSES)), np.zeros((n, 3, 3))
    skew, moments = np.zeros(n), np.zeros((n, 2, SPECKLE + CLASSES))
    budgets(data, use, size, parameters, terms, noises, camera, speckle, white, skew, moments)
    white *= parameters[:, 2, None, None] ** 2
    return SpotNoise(
        camera, speckle, white, skew, moments[:, OWN, PRODUCT], moments[:, NEIGHBOUR, PRODUCT],
        moments[:, OWN, CAMERA], moments[:, OWN, SPECKLE:], moments[:, NEIGHBOUR, SPECKLE:],
    )  # fmt: skip
