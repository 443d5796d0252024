"""The examples that add a target and a robot error from outside the packages run, and their answers are true."""

from __future__ import annotations

import runpy
from pathlib import Path

from scipy.stats import chi2

EXAMPLES = Path(__file__).resolve().parents[2] / "examples"
NEES_LIMIT = chi2.isf(1e-3, 6)


def test_own_target() -> None:
    """One seed: that σ is true on average is not shown here."""
    assert runpy.run_path(str(EXAMPLES / "own_target.py"))["main"]() < NEES_LIMIT


def test_own_robot_error() -> None:
    """With the gear in the model the answer is within σ, and better than without."""
    squared = runpy.run_path(str(EXAMPLES / "own_robot_error.py"))["main"]()
    assert squared["with the gear"] < min(NEES_LIMIT, squared["table alone"])
