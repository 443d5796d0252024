"""Lit string spots: image → peaks → regions → maximum-likelihood fits → points of the sheet with covariance."""

from extraction.spots.bound import TrueSpot, mean_image, position_bound
from extraction.spots.detect import Candidates
from extraction.spots.error import correlation, optical_grain_px
from extraction.spots.fast import PeakFits, fit_peaks
from extraction.spots.pipeline import extract, extract_stages, learn_speckle
from extraction.spots.shapes import region_shapes
from extraction.spots.stack import StackFits, fit_stack
from extraction.spots.stages import FLOODED_SHARE, Stages

__all__ = [
    "FLOODED_SHARE",
    "Candidates",
    "PeakFits",
    "StackFits",
    "Stages",
    "TrueSpot",
    "correlation",
    "extract",
    "extract_stages",
    "fit_peaks",
    "fit_stack",
    "learn_speckle",
    "mean_image",
    "optical_grain_px",
    "position_bound",
    "region_shapes",
]
