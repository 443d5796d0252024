"""The model of a stripe's section: a Gaussian on a background, and what its Fisher information says."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from extraction.linalg import Symmetric4, Vector4, factor4, solve4
from geometry.compiled import kernel

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]
Records = NDArray[np.void]

FEWEST_PIXELS = 5  # four parameters and one to spare
SINGULAR = 1e-12  # a peak narrower than a pixel is not told from its background any more


class Peak(NamedTuple):
    """Centre [px], amplitude [DN], Gaussian σ [px], background [DN]."""

    centre: float
    amplitude: float
    width: float
    background: float


class FitLimits(NamedTuple):
    """The smallest grey level that is clipped, smallest and largest σ [px]."""

    clip: float
    min_width: float
    max_width: float


@kernel
def centre_variance(fisher: Symmetric4) -> float:
    """Variance of the centre, a diagonal term of F⁻¹; infinite where singular."""
    definite, factor = factor4(fisher, SINGULAR)
    return solve4(factor, Vector4(1.0, 0.0, 0.0, 0.0)).a0 if definite else np.inf


@kernel
def slopes(peak: Peak, place: float) -> tuple[float, Vector4]:
    """The mean at a place, and its derivatives by the parameters, lengths in σ."""
    t = (place - peak.centre) / peak.width
    bell = math.exp(-0.5 * t * t)
    signal = peak.amplitude * bell
    return signal + peak.background, Vector4(signal * t, bell, signal * t * t, 1.0)
