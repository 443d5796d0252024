"""Figures over frames that were held against truth."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from workbench.compare.matching import Comparison

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Statistics:
    """Counts over the visible strings; bias, scatter (about the bias) and rms of the errors (y, z) [mm], NaN of none.

    rms_mm: of the error's length.
    """

    visible: int
    found: int
    missed: int
    false: int
    mislabelled: int
    bias_mm: tuple[float, float]
    scatter_mm: tuple[float, float]
    rms_yz_mm: tuple[float, float]
    rms_mm: float


def errors_mm(comparisons: Iterable[Comparison]) -> Array:
    """The errors of the visible strings that were found, frame by frame.

    Parameters
    ----------
    comparisons : iterable of Comparison
        One a frame.

    Returns
    -------
    (K, 2) array
        (y, z) measured less true [mm].
    """
    return np.array([m.error_mm for c in comparisons for m in c.found], dtype=float).reshape(-1, 2)


def summarise(comparisons: Iterable[Comparison]) -> Statistics:
    """Figures over frames.

    Parameters
    ----------
    comparisons
        One of each frame.

    Returns
    -------
    Statistics
        Counts over the visible strings, errors [mm] over those of them that were found.

    """
    frames = list(comparisons)
    visible, found = sum(len(c.visible) for c in frames), sum(len(c.found) for c in frames)
    false, wrong = sum(len(c.false_points) for c in frames), sum(c.mislabelled for c in frames)
    errors = errors_mm(frames)
    if not len(errors):
        none = (float("nan"), float("nan"))
        return Statistics(visible, found, visible - found, false, wrong, none, none, none, float("nan"))
    (by, bz), (sy, sz) = errors.mean(axis=0), errors.std(axis=0)
    ry, rz = np.sqrt(np.mean(errors**2, axis=0))
    rms = float(np.sqrt(np.mean(np.sum(errors**2, axis=1))))
    pairs = ((float(by), float(bz)), (float(sy), float(sz)), (float(ry), float(rz)))
    return Statistics(visible, found, visible - found, false, wrong, *pairs, rms)
