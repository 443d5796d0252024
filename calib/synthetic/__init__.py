"""Synthetic cells and views with known truth, without images: for tests, benchmarks and the paper's ensemble."""

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
