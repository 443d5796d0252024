"""Choices that do not hang on rounding: the last bits of a sum differ from processor to processor, a choice must not.

Two values that differ by less than a tolerance count as equal, and the first of equals is taken. The tolerance is the
caller's: well above the rounding noise of what is compared, well below what makes a difference.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray


def first_least(values: ArrayLike, tolerance: float) -> int:
    """Index of the first of the values (N,) that is no more than ``tolerance`` above the least; never one of a NaN."""
    return int(first_least_of_each(values, tolerance))


def first_most(values: ArrayLike, tolerance: float) -> int:
    """As `first_least`, of the largest."""
    return first_least(-np.asarray(values, dtype=float), tolerance)


def first_least_of_each(values: ArrayLike, tolerance: float) -> NDArray[np.intp]:
    """As `first_least` along the last axis of values (..., N): indices (...), 0 where all are NaN."""
    v = np.nan_to_num(np.asarray(values, dtype=float), nan=np.inf, posinf=np.inf, neginf=-np.inf)
    return np.asarray(np.argmax(v <= v.min(axis=-1, keepdims=True) + tolerance, axis=-1))


def ascending(values: ArrayLike, tolerance: float) -> NDArray[np.intp]:
    """Order (N,) of the values (N,) by their nearest multiples of the ``tolerance``, equals as they stand; NaN last."""
    return np.argsort(np.round(np.asarray(values, dtype=float) / tolerance), kind="stable")
