"""How an iteration ends: its last step is not judged by a cost that only rounding tells from the one before."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pytest

from calib import engine
from geometry import Block, Linearised, State, Unknowns

ROUNDING = 1e-9  # far above a real one, of residuals of size one


@dataclass(frozen=True)
class Rough:
    """A line through noise: residuals that a processor rounds its own way."""

    true: float
    key: int

    def linearise(self, state: State) -> Linearised:
        """Twenty residuals of unit σ, the same rounding at the same place."""
        x = float(state.vector("x")[0])
        rng = np.random.default_rng([self.key, round(x * 1e12)])
        noise = np.linspace(-1, 1, 20) + ROUNDING * rng.uniform(-1, 1, 20)
        slope = np.ones((20, 1, 1))
        return Linearised((x - self.true + noise)[:, None], {"x": slope}, np.ones((20, 1, 1)))


@pytest.mark.parametrize("key", range(20))
def test_a_last_short_step_is_taken_whole(key: int) -> None:
    unknowns = Unknowns((Block.vector("x", np.array([np.inf])),))
    start = State({"x": np.array([3.0 + 1e-6])})
    result = engine.solve((Rough(3.0, key),), unknowns, start)
    assert result.converged
    assert result.iterations == 1
    assert float(result.state.vector("x")[0]) == pytest.approx(3.0, abs=2 * ROUNDING)
