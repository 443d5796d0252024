"""The simplex search walks as scipy's does. Does not prove that it finds the lowest of several valleys."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.optimize import minimize

from calib.engine import lowest

Array = NDArray[np.float64]


def valley(x: Array) -> float:
    """A bent valley (Rosenbrock's), of any number of unknowns, with its floor at 1."""
    return float(np.sum((1 - x) ** 2) + 10 * np.sum((x[1:] - x[:-1] ** 2) ** 2))


@pytest.mark.parametrize("unknowns", [1, 2, 3])
@pytest.mark.parametrize("most", [12, 80, 1000])
def test_walks_as_scipy_does(unknowns: int, most: int) -> None:
    """The same steps, hence the same end, also where it is stopped on the way."""
    rng = np.random.default_rng(unknowns)
    for _ in range(5):
        start = rng.normal(0, 2, unknowns)
        simplex = np.vstack([start, start - 0.7 * np.eye(unknowns)])
        found = lowest(valley, simplex, 1e-3, 1e-4, most)
        options = {"maxfev": 10**6, "maxiter": 10**6, "xatol": 1e-3, "fatol": 1e-4, "initial_simplex": simplex}
        other = minimize(valley, start, method="Nelder-Mead", options=options)
        if other.nfev < most:
            np.testing.assert_allclose(found, other.x, rtol=0, atol=1e-12)
        else:
            assert valley(found) <= valley(simplex[0])
