"""Covariance of the localised spots that may be kept, and how far each departs from a Gaussian beyond its noise."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from extraction.localise import Fits, Spots
from extraction.noise import NoiseModel
from extraction.speckle import estimate_speckle
from extraction.spot_noise import SpotNoise, concatenate, spot_noise, take

Array = NDArray[np.float64]

MODEL_SHIFT = 2.0  # widths that a spot moves per share of its height by which it departs from the Gaussian
WASTE_PX = 1200  # pixels that windows of one group may be padded by: as dear as another group


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
    """Errors of the spots ``kept`` (N,), with the speckle that they show in the covariance.

    This is the dearest step of a frame, so that spots that are refused anyway should not come here.
    """
    if spots.fits is None or not len(kept):
        zero, given = np.zeros(len(kept)), spots.cov_uv_px2
        cov = given[kept] if given is not None else np.zeros((len(kept), 2, 2))
        return SpotErrors(cov, zero, zero, np.ones(len(kept), dtype=np.bool_), None)
    about = _budget(spots.fits, kept)
    speckle = estimate_speckle(about, spots.converged[kept], noise.speckle_contrast, noise.speckle_grain_px)
    cov = about.camera + about.speckle @ speckle.variances
    expected = about.variance_camera + about.variance_speckle @ speckle.variances
    misfit = (about.variance + about.variance_camera) / np.maximum(expected, 1e-30)
    skew = about.skew / np.sqrt(np.maximum(cov[:, 2, 2], 1e-30))
    # the Gaussian's own error moves the spot by some share of its widths: it differs from pose to pose
    position = cov[:, :2, :2] + (MODEL_SHIFT * noise.model_error) ** 2 * spots.shape_px2[kept]
    good = np.all(np.isfinite(cov), axis=(1, 2)) & (np.linalg.det(position) > 0)
    return SpotErrors(position, skew, misfit, good, about)


def _budget(fits: Fits, kept: NDArray[np.intp]) -> SpotNoise:
    """The error budgets of the spots ``kept``, in groups of windows of about one size."""
    groups = _groups(fits.size[kept])
    parts = []
    for group in groups:
        index = kept[group]
        columns, rows = fits.size[index].max(axis=0)
        data, use = fits.data[index, :rows, :columns], fits.use[index, :rows, :columns]
        parts.append(spot_noise(data, use, fits.parameters[index], fits.terms[index], fits.noises[index]))
    return take(concatenate(parts), np.argsort(np.concatenate(groups)))


def _groups(size: NDArray[np.int64]) -> list[NDArray[np.intp]]:
    """Indices of windows of sizes (N, 2) that are worth taking together."""
    order = np.argsort(size.prod(axis=1), kind="stable")
    groups, start = [], 0
    for end in range(1, len(order) + 1):
        together = size[order[start : end + 1]]
        waste = len(together) * together.max(axis=0).prod() - together.prod(axis=1).sum()
        if end == len(order) or waste > WASTE_PX:
            groups.append(order[start:end])
            start = end
    return groups
