"""Extraction: pixels → lit spots → surface points (y, z) with covariance and quality. Knows no jig and no emulator."""

from extraction.config import DetectConfig, ExtractionConfig, LocaliseConfig, NoiseConfig
from extraction.gapflush.config import GapFlushConfig
from extraction.gapflush.measure import GapFlush, measure_gap_flush
from extraction.sheet.rectify import image_to_sheet
from extraction.sheet.table import SheetTable, sheet_table
from extraction.spots.pipeline import extract, extract_stages, learn_speckle
from extraction.spots.region_shapes import region_shapes
from extraction.spots.stages import Stages
from extraction.stripe.config import StripeConfig
from extraction.stripe.files import read_profile_csv, write_profile_csv, write_profile_ply
from extraction.stripe.pipeline import detect_stripe, extract_profile
from extraction.stripe.profile import Profile, StripePeaks

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
