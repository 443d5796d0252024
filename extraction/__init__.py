"""Extraction: pixels → lit spots → surface points (y, z) with covariance and quality. Knows no jig and no emulator."""

from extraction.config import DetectConfig, ExtractionConfig, LocaliseConfig, NoiseConfig
from extraction.pipeline import extract, extract_stages
from extraction.rectify import image_to_sheet
from extraction.stages import Stages

__all__ = [
    "DetectConfig",
    "ExtractionConfig",
    "LocaliseConfig",
    "NoiseConfig",
    "Stages",
    "extract",
    "extract_stages",
    "image_to_sheet",
]
