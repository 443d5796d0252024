"""What of a string's light the truth counts: what lies within the image, by the share that each row takes."""

from __future__ import annotations

import numpy as np
import pytest

from perceptron_emu.truth import SUMS, StringNodes, _add

WIDTH, HEIGHT = 20, 10
EDGES = [
    ((-0.49, 5.0), True), ((-0.51, 5.0), False), ((19.49, 5.0), True), ((19.51, 5.0), False),
    ((7.0, -0.49), True), ((7.0, -0.51), False), ((7.0, 9.49), True), ((7.0, 9.51), False),
    ((np.nan, 5.0), False), ((7.0, np.nan), False),
]  # fmt: skip


def _sums(uv: list[tuple[float, float]], share: np.ndarray, electrons: float = 100.0) -> tuple[np.void, float]:
    n = len(uv)
    xyz = np.column_stack([np.zeros(n), np.arange(n) + 1.0, np.full(n, 300.0)])
    sums = np.zeros(1, SUMS)
    taken = _add(sums, StringNodes(np.array(uv, float).reshape(-1, 2), xyz, np.full(n, electrons)), share, WIDTH)
    return sums[0], taken


@pytest.mark.parametrize(("at", "inside"), EDGES)
def test_light_counts_within_the_outermost_pixels(at: tuple[float, float], inside: bool) -> None:
    total, taken = _sums([at], np.ones(HEIGHT))
    assert total["electrons"] == (100.0 if inside else 0.0)
    assert taken == 1.0


def test_each_row_takes_its_share_and_what_lies_outside_that_of_the_nearest() -> None:
    share = np.linspace(0.1, 1.0, HEIGHT)
    total, taken = _sums([(3.0, 2.4), (5.0, 7.6), (4.0, -30.0), (4.0, 80.0)], share)
    assert taken == pytest.approx(np.mean([share[2], share[8], share[0], share[9]]))
    light = 100.0 * np.array([share[2], share[8]])
    assert total["electrons"] == pytest.approx(light.sum())
    assert total["u"] == pytest.approx(light @ [3.0, 5.0])
    assert total["v"] == pytest.approx(light @ [2.4, 7.6])
    assert total["y"] == pytest.approx(light @ [1.0, 2.0])
    assert total["z"] == pytest.approx(light.sum() * 300.0)
    assert _sums([], share)[1] == 0.0
