"""How much a spot looks like a lit string, and why it should be doubted."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from extraction.candidates import Candidates
from extraction.config import ExtractionConfig
from extraction.localise import Spots

Array = NDArray[np.float64]

WIDTH_SPREAD = 0.3  # ln: strings of one jig differ in width by their distance and focus only
FAINT_SHARE = 0.1  # of the typical height, where a spot is half as likely
LEAST_LIKENESS = 0.3  # a spot unlike all others of its image is doubted, not lost
CONSENSUS = 3  # spots that make a typical width and height


def score_spots(candidates: Candidates, spots: Spots, config: ExtractionConfig) -> Array:
    """Score (N,) in [0, 1]: strong against its surroundings, narrow, short, and like the other spots of the image."""
    k = spots.candidate
    strength = candidates.height_dn[k] / (config.detect.threshold * candidates.ring_noise_dn[k])
    values = np.maximum(np.linalg.eigvalsh(spots.shape_px2).reshape(-1, 2), 1e-4)
    width, length = np.sqrt(values[:, 0]), np.sqrt(values[:, 1])
    own = (1.0 - np.exp(-((strength / 2.5) ** 2))) / ((1.0 + (width / 4.0) ** 4) * (1.0 + (length / 6.0) ** 4))
    own = np.where(spots.saturated > 0, 0.5 * own, own)
    return np.asarray(own * _likeness(own, width, spots.amplitude_dn))


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


def flag_spots(spots: Spots) -> tuple[str, ...]:
    """The reason for doubt of each spot, "" where there is none."""
    flags = np.full(len(spots), "", dtype=object)
    flags[spots.crowded] = "crowded"
    flags[spots.saturated > 0] = "saturated"
    return tuple(flags)
