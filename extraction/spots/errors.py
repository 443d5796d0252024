"""Covariance of the localised spots that may be kept, and how far each departs from a Gaussian beyond its noise."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from extraction.spots.localise import Spots
from extraction.spots.noise import NoiseModel
from extraction.spots.speckle import SHAPE_CONTRAST, estimate_speckle
from extraction.spots.spot_noise import SpotNoise, spot_noise, take

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
    is one. about: error budget, None for the fast method.
    """

    cov_uv_px2: Array
    skew_sigma: Array
    misfit: Array
    good: NDArray[np.bool_]
    about: SpotNoise | None

    def taken(self, which: NDArray[np.bool_]) -> SpotErrors:
        """Those of the spots ``which`` (N,)."""
        about = take(self.about, np.flatnonzero(which)) if self.about is not None else None
        return SpotErrors(self.cov_uv_px2[which], self.skew_sigma[which], self.misfit[which], self.good[which], about)


def spot_errors(spots: Spots, kept: NDArray[np.intp], noise: NoiseModel) -> SpotErrors:
    """Errors of the spots ``kept`` (N,), with the speckle that they show in the covariance."""
    if spots.fits is None or not len(kept):
        zero, given = np.zeros(len(kept)), spots.cov_uv_px2
        cov = given[kept] if given is not None else np.zeros((len(kept), 2, 2))
        return SpotErrors(cov, zero, zero, np.ones(len(kept), dtype=np.bool_), None)
    fits = spots.fits
    about = spot_noise(
        fits.data[kept], fits.use[kept], fits.size[kept], fits.parameters[kept], fits.terms[kept], fits.noises[kept]
    )
    speckle = estimate_speckle(about, spots.converged[kept], noise.speckle_contrast, noise.speckle_grain_px)
    cov = about.camera + about.speckle @ speckle.variances
    shape = SHAPE_CONTRAST**2 * about.variance_speckle[:, 0]
    expected = about.variance_camera + about.variance_speckle @ speckle.variances + shape
    misfit = (about.variance + about.variance_camera) / np.maximum(expected, LEAST_VARIANCE)
    # the Gaussian's own error, other from pose to pose, as if it were another noise of every pixel
    cov = cov + (MODEL_SHARE * noise.model_error) ** 2 * about.white
    position = cov[:, :2, :2]
    skew = about.skew / np.sqrt(np.maximum(cov[:, 2, 2], 1e-30))
    good = np.all(np.isfinite(cov), axis=(1, 2)) & (np.linalg.det(position) > 0)
    return SpotErrors(position, skew, misfit, good, about)
