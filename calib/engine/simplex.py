"""The lowest point of a function of a few numbers, without derivatives: the simplex of Nelder and Mead."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

_BEYOND, _WITHIN = 2.0, 0.5  # of the reflection; the inner steps and the shrinking


def lowest(of: Callable[[Array], float], simplex: Array, x_tolerance: float, f_tolerance: float, most: int) -> Array:
    """Walk downhill from a first simplex.

    Beside scipy.optimize's, whose steps and end it follows, it spares every calibration scipy.optimize's import, a
    third of a second.

    Parameters
    ----------
    of
        The function.
    simplex
        (N + 1, N) starting points.
    x_tolerance, f_tolerance
        Ends when all corners, and their values, are this close to the best.
    most
        Evaluations, about.

    Returns
    -------
    Array
        (N,) the best point found.

    References
    ----------
    Nelder & Mead, "A simplex method for function minimization", The Computer Journal 7 (1965) 308–313.
    """
    corners = np.array(simplex, dtype=float)
    values = np.array([of(x) for x in corners])
    calls = len(corners)
    corners, values = _ordered(corners, values)
    while calls < most:
        if (
            np.abs(corners[1:] - corners[0]).max() <= x_tolerance
            and np.abs(values[1:] - values[0]).max() <= f_tolerance
        ):
            break
        middle, worst = corners[:-1].mean(axis=0), corners[-1]
        reflected = 2 * middle - worst
        at_reflected = of(reflected)
        calls += 1
        if values[0] <= at_reflected < values[-2]:
            corners[-1], values[-1] = reflected, at_reflected
        else:
            if at_reflected < values[0]:
                step, limit, fallback = _BEYOND, at_reflected, (reflected, at_reflected)
            elif at_reflected < values[-1]:
                step, limit, fallback = _WITHIN, np.nextafter(at_reflected, np.inf), None
            else:
                step, limit, fallback = -_WITHIN, values[-1], None
            tried = (1 + step) * middle - step * worst
            at_tried = of(tried)
            calls += 1
            if at_tried < limit:
                corners[-1], values[-1] = tried, at_tried
            elif fallback is not None:
                corners[-1], values[-1] = fallback
            else:
                corners[1:] = corners[0] + _WITHIN * (corners[1:] - corners[0])
                values[1:] = [of(x) for x in corners[1:]]
                calls += len(corners) - 1
        corners, values = _ordered(corners, values)
    return np.asarray(corners[0])


def _ordered(corners: Array, values: Array) -> tuple[Array, Array]:
    order = np.argsort(values, kind="stable")
    return corners[order], values[order]
