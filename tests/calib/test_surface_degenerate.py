"""Views from which a surface does not tell the SCP are refused by their name, with noise and robot errors as built.

All kinds, over many cells, are benchmarks/calib_degenerate_surfaces.py's business.
"""

from __future__ import annotations

import numpy as np
import pytest

from calib import CalibConfig, calibrate
from calib.synthetic.surfaces import ProfileNoise, observe_surface
from calib.synthetic.telling_nothing import SPOILT, spoilt_cell


@pytest.mark.parametrize("by_design", [True, False])
@pytest.mark.parametrize(
    "name",
    [
        "sphere, shifts alone",
        "sphere, one axis",
        "sphere, through its middle",
        "one plane, three tilts",
        "one plane, tilts about one axis",
        "edge, crossed square",
        "wedge, shifts alone",
    ],
)
def test_it_is_refused_by_name_with_what_to_add(name: str, by_design: bool) -> None:
    spoilt = SPOILT[name]
    rng = np.random.default_rng(5)
    cell = spoilt_cell(spoilt, rng)
    seen = observe_surface(cell, rng, ProfileNoise(), points=60, labelled=False)
    design = seen.design if by_design else None
    result = calibrate(seen.frames, spoilt.target, cell.robot, seen.sensor, design, config=CalibConfig(model="full"))
    assert not result.verdict.trustworthy
    assert result.T_hand_sensor is None
    assert result.covariance is None
    assert any(w in result.verdict.text for w in spoilt.words), result.verdict.text
    assert "add poses" in result.verdict.text
