"""Several targets in one solve: each location its own, one term each."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from calib import CalibConfig, calibrate
from calib.synthetic.cell import Noise, made_cell, observe, random_cell
from geometry import InputError
from tests.pinned import pinned

ATOL_MM = 1e-6


def test_one_term_or_two_give_one_answer() -> None:
    """A jig whose location B has a record of its own is the same jig where its anchors are exact: nothing is shared.

    That the answer is right is test_calibrate's business.
    """
    rng = np.random.default_rng(3)
    cell = random_cell(rng)
    jig = replace(cell.jig, measured=True)
    cell = replace(cell, jig=jig)
    made = made_cell(cell, rng, Noise(anchors=False))
    seen = observe(cell, made, rng, Noise(anchors=False))
    config = CalibConfig(model="full")
    one = calibrate(seen.frames, jig, cell.robot, seen.sensor, cell.design, config=config)
    pinned(one)
    other = replace(jig, name="its own record")
    both = {"A": jig, "B": other, "C": jig, "D": other}
    two = calibrate(seen.frames, both, cell.robot, seen.sensor, cell.design, config=config)
    pinned(two)
    assert one.T_hand_sensor is not None
    assert two.T_hand_sensor is not None
    np.testing.assert_allclose(two.T_hand_sensor.matrix, one.T_hand_sensor.matrix, rtol=0, atol=ATOL_MM)
    assert one.covariance is not None
    # the sizes of a single jig are suspects as well, so improbable that σ hardly moves
    np.testing.assert_allclose(two.covariance, one.covariance, rtol=1e-3, atol=ATOL_MM)
    assert two.verdict.code == one.verdict.code
    for name, location in one.locations.items():
        assert two.locations[name].point_rms_mm.solved == pytest.approx(location.point_rms_mm.solved, abs=ATOL_MM)


def test_a_location_without_a_target_is_said() -> None:
    cell = random_cell(np.random.default_rng(3))
    seen = observe(cell, cell, np.random.default_rng(4), Noise())
    with pytest.raises(InputError, match="location B has no target") as refused:
        calibrate(seen.frames, {"A": cell.jig}, cell.robot, seen.sensor, cell.design)
    pinned(str(refused.value))
