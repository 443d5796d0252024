"""GaussianSpots on pixels against the error function, by both ways of drawing."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.special import ndtr

from perceptron_emu.image.deposit import GaussianSpots, deposit, deposit_fine


def exact(shape: tuple[int, int], u: np.ndarray, v: np.ndarray, weight: np.ndarray, sigma: float) -> np.ndarray:
    edges = [np.arange(n + 1) - 0.5 for n in shape]
    rows = np.diff(ndtr((edges[0][:, None] - v) / sigma), axis=0)
    columns = np.diff(ndtr((edges[1][:, None] - u) / sigma), axis=0)
    return np.einsum("ik,jk,k->ij", rows, columns, weight)


@pytest.mark.parametrize("sigma", [0.4, 0.8, 3.0])
def test_a_pixel_takes_the_integral_over_its_square(sigma: float) -> None:
    rng = np.random.default_rng(1)
    u, v, weight = rng.uniform(20, 60, 50), rng.uniform(20, 40, 50), rng.uniform(1, 3, 50)
    image = np.zeros((60, 80), np.float32)
    deposit(image, GaussianSpots(u, v, weight, np.full(50, sigma)))
    assert np.max(np.abs(image - exact(image.shape, u, v, weight, sigma))) < 2e-5 * image.max()


@pytest.mark.parametrize("sigma", [2.5, 3.1])
def test_the_fourier_way_agrees(sigma: float) -> None:
    rng = np.random.default_rng(2)
    u, v, weight = rng.uniform(20, 60, 50), rng.uniform(20, 40, 50), rng.uniform(1, 3, 50)
    image = deposit_fine((61, 83), GaussianSpots(u, v, weight, np.full(50, sigma)), sigma)
    assert np.max(np.abs(image - exact(image.shape, u, v, weight, sigma))) < 1e-4 * image.max()


def test_spots_beyond_the_border_are_cut() -> None:
    image = np.zeros((20, 20), np.float32)
    ends = np.array([-0.5, 100.0, -30.0])
    deposit(image, GaussianSpots(ends, np.array([10.0, 10.0, 10.0]), np.ones(3), np.full(3, 1.0)))
    assert image.sum() == pytest.approx(0.5, abs=1e-4)
