"""A Gaussian along a row of pixels, by recurrence: three exponentials for a whole row."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from geometry.compiled import kernel


@kernel(fastmath=True)
def bell_row(centre: float, curvature: float, slope: float, fall: float, bell: NDArray[np.float64]) -> None:
    """Fill ``bell`` (n,) with exp(-½ curvature x² - slope x - fall), x = 0 … n - 1 less ``centre``.

    Outwards from its largest pixel, so that no factor of the recurrence overflows.
    """
    n = len(bell)
    first = int(min(max(centre - slope / curvature + 0.5, 0.0), n - 1.0))
    x, curve = first - centre, np.exp(-curvature)
    value = np.exp(-(0.5 * curvature * x * x + slope * x + fall))
    ratio = np.exp(-curvature * (x + 0.5) - slope)
    back, left = curve / ratio, value
    bell[first] = value
    for i in range(first + 1, n):
        value *= ratio
        ratio *= curve
        bell[i] = value
    for i in range(first - 1, -1, -1):
        left *= back
        back *= curve
        bell[i] = left
