"""Extraction: pixels → lit spots → surface points (y, z) with covariance and quality. Knows no jig and no emulator."""

from extraction.config import DetectConfig, ExtractionConfig, LocaliseConfig, NoiseConfig
from extraction.gapflush import GapFlush, GapFlushConfig, measure_gap_flush
from extraction.sheet import SheetTable, image_to_sheet, sheet_table
from extraction.spots import Stages, extract, extract_stages, learn_speckle, region_shapes
from extraction.stripe import (
    Profile,
    StripeConfig,
    StripePeaks,
    detect_stripe,
    extract_profile,
    read_profile_csv,
    write_profile_csv,
    write_profile_ply,
)

__all__ = [
    "DetectConfig",
    "ExtractionConfig",
    "GapFlush",
    "GapFlushConfig",
    "LocaliseConfig",
    "NoiseConfig",
    "Profile",
    "SheetTable",
    "Stages",
    "StripeConfig",
    "StripePeaks",
    "detect_stripe",
    "extract",
    "extract_profile",
    "extract_stages",
    "image_to_sheet",
    "learn_speckle",
    "measure_gap_flush",
    "read_profile_csv",
    "region_shapes",
    "sheet_table",
    "write_profile_csv",
    "write_profile_ply",
]
