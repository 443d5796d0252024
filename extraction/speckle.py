"""Contrast and grain of the speckle, as the residuals of fitted spots show them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from extraction.spot_noise import DISTANCES2, SpotNoise

Array = NDArray[np.float64]

# what is expected where an image does not tell, with its spread (ln)
PRIOR_CONTRAST, PRIOR_CONTRAST_LN = 0.3, 1.0
PRIOR_GRAIN_PX, PRIOR_GRAIN_LN = 0.45, 0.4
CONTRASTS = np.geomspace(0.003, 1.0, 60)
GRAINS_PX = np.geomspace(0.22, 1.0, 14)
PIXELS_PER_GRAIN = 2.0  # neighbours share their speckle: so many core pixels make one independent residual
MAX_CONTRAST = 1.0  # fully developed; larger residuals are those of something that is no Gaussian spot


@dataclass(frozen=True)
class Speckle:
    """Speckle of a pixel: its standard deviation over the signal, and the Gaussian correlation length ℓ [px] in
    ρ(r) = exp(-r²/(4 ℓ²)).
    """

    contrast: float
    grain_px: float

    @property
    def variances(self) -> Array:
        """Contrast² · ρ for the classes of distance of `spot_noise` (CLASSES,)."""
        return np.asarray(self.contrast**2 * correlation(self.grain_px))


def correlation(grain_px: float) -> Array:
    """ρ for the classes of distance (CLASSES,)."""
    return np.asarray(np.exp(-DISTANCES2 / (4.0 * max(grain_px, 1e-3) ** 2)))


def estimate_speckle(
    about: SpotNoise, good: NDArray[np.bool_], contrast: float | None = None, grain_px: float | None = None
) -> Speckle:
    """Speckle from the error budgets of the fitted spots ``good`` (N,); what is given is kept.

    Moments: the residuals' variance over the signal's square gives the contrast, the product of neighbours the grain;
    both under a prior, as a spot or two tell little.
    """
    limit = MAX_CONTRAST**2 * (about.variance_speckle @ correlation(PRIOR_GRAIN_PX))
    good = good & np.isfinite(about.variance) & (about.variance < limit)
    if grain_px is None:
        grain_px = _grain(about, good)
    if contrast is None:
        contrast = _contrast(about, good, grain_px)
    return Speckle(contrast, grain_px)


def _contrast(about: SpotNoise, good: NDArray[np.bool_], grain_px: float) -> float:
    """Root mean square of the posterior: the residuals' variance is Gamma distributed about camera and speckle."""
    pixels = float(about.variance_speckle[good].sum(axis=0) @ correlation(grain_px))
    if pixels <= 0:
        return PRIOR_CONTRAST
    camera = max(float(about.variance_camera[good].sum()) / pixels, 1e-9)
    observed = max(float(about.variance[good].sum()) / pixels + camera, 0.0)
    variance = CONTRASTS**2 + camera
    cost = pixels / PIXELS_PER_GRAIN * (np.log(variance) + observed / variance)
    cost += (np.log(CONTRASTS / PRIOR_CONTRAST) / PRIOR_CONTRAST_LN) ** 2
    likely = np.exp(-0.5 * (cost - cost.min()))
    return float(np.sqrt(np.sum(likely * CONTRASTS**2) / np.sum(likely)))


def _grain(about: SpotNoise, good: NDArray[np.bool_]) -> float:
    """The grain whose neighbour product fits best, on a grid, under the prior."""
    variance, pairs = float(about.variance[good].sum()), float(about.pairs[good].sum())
    if variance <= 0 or pairs <= 0:
        return PRIOR_GRAIN_PX
    observed = float(about.neighbour[good].sum()) / variance
    rho = np.array([correlation(g) for g in GRAINS_PX])
    ratio = (rho @ about.neighbour_speckle[good].sum(axis=0)) / (rho @ about.variance_speckle[good].sum(axis=0))
    # a product of two neighbours has about the variance of the product of their variances
    cost = (observed - ratio) ** 2 * pairs / 2.0 + (np.log(GRAINS_PX / PRIOR_GRAIN_PX) / PRIOR_GRAIN_LN) ** 2
    return float(GRAINS_PX[np.argmin(cost)])
