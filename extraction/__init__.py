"""Extraction: pixels → lit spots → surface points (y, z) with covariance and quality. Knows no jig and no emulator."""

from extraction.config import DetectConfig, ExtractionConfig, LocaliseConfig, NoiseConfig
from extraction.gapflush import GapFlush, measure_gap_flush
from extraction.gapflush_config import GapFlushConfig
from extraction.pipeline import extract, extract_stages, learn_speckle
from extraction.profile import Profile, StripePeaks
from extraction.profile_files import read_profile_csv, write_profile_csv, write_profile_ply
from extraction.rectify import image_to_sheet
from extraction.region_shapes import region_shapes
from extraction.sheet_table import SheetTable, sheet_table
from extraction.stages import Stages
from extraction.stripe import detect_stripe, extract_profile
from extraction.stripe_config import StripeConfig

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
