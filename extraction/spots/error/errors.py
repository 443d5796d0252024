"""Covariance of the localised spots that may be kept, and how far each departs from a Gaussian beyond its noise."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from extraction.spots.error.budget import ErrorBudget, error_budget
from extraction.spots.error.speckle import PRIOR_GRAIN_PX, SHAPE_CONTRAST, estimate_speckle
from extraction.spots.frame import Fits
from extraction.spots.localise import LocalisedSpots
from extraction.spots.noise import FrameNoise

Array = NDArray[np.float64]

# what departs from a Gaussian moves a spot as independent errors of this share of `model_error` in every pixel would:
# between 0.36 and 1.35 for strings of 0.1 to 0.5 mm (benchmarks/extraction_model_error.py)
MODEL_SHARE = 0.6
LEAST_VARIANCE = 1e-9  # of residuals over the height's square: as many pixels as terms leave none


@dataclass(frozen=True, eq=False)
class SpotErrors:
    """Errors of the spots that were asked for.

    cov_uv_px2 (N, 2, 2): of the position. skew_sigma (N,): asymmetry along the long axis over what noise and speckle
    make of it. misfit (N,): variance of the residuals over what noise and speckle make of it. good (N,): the covariance
    is one. budget: what they are made of, None for the fast method. fits: of the spots that tell of the speckle
    where told (N,) says so.
    """

    cov_uv_px2: Array
    skew_sigma: Array
    misfit: Array
    good: NDArray[np.bool_]
    budget: ErrorBudget | None
    fits: Fits | None
    told: NDArray[np.bool_]

    def __getitem__(self, chosen: NDArray[np.intp]) -> SpotErrors:
        """Those of the chosen spots."""
        budget = self.budget[chosen] if self.budget is not None else None
        fits = self.fits[chosen] if self.fits is not None else None
        return SpotErrors(
            self.cov_uv_px2[chosen], self.skew_sigma[chosen], self.misfit[chosen], self.good[chosen], budget, fits,
            self.told[chosen],
        )  # fmt: skip


def spot_errors(spots: LocalisedSpots, kept: NDArray[np.intp], noise: FrameNoise) -> SpotErrors:
    """Errors of the spots ``kept`` (N,), with the speckle that they show in the covariance."""
    if spots.fits is None or not len(kept):
        zero, given = np.zeros(len(kept)), spots.cov_uv_px2
        cov = given[kept] if given is not None else np.zeros((len(kept), 2, 2))
        every = np.ones(len(kept), dtype=np.bool_)
        return SpotErrors(cov, zero, zero, every, None, None, every)
    fits = spots.fits[kept]
    budget = error_budget(fits)
    alone = np.ones(len(kept), dtype=np.bool_)
    for k, one in enumerate(kept.tolist()):
        if one in spots.joint:  # the other's place is not known either
            errors, alone[k] = spots.joint[one], False
            budget.camera[k, :2, :2], budget.speckle[k, :2, :2] = errors.camera, errors.speckle
            budget.white[k, :2, :2] = errors.white
    # the other's grains are left in a joint fit's residuals: it speaks for the speckle where no spot stands alone
    told = spots.converged[kept] & (alone | ~np.any(spots.converged[kept] & alone))
    # one image's spots do not tell the grain
    grain = PRIOR_GRAIN_PX if noise.speckle_grain_px is None else noise.speckle_grain_px
    own = MODEL_SHARE * noise.model_error
    speckle = estimate_speckle([fits[np.flatnonzero(told)]], own, noise.speckle_contrast, grain)
    cov = budget.camera + budget.speckle @ speckle.variances
    shape = SHAPE_CONTRAST**2 * budget.variance_speckle[:, 0]
    expected = budget.variance_camera + budget.variance_speckle @ speckle.variances + shape
    misfit = (budget.variance + budget.variance_camera) / np.maximum(expected, LEAST_VARIANCE)
    # the Gaussian's own error, other from pose to pose, as if it were another noise of every pixel
    cov = cov + (MODEL_SHARE * noise.model_error) ** 2 * budget.white
    position = cov[:, :2, :2]
    skew = budget.skew / np.sqrt(np.maximum(cov[:, 2, 2], 1e-30))
    good = np.all(np.isfinite(cov), axis=(1, 2)) & (np.linalg.det(position) > 0)
    return SpotErrors(position, skew, misfit, good, budget, fits, told)
