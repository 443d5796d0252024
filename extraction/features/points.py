"""The points of one profile that lie on a target, and what was found there."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from extraction.features.shapes import Circle, Line

Array = NDArray[np.float64]
Index = NDArray[np.intp]


@dataclass(frozen=True, eq=False)
class TargetPoints:
    """Points of a profile on a target.

    Parameters
    ----------
    kind : str
        One of FEATURE_KINDS.
    yz_mm : ndarray (N, 2)
        Points in {P} [mm]; for an edge the one corner.
    cov_yz_mm2 : ndarray (N, 2, 2)
        Their own covariance, scaled to what they scatter by about the curve; the error that is common to a profile is
        not in it.
    feature : ndarray (N,) of int
        Which ball or face each lies on: balls and faces count along y from 0; otherwise 0.
    index : ndarray (N,) of int
        Their places in the profile; −1 for a corner.
    n_points : int
        How many the profile has.
    reason : str or None
        "no_profile" where it is empty, "no_target" where nothing can be taken for the target; then there are no points.
    text : str
        A sentence on what is wrong or doubtful, "" where nothing is.
    scatter_mm : float
        Robust σ across the curve; NaN without points.
    curves : tuple of Circle or Line
        What was fitted, by feature.
    rivals : int
        How many more things of the kind are in view.
    bend_mm : float
        Of a straight stretch: how far its middle stands off its ends, by a parabola; NaN for the others.
    sigma_bend_mm : float
        Its σ.
    """

    kind: str
    yz_mm: Array
    cov_yz_mm2: Array
    feature: Index
    index: Index
    n_points: int
    reason: str | None = None
    text: str = ""
    scatter_mm: float = float("nan")
    curves: tuple[Circle | Line, ...] = ()
    rivals: int = 0
    bend_mm: float = float("nan")
    sigma_bend_mm: float = float("nan")

    def __len__(self) -> int:
        """The number of points."""
        return len(self.yz_mm)

    @property
    def n_found(self) -> int:
        """How many of the profile's points lie on the target."""
        return int(np.count_nonzero(self.index >= 0))

    @property
    def bulges_towards_z(self) -> int:
        """Of a single arc: −1 where it bulges towards smaller z, +1 towards larger z, else 0."""
        if len(self.curves) != 1 or not isinstance(self.curves[0], Circle) or len(self) == 0:
            return 0
        return 1 if float(np.mean(self.yz_mm[:, 1])) > self.curves[0].centre_mm[1] else -1

    @staticmethod
    def none(kind: str, n_points: int, reason: str, text: str) -> TargetPoints:
        """Nothing found, and why."""
        no = np.zeros(0, dtype=np.intp)
        return TargetPoints(kind, np.zeros((0, 2)), np.zeros((0, 2, 2)), no, no, n_points, reason, text)
