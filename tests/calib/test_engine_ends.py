"""How an iteration goes and ends: step by step as the textbook has it, the last one not judged by mere rounding."""

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


@dataclass(frozen=True)
class Valley:
    """Rosenbrock's bent valley, and where it was asked for."""

    visited: list[tuple[float, float]]

    def linearise(self, state: State) -> Linearised:
        """Two residuals of unit σ: 10 (y − x²) and 1 − x."""
        x, y = state.vector("xy")
        self.visited.append((float(x), float(y)))
        jacobian = np.array([[[-20 * x, 10.0], [-1.0, 0.0]]])
        return Linearised(np.array([[10 * (y - x * x), 1 - x]]), {"xy": jacobian}, np.eye(2)[None])


def _marquardt(x: np.ndarray, count: int) -> list[tuple[float, float]]:
    """Where Levenberg's and Marquardt's method looks: damping of the scaled normal matrix from 1e-4 on by tens."""
    damping, visited = 0.0, [(float(x[0]), float(x[1]))]

    def residual(x: np.ndarray) -> np.ndarray:
        return np.array([10 * (x[1] - x[0] ** 2), 1 - x[0]])

    while len(visited) < count:
        J = np.array([[-20 * x[0], 10.0], [-1.0, 0.0]])
        N = J.T @ J
        step = -np.linalg.solve(N + damping * np.diag(np.diag(N)), J.T @ residual(x))
        visited.append((float(x[0] + step[0]), float(x[1] + step[1])))
        if np.sum(residual(x + step) ** 2) <= np.sum(residual(x) ** 2):
            x, damping = x + step, 0.0 if damping < 1e-6 else damping / 10
        else:
            damping = max(10 * damping, 1e-4)
    return visited


@pytest.mark.parametrize("start", [(-1.2, 1.0), (4.0, 16.2), (-3.0, 9.5)])
def test_every_step_is_the_textbooks(start: tuple[float, float]) -> None:
    term = Valley([])
    unknowns = Unknowns((Block.vector("xy", np.full(2, np.inf)),))
    result = engine.solve((term,), unknowns, State({"xy": np.array(start)}), tolerance=1e-9, max_iterations=60)
    assert result.converged
    np.testing.assert_allclose(result.state.vector("xy"), 1.0, rtol=0, atol=1e-12)
    looked = [term.visited[0]]
    looked += [p for p, before in zip(term.visited[1:], term.visited, strict=False) if p != before]
    reference = _marquardt(np.array(start), len(looked))
    np.testing.assert_allclose(looked[:-1], reference[:-1], rtol=1e-6, atol=1e-9)
    assert len(looked) > 8
