"""A laser stripe's profile: image → peaks section by section → points of the sheet with covariance; files of them."""

from typing import TYPE_CHECKING

from extraction.stripe.profile import AMBIGUOUS, EDGE, SATURATED, SHAPE, Profile, StripePeaks, flag_bits, flag_names
from geometry.lazy import lazy_names

if TYPE_CHECKING:
    from extraction.stripe.ends import PieceEnds, piece_ends
    from extraction.stripe.files import (
        peaks_text,
        profile_text,
        read_profile_csv,
        write_peaks_csv,
        write_profile_csv,
        write_profile_ply,
    )
    from extraction.stripe.pipeline import depth_direction, detect_stripe, extract_profile

__all__ = [
    "AMBIGUOUS",
    "EDGE",
    "SATURATED",
    "SHAPE",
    "PieceEnds",
    "Profile",
    "StripePeaks",
    "depth_direction",
    "detect_stripe",
    "extract_profile",
    "flag_bits",
    "flag_names",
    "peaks_text",
    "piece_ends",
    "profile_text",
    "read_profile_csv",
    "write_peaks_csv",
    "write_profile_csv",
    "write_profile_ply",
]

# profiles that a sensor delivers need nothing of finding a stripe in an image
__getattr__ = lazy_names(
    __name__,
    {
        "extraction.stripe.ends": (
            "PieceEnds",
            "piece_ends",
        ),
        "extraction.stripe.files": (
            "peaks_text",
            "profile_text",
            "read_profile_csv",
            "write_peaks_csv",
            "write_profile_csv",
            "write_profile_ply",
        ),
        "extraction.stripe.pipeline": (
            "depth_direction",
            "detect_stripe",
            "extract_profile",
        ),
    },
)
