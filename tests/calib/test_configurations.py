"""Which joint solution status and turn columns mean: every one of an arm's solutions is told by its own columns."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from calib.configurations import standing
from calib.synthetic.cell import industrial_arm
from geometry import ArmConfiguration

ARM = industrial_arm()
ATOL_RAD = 1e-6
Q = np.array([0.4, -0.3, 0.5, -1.7, 0.9, 2.0])


def _found(q: np.ndarray, configuration: ArmConfiguration, arm=ARM) -> np.ndarray | None:  # type: ignore[no-untyped-def]
    return standing(arm, ARM.pose(q), configuration, np.random.default_rng(1))


def _turn(q: np.ndarray) -> int:
    """KUKA's turn: a bit for every axis that reads below zero."""
    return sum(1 << i for i, v in enumerate(q) if v < 0)


def _status(q: np.ndarray) -> list[int]:
    """The statuses with which these readings are found by their own turn."""
    return [s for s in range(8) if (found := _found(q, ArmConfiguration(status=s, turn=_turn(q)))) is not None
            and np.allclose(found, q, atol=ATOL_RAD)]  # fmt: skip


@pytest.mark.parametrize("sign", [[1, 1, 1, 1, 1, 1], [1, 1, 1, -1, -1, 1], [1, 1, 1, -1, 1, -1]])
def test_readings_come_back_by_their_status_and_turn(sign: list[int]) -> None:
    """By one side of axis 1 and one bend of axis 3; the bit of axis 5 says what turn says already."""
    q = Q * sign
    assert len(_status(q)) == 2
    assert len({s & 3 for s in _status(q)}) == 1


def test_an_axis_that_would_have_to_turn_beyond_its_limits_is_none() -> None:
    """Axis 4 reads −97°: with + in the turn it would be 263°."""
    status = _status(Q)[0]
    low, high = ARM.min_rad.copy(), ARM.max_rad.copy()
    low[3], high[3] = np.deg2rad([-185.0, 185.0])
    narrow = replace(ARM, min_rad=low, max_rad=high)
    other = ArmConfiguration(status=status, turn=_turn(Q) & ~8)
    assert _found(Q, other, narrow) is None
    high[3] = np.deg2rad(270.0)
    found = _found(Q, other, replace(ARM, min_rad=low, max_rad=high))
    assert found is not None
    np.testing.assert_allclose(found, Q + 2 * np.pi * np.eye(6)[3], atol=ATOL_RAD)


def test_quarter_turns_tell_a_whole_turn() -> None:
    """ABB's cf4 of −97.4° is −2; of 262.6° it is 2."""
    near = ArmConfiguration(quadrants=(0, -2, 1, 0))
    found = _found(Q, near)
    assert found is None or np.allclose(found[[3, 5]], Q[[3, 5]], atol=ATOL_RAD)
    assert _found(Q, ArmConfiguration(quadrants=(1, -2, 1, 0))) is None
