"""A direction that the data leave open: the step stays finite and does not move along it."""

from __future__ import annotations

import numpy as np
import pytest

from calib.engine import Normal, normal_step, scaled_solve
from calib.synthetic.cell import Layout, calibrated, made_cell, observe, random_cell
from calib.synthetic.ensemble import NONE, PLACES


@pytest.mark.parametrize("left", [0.0, -1e-9])
def test_open_direction_is_not_moved(left: float) -> None:
    """A pivot that rounding took to zero or below gives no step there, and the right step elsewhere."""
    own, none, ones = {"target": 2 * np.eye(6)[None]}, {"target": np.zeros((1, 3, 6))}, {"target": np.ones((1, 6))}
    normal = Normal(np.diag([left, 4.0, 9.0]), np.array([1.0, 2.0, 3.0]), none, own, ones)
    step = normal_step(normal, np.ones(3, dtype=bool), 0.0)
    np.testing.assert_allclose(step.common, [0.0, -0.5, -1 / 3], rtol=0, atol=1e-12)
    np.testing.assert_allclose(step.separate["target"], np.full((1, 6), -0.5), rtol=0, atol=1e-12)


@pytest.mark.parametrize("left", [0.0, -1e-9, 1e-320])
def test_open_direction_is_uncertain_and_leaves_the_others_alone(left: float) -> None:
    """Its variance is huge and finite, also where rounding couples it to a direction that is known."""
    covariance = scaled_solve(np.array([[left, 1e-9, 0.0], [1e-9, 4.0, 1.0], [0.0, 1.0, 9.0]]), np.eye(3))
    assert 1e90 < covariance[0, 0] < 1e300
    np.testing.assert_allclose(covariance[1:, 1:], np.linalg.inv([[4.0, 1.0], [1.0, 9.0]]), rtol=0, atol=1e-12)


def test_exact_points_do_not_take_the_noise_out_of_range() -> None:
    """The search for the noise of points that have none stays where numbers are finite (warnings are errors)."""
    rng = np.random.default_rng(1)
    cell = random_cell(rng, Layout(places=PLACES))
    result = calibrated(observe(cell, made_cell(cell, rng, NONE), rng, NONE), cell.jig, cell.robot)
    assert result.verdict.code == "ok"
