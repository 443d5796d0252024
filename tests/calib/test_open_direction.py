"""A direction that the data leave open: the step stays finite and does not move along it."""

from __future__ import annotations

import numpy as np
import pytest

from calib.normal import Normal, solve


@pytest.mark.parametrize("left", [0.0, -1e-9])
def test_open_direction_is_not_moved(left: float) -> None:
    """A pivot that rounding took to zero or below gives no step there, and the right step elsewhere."""
    jigs = 2 * np.eye(6)[None]
    normal = Normal(np.diag([left, 4.0, 9.0]), np.zeros((1, 3, 6)), jigs, np.array([1.0, 2.0, 3.0]), np.ones((1, 6)))
    step = solve(normal, np.ones(3, dtype=bool), 0.0)
    np.testing.assert_allclose(step.common, [0.0, -0.5, -1 / 3], rtol=0, atol=1e-12)
    np.testing.assert_allclose(step.jigs, np.full((1, 6), -0.5), rtol=0, atol=1e-12)
