"""Error budget of fitted spots: what camera noise and correlated speckle do to them, and what their residuals say.

Speckle puts the error c · s_i · e_i into pixel i: s the spot's signal, e of unit variance, correlated by ρ(distance).
A linear estimate moves by Σ h_i · error_i with the influence h_i = F⁻¹ J_i w_i, so that whatever the weights w were

    Cov = Σ_i h_i V_i h_iᵀ + c² Σ_ij h_i s_i ρ_ij s_j h_jᵀ,    V the camera's variance,

and the residuals r = (1 - H) error, H_ij = J_iᵀ F⁻¹ J_j w_j, have moments of the same form. Both are sums over the
pairs whose distance is of class k, so that the contrast c and the correlation ρ can be chosen afterwards.
"""

from __future__ import annotations

from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import NDArray

from extraction.spots.error.influence import CAMERA, CLASSES, PRODUCT, SPECKLE, Budgets, budgets
from extraction.spots.frame import Fits

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class ErrorBudget:
    """Error budget of N spots; the last axis of what comes from speckle of contrast 1 is the class of distance (K,).

    camera (N, 3, 3), speckle (N, 3, 3, K): Cov of (u, v, skew), NaN where the fit has none. white (N, 3, 3): the same
    of independent errors as large as the spot's height. skew (N,): third moment
    along the long axis that the fit left. variance (N,): Σ residual² over the core, over the height's square, the
    camera's part taken off; variance_camera (N,): that part. variance_speckle (N, K): its expectation.
    """

    camera: Array
    speckle: Array
    white: Array
    skew: Array
    variance: Array
    variance_camera: Array
    variance_speckle: Array

    def __getitem__(self, chosen: NDArray[np.intp]) -> ErrorBudget:
        """The budgets of the chosen spots."""
        return ErrorBudget(*(getattr(self, f.name)[chosen] for f in fields(self)))


def error_budget(fits: Fits) -> ErrorBudget:
    """Error budget of N fits."""
    n = len(fits.spot)
    out = Budgets(
        np.zeros((n, 3, 3)), np.zeros((n, 3, 3, CLASSES)), np.zeros((n, 3, 3)), np.zeros(n),
        np.zeros((n, SPECKLE + CLASSES)),
    )  # fmt: skip
    budgets(fits.windows, fits.place, fits.spot, fits.noise, out)
    return ErrorBudget(
        camera=out.camera,
        speckle=out.speckle,
        white=out.white * fits.spot["height"][:, None, None] ** 2,
        skew=out.skew,
        variance=out.moments[:, PRODUCT],
        variance_camera=out.moments[:, CAMERA],
        variance_speckle=out.moments[:, SPECKLE:],
    )
