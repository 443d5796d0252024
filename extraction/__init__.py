"""Extraction: pixels → lit spots → surface points (y, z) with covariance and quality. Knows no jig and no emulator."""

from typing import TYPE_CHECKING

from extraction.config import (
    MAX_GRAIN_PX,
    DetectConfig,
    DoubtConfig,
    ExtractionConfig,
    FeatureConfig,
    GapFlushConfig,
    LocaliseConfig,
    RegionConfig,
    ScoreConfig,
    SpotNoiseConfig,
    StripeConfig,
)
from extraction.image import MAX_PIXELS
from extraction.reasons import Reason, Seen, explain
from geometry.lazy import lazy_names

if TYPE_CHECKING:
    from extraction.features import FEATURE_KINDS, Circle, Line, TargetPoints, find_target_points
    from extraction.gapflush import GapFlush, measure_gap_flush
    from extraction.region import region_mask
    from extraction.sheet import SheetTable, image_to_sheet, sheet_table
    from extraction.spots import Stages, extract, extract_stages, learn_speckle, region_shapes
    from extraction.stripe import (
        PieceEnds,
        Profile,
        StripePeaks,
        detect_stripe,
        extract_profile,
        flag_names,
        peaks_text,
        piece_ends,
        profile_text,
        read_profile_csv,
        write_peaks_csv,
        write_profile_csv,
        write_profile_ply,
    )

__all__ = [
    "FEATURE_KINDS",
    "MAX_GRAIN_PX",
    "MAX_PIXELS",
    "Circle",
    "DetectConfig",
    "DoubtConfig",
    "ExtractionConfig",
    "FeatureConfig",
    "GapFlush",
    "GapFlushConfig",
    "Line",
    "LocaliseConfig",
    "PieceEnds",
    "Profile",
    "Reason",
    "RegionConfig",
    "ScoreConfig",
    "Seen",
    "SheetTable",
    "SpotNoiseConfig",
    "Stages",
    "StripeConfig",
    "StripePeaks",
    "TargetPoints",
    "detect_stripe",
    "explain",
    "extract",
    "extract_profile",
    "extract_stages",
    "find_target_points",
    "flag_names",
    "image_to_sheet",
    "learn_speckle",
    "measure_gap_flush",
    "peaks_text",
    "piece_ends",
    "profile_text",
    "read_profile_csv",
    "region_mask",
    "region_shapes",
    "sheet_table",
    "write_peaks_csv",
    "write_profile_csv",
    "write_profile_ply",
]

# who measures spots needs no stripe, who reads profiles neither; OpenCV comes with both
__getattr__ = lazy_names(
    __name__,
    {
        "extraction.features": (
            "FEATURE_KINDS",
            "Circle",
            "Line",
            "TargetPoints",
            "find_target_points",
        ),
        "extraction.gapflush": (
            "GapFlush",
            "measure_gap_flush",
        ),
        "extraction.region": ("region_mask",),
        "extraction.sheet": (
            "SheetTable",
            "image_to_sheet",
            "sheet_table",
        ),
        "extraction.spots": (
            "Stages",
            "extract",
            "extract_stages",
            "learn_speckle",
            "region_shapes",
        ),
        "extraction.stripe": (
            "PieceEnds",
            "Profile",
            "StripePeaks",
            "detect_stripe",
            "extract_profile",
            "flag_names",
            "peaks_text",
            "piece_ends",
            "profile_text",
            "read_profile_csv",
            "write_peaks_csv",
            "write_profile_csv",
            "write_profile_ply",
        ),
    },
)
