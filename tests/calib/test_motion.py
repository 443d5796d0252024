"""What the configurations themselves can tell: how many differ, by length or by angle."""

import numpy as np
import pytest

from calib.judge.verdict import motion
from geometry import Pose, stack_poses


@pytest.mark.parametrize(
    ("angle_deg", "shift_mm", "distinct"),
    [(0.09, 0.0, 0), (0.11, 0.0, 2), (1.3, 0.0, 2), (0.0, 0.9, 0), (0.0, 1.1, 2), (179.0, 0.0, 2)],
)
def test_configurations_count_as_another_by_a_tenth_of_a_degree_or_a_millimetre(
    angle_deg: float, shift_mm: float, distinct: int
) -> None:
    hands = stack_poses(
        [Pose.from_fixed_xyz_deg([0, 0, k * angle_deg], [500 + k * shift_mm, 0, 800]) for k in (0, 1, -1)]
    )
    jigs = stack_poses([Pose.from_fixed_xyz_deg([0, 0, 0], [0, 0, 300])] * 3)
    found = motion(hands, jigs, np.zeros(3, dtype=np.intp))
    assert found.pairs == 2
    assert found.distinct == distinct
    assert found.frames == 3
