"""σ of hand poses alone: no smaller than what frames left out in turn say.

The noise of few hand poses is estimated from the same few residuals, and an arm's own errors are common to
neighbouring poses: a covariance that follows from such a noise is believed only as far as the frames bear it out. Each
is left out, the noise found anew and all solved again (the delete-one jackknife); the same is done with all points
weighted alike, where nothing hangs on the noise.

References
----------
Efron & Stein, The jackknife estimate of variance, 1981; Wu, Jackknife, bootstrap and other resampling methods in
regression analysis, 1986.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from calib.judge.verdict import direction_in_words
from calib.result import Verdict

Array = NDArray[np.float64]

FEWEST_LEFT_OUT = 5  # frames: few scatter little by chance, but their scatter only ever widens
_WEAK_MM, _WEAK_DEG = 0.5, 0.3  # a drawing knows a sensor's place to one or two of these


def jackknife_covariance(shifts: Array) -> Array:
    """Covariance (6, 6) from how the answer moves (N, 6) where each of N parts is left out."""
    n = len(shifts)
    off = shifts - shifts.mean(axis=0)
    return np.asarray((n - 1) / n * off.T @ off)


def at_least(cov: Array, other: Array) -> Array:
    """The covariance (6, 6), widened in every direction where the ``other`` is wider."""
    root = np.linalg.cholesky(cov)
    inverse = np.linalg.inv(root)
    values, vectors = np.linalg.eigh(inverse @ other @ inverse.T)
    wide = root @ vectors
    return np.asarray(wide * np.maximum(values, 1.0) @ wide.T)


def weak_by_jackknife(cov: Array, cut_through_middle: int) -> Verdict | None:
    """The verdict on hand poses whose σ, widened to the jackknife's, add little to a mounting drawing; else None.

    cut_through_middle: frames that cut a ball nearly through its middle.
    """
    mm = float(np.sqrt(np.linalg.eigvalsh(cov[:3, :3])[-1]))
    deg = float(np.rad2deg(np.sqrt(np.linalg.eigvalsh(cov[3:, 3:])[-1])))
    if mm < _WEAK_MM and deg < _WEAK_DEG:
        return None
    add = "add poses turned by 30° or more about two axes"
    if cut_through_middle:
        add = (
            f"{cut_through_middle} frames cut the ball nearly through its middle: {add}, that cut it half a radius "
            "beside its middle, to both sides"
        )
    return Verdict(
        "weak",
        f"small residuals from weak poses: leaving frames out in turn shows a σ of {mm:.2g} mm and {deg:.2g}°, "
        f"{direction_in_words(cov)}; {add}",
    )
