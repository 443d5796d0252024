"""Order statistics of compiled code against numpy's, whatever the values and however many are equal."""

from __future__ import annotations

import numpy as np
import pytest

from extraction.order import kth_smallest, kth_smallest_level


def _values(seed: int) -> np.ndarray:
    rng = np.random.default_rng(seed)
    n = int(rng.integers(1, 400))
    kind = seed % 4
    if kind == 0:
        return rng.normal(0, 50, n)
    if kind == 1:
        return rng.integers(-3, 4, n).astype(float)
    if kind == 2:
        return np.full(n, rng.choice([0.0, -7.5, 1e30]))
    return rng.normal(0, 1, n) * 10.0 ** rng.uniform(-30, 30, n)


@pytest.mark.parametrize("seed", range(40))
def test_every_place_in_the_order(seed: int) -> None:
    values = _values(seed).astype(np.float32)
    ordered = np.sort(values)
    for k in {0, len(values) // 3, len(values) // 2, len(values) - 1}:
        assert kth_smallest(values.copy(), k) == ordered[k]
        assert kth_smallest(values.astype(float), k) == ordered[k]
        kept = values.copy()
        assert kth_smallest_level(kept, k) == ordered[k]
        np.testing.assert_array_equal(kept, values)


def test_zeros_of_either_sign_and_none_at_all() -> None:
    values = np.array([0.0, -0.0, -1.0, 1.0], np.float32)
    assert [float(kth_smallest_level(values, k)) for k in range(4)] == [-1.0, 0.0, 0.0, 1.0]
    assert kth_smallest(np.zeros(0, np.float32), 0) == kth_smallest_level(np.zeros(0, np.float32), 0) == 0.0
