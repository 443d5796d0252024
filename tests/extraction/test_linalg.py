"""Small systems of the compiled fits against numpy's, and which of them count as singular."""

from __future__ import annotations

import numpy as np
import pytest

from extraction.linalg import Symmetric4, Vector4, cholesky, factor4, solve, solve4

SINGULAR = 1e-10


def _symmetric(m: np.ndarray) -> Symmetric4:
    return Symmetric4(*(float(m[i, j]) for i in range(4) for j in range(i, 4)))


def _positive(seed: int) -> np.ndarray:
    rng = np.random.default_rng(seed)
    a = rng.normal(size=(7, 4)) * np.exp(rng.normal(0, 2, 4))
    return np.asarray(a.T @ a)


@pytest.mark.parametrize("seed", range(20))
def test_four_unknowns_are_solved_as_numpy_does(seed: int) -> None:
    m, b = _positive(seed), np.random.default_rng([seed, 1]).normal(size=4)
    definite, factor = factor4(_symmetric(m), SINGULAR)
    assert definite
    found = solve4(factor, Vector4(*b.tolist()))
    np.testing.assert_allclose(np.array(found), np.linalg.solve(m, b), rtol=1e-8)


@pytest.mark.parametrize("k", [1, 2, 3])
@pytest.mark.parametrize("scale", [1e-6, 1.0, 1e6])
def test_what_is_left_of_a_diagonal_tells_a_singular_system(k: int, scale: float) -> None:
    """A column that is another one but for a share of its square: 3e-10 of it left is told, 3e-11 is not."""
    for left, definite in ((3e-10, True), (3e-11, False)):
        rows = np.eye(4)
        rows[:, k] = rows[:, 0] * np.sqrt(1 - left) + np.sqrt(left) * np.eye(4)[k]
        rows[:, k] *= scale
        assert bool(factor4(_symmetric(rows.T @ rows), SINGULAR)[0]) == definite


def test_what_is_not_positive_is_none() -> None:
    for k in range(4):
        m = _positive(3)
        m[k, k] = -m[k, k]
        assert not factor4(_symmetric(m), SINGULAR)[0]


@pytest.mark.parametrize("damping", [0.0, 0.3])
@pytest.mark.parametrize("n", [1, 2, 5, 7])
def test_larger_systems_are_solved_as_numpy_does(n: int, damping: float) -> None:
    """The leading part of a larger one, its diagonal damped."""
    rng = np.random.default_rng(n)
    a = rng.normal(size=(20, 8))
    m, b, factor, found = a.T @ a, rng.normal(size=8), np.zeros((8, 8)), np.zeros(8)
    assert cholesky(m, damping, SINGULAR, n, factor)
    solve(factor, b, n, found)
    damped = m[:n, :n] + damping * np.diag(np.diag(m)[:n])
    np.testing.assert_allclose(np.tril(factor[:n, :n]), np.linalg.cholesky(damped), rtol=1e-9)
    np.testing.assert_allclose(found[:n], np.linalg.solve(damped, b[:n]), rtol=1e-9)
    assert not found[n:].any()


def test_a_larger_system_is_singular_by_what_is_left_of_a_diagonal() -> None:
    for left, definite in ((3e-10, True), (3e-11, False)):
        rows = np.eye(5)
        rows[:, 4] = 1e3 * (rows[:, 1] * np.sqrt(1 - left) + np.sqrt(left) * np.eye(5)[4])
        assert bool(cholesky(rows.T @ rows, 0.0, SINGULAR, 5, np.zeros((5, 5)))) == definite
        assert cholesky(rows.T @ rows, 0.0, SINGULAR, 4, np.zeros((5, 5)))
