"""How much a spot looks like a lit string, and why it should be doubted."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from extraction.config import ExtractionConfig
from extraction.spots.candidates import Candidates
from extraction.spots.errors import SpotErrors
from extraction.spots.localise import Spots

Array = NDArray[np.float64]

WIDTH_SPREAD = 0.3  # ln: strings of one jig differ in width by their distance and focus only
FAINT_SHARE = 0.1  # of the typical height, where a spot is half as likely
LEAST_LIKENESS = 0.3  # a spot unlike all others of its image is doubted, not lost
MAX_MOVE = 1.5  # of the fitted centre from the region's, in spot widths, beside one pixel
MISFIT = 4.0  # variance of the residuals over what noise and speckle make of it: two strings in one, or half a post
SKEW_SIGMA = 4.0  # asymmetry along the long axis that noise and speckle do not make
CONSENSUS = 3  # spots that make a typical width and height


def score_spots(candidates: Candidates, spots: Spots, config: ExtractionConfig) -> Array:
    """Score (N,) in [0, 1]: strong against its surroundings, narrow, short, and like the other spots of the image."""
    k = spots.candidate
    strength = candidates.height_dn[k] / (config.detect.threshold * candidates.ring_noise_dn[k])
    across, along = np.maximum(spots.variances_px2, 1e-4).T
    own = (1.0 - np.exp(-((strength / 2.5) ** 2))) / ((1.0 + (across / 16.0) ** 2) * (1.0 + (along / 36.0) ** 2))
    own *= np.where(spots.clipped > 0, 0.5, 1.0)
    # what is no spot has no say in what the image's spots look like
    own *= spots.converged & (across > config.localise.min_sigma_px**2)
    return np.asarray(own * _likeness(own, np.sqrt(across), spots.amplitude_dn))


def _likeness(own: Array, width: Array, amplitude: Array) -> Array:
    """Share in [LEAST_LIKENESS, 1] (N,) by which width and height fit those of the image's spots.

    The typical width and height are medians weighted by light: sparks and grains are many but faint.
    """
    weight = own * np.minimum(amplitude, 4.0 * np.median(amplitude)) if len(own) else own
    if len(own) < CONSENSUS or weight.sum() <= 0:
        return np.ones(len(own))
    typical_width, typical_height = _weighted_median(width, weight), _weighted_median(amplitude, weight)
    alike = np.exp(-0.5 * (np.log(width / typical_width) / WIDTH_SPREAD) ** 2)
    alike *= amplitude / (amplitude + FAINT_SHARE * typical_height)
    return np.asarray(LEAST_LIKENESS + (1.0 - LEAST_LIKENESS) * alike)


def _weighted_median(values: Array, weight: Array) -> float:
    order = np.argsort(values)
    cumulative = np.cumsum(weight[order])
    return float(values[order][np.searchsorted(cumulative, 0.5 * cumulative[-1])])


def refuse_spots(
    candidates: Candidates, spots: Spots, score: Array, yz_mm: Array, config: ExtractionConfig
) -> NDArray[np.object_]:
    """Why each localised spot (N,) is no string spot after all, "" while it may be one."""
    reasons = np.full(len(spots), "", dtype=object)
    moved = np.linalg.norm(spots.uv_px - candidates.mean_uv_px[spots.candidate], axis=1)
    reasons[score < config.localise.min_score] = "low_score"
    reasons[~np.all(np.isfinite(yz_mm), axis=1)] = "not_in_the_sheet"
    reasons[moved > MAX_MOVE * np.sqrt(np.trace(spots.shape_px2, axis1=1, axis2=2)) + 1.0] = "fit_wandered"
    reasons[~spots.converged] = "fit_failed"
    reasons[~(spots.variances_px2[:, 0] > config.localise.min_sigma_px**2)] = "pixel_spike"
    return reasons


def flag_spots(spots: Spots, kept: NDArray[np.intp], errors: SpotErrors) -> NDArray[np.object_]:
    """The reason for doubt of each spot ``kept`` (N,), "" where there is none."""
    flags = np.full(len(kept), "", dtype=object)
    flags[np.abs(errors.skew_sigma) > SKEW_SIGMA] = "partly_hidden"
    flags[errors.misfit > MISFIT] = "odd_shape"
    flags[spots.foreign[kept] > 0] = "crowded"
    flags[spots.clipped[kept] > 0] = "saturated"
    return flags
