"""How much a spot looks like a lit string, and why it should be doubted."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from extraction.config import DoubtConfig, ExtractionConfig, ScoreConfig
from extraction.reasons import Reason
from extraction.spots.detect import Candidates
from extraction.spots.error import SpotErrors
from extraction.spots.localise import LocalisedSpots

Array = NDArray[np.float64]

NARROWEST_PX2 = 1e-4  # variance across a spot that the fit left with none: it is refused as a spike
JUST_HALF = 0.5 - 1e-9  # where the weights below and above are equal, the lower value is the median


def score_spots(candidates: Candidates, spots: LocalisedSpots, config: ExtractionConfig) -> Array:
    """Score (N,) in [0, 1]: strong against its surroundings, narrow, short, and like the other spots of the image."""
    k, c = spots.candidate, config.score
    strength = candidates.height_dn[k] / (config.detect.threshold * candidates.ring_noise_dn[k])
    across, along = np.maximum(spots.variances_px2, NARROWEST_PX2).T
    own = 1.0 - np.exp(-((strength / c.strength) ** 2))
    own = own / ((1.0 + (across / c.width_px**2) ** 2) * (1.0 + (along / c.length_px**2) ** 2))
    own *= np.where(spots.clipped > 0, c.saturated, 1.0)
    # what is no spot has no say in what the image's spots look like
    own *= spots.converged & (across > config.localise.min_sigma_px**2)
    return np.asarray(own * _likeness(own, np.sqrt(across), spots.amplitude_dn, c))


def _likeness(own: Array, width: Array, amplitude: Array, c: ScoreConfig) -> Array:
    """Share in [least_likeness, 1] (N,) by which width and height fit those of the image's spots.

    The typical width and height are medians weighted by light: sparks and grains are many but faint.
    """
    weight = own * np.minimum(amplitude, c.brightest * np.median(amplitude)) if len(own) else own
    if len(own) < c.consensus or weight.sum() <= 0:
        return np.ones(len(own))
    typical_width, typical_height = _weighted_median(width, weight), _weighted_median(amplitude, weight)
    alike = np.exp(-0.5 * (np.log(width / typical_width) / c.width_spread) ** 2)
    alike *= amplitude / (amplitude + c.faint_share * typical_height)
    return np.asarray(c.least_likeness + (1.0 - c.least_likeness) * alike)


def _weighted_median(values: Array, weight: Array) -> float:
    order = np.argsort(values, kind="stable")
    cumulative = np.cumsum(weight[order])
    return float(values[order][np.searchsorted(cumulative, JUST_HALF * cumulative[-1])])


def refuse_spots(
    candidates: Candidates, spots: LocalisedSpots, score: Array, yz_mm: Array, config: ExtractionConfig
) -> NDArray[np.object_]:
    """Why each localised spot (N,) is no string spot after all, "" while it may be one."""
    reasons = np.full(len(spots), "", dtype=object)
    moved = np.linalg.norm(spots.uv_px - candidates.mean_uv_px[spots.candidate], axis=1)
    moved[list(spots.joint)] = 0.0  # a region that holds two has its centre between them
    width = np.sqrt(np.trace(spots.shape_px2, axis1=1, axis2=2))
    reasons[score < config.localise.min_score] = Reason.LOW_SCORE
    reasons[~np.all(np.isfinite(yz_mm), axis=1)] = Reason.NOT_IN_THE_SHEET
    reasons[moved > config.doubt.max_move_sigma * width + config.doubt.max_move_px] = Reason.FIT_WANDERED
    reasons[~spots.converged] = Reason.FIT_FAILED
    reasons[~(spots.variances_px2[:, 0] > config.localise.min_sigma_px**2)] = Reason.PIXEL_SPIKE
    return reasons


def flag_spots(
    spots: LocalisedSpots, kept: NDArray[np.intp], errors: SpotErrors, config: DoubtConfig
) -> NDArray[np.object_]:
    """The reason for doubt of each spot ``kept`` (N,), "" where there is none."""
    flags = np.full(len(kept), "", dtype=object)
    flags[np.abs(errors.skew_sigma) > config.max_skew_sigma] = Reason.PARTLY_HIDDEN
    flags[errors.misfit > config.max_misfit] = Reason.ODD_SHAPE
    if spots.merged is not None:
        flags[spots.merged[kept]] = Reason.ODD_SHAPE
    flags[spots.foreign[kept] > 0] = Reason.CROWDED
    flags[spots.clipped[kept] > 0] = Reason.SATURATED
    return flags
