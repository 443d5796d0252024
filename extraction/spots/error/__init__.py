"""How far off a fitted spot may be: what camera noise and speckle do to it, and what its residuals say of them."""

from extraction.spots.error.budget import ErrorBudget, error_budget
from extraction.spots.error.errors import MODEL_SHARE, SpotErrors, spot_errors
from extraction.spots.error.speckle import correlation, estimate_speckle, optical_grain_px

__all__ = [
    "MODEL_SHARE",
    "ErrorBudget",
    "SpotErrors",
    "correlation",
    "error_budget",
    "estimate_speckle",
    "optical_grain_px",
    "spot_errors",
]
