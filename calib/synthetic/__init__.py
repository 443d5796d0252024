"""Synthetic cells and views with known truth, without images: for tests, benchmarks and the paper's ensemble."""

from typing import TYPE_CHECKING

from geometry.lazy import lazy_names

if TYPE_CHECKING:
    from calib.synthetic.cell import DESIGN, TRUTH, Noise, calibrated, industrial_arm, made_cell, observe, random_cell
    from calib.synthetic.ensemble import (
        LAST_JOINTS,
        METHODS,
        SOURCES,
        EnsembleRow,
        PaperSetting,
        largest_deviations,
        paper_ensemble,
        poses,
    )

__all__ = [
    "DESIGN",
    "LAST_JOINTS",
    "METHODS",
    "SOURCES",
    "TRUTH",
    "EnsembleRow",
    "Noise",
    "PaperSetting",
    "calibrated",
    "industrial_arm",
    "largest_deviations",
    "made_cell",
    "observe",
    "paper_ensemble",
    "poses",
    "random_cell",
]

# files and presets ask for the design alone
__getattr__ = lazy_names(
    __name__,
    {
        "calib.synthetic.cell": (
            "DESIGN",
            "TRUTH",
            "Noise",
            "calibrated",
            "industrial_arm",
            "made_cell",
            "observe",
            "random_cell",
        ),
        "calib.synthetic.ensemble": (
            "LAST_JOINTS",
            "METHODS",
            "SOURCES",
            "EnsembleRow",
            "PaperSetting",
            "largest_deviations",
            "paper_ensemble",
            "poses",
        ),
    },
)
