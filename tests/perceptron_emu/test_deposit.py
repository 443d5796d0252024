"""GaussianSpots on pixels against the error function, by both ways of drawing."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.special import ndtr

from perceptron_emu.image.deposit import GaussianSpots, deposit, spline_taps
from perceptron_emu.image.pieces import SpotPieces, draw_pieces
from perceptron_emu.image.speckle import speckle_of


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


@pytest.mark.parametrize("splines", [True, False])
@pytest.mark.parametrize("sigma", [0.65, 0.8])
def test_pieces_agree_with_the_integral(sigma: float, splines: bool) -> None:
    """Two pieces on sub-pixels without speckle, one of which stands out over the border."""
    rng = np.random.default_rng(2)
    u, v, weight = rng.uniform(20, 40, 50), rng.uniform(20, 40, 50), rng.uniform(1, 3, 50)
    u[25:] += 42
    image, q = np.zeros((61, 83), np.float32), 4
    spots = GaussianSpots(u, v, weight, np.full(50, sigma))
    taps = spline_taps(sigma * q) if splines else np.zeros(0, np.float32)
    draw_pieces(
        image, spots, SpotPieces(np.array([0, 25, 50]), np.zeros((2, 2), np.int64), q), taps, speckle_of(2.0, 0, 1)
    )
    assert np.max(np.abs(image - exact(image.shape, u, v, weight, sigma))) < 1e-4 * image.max()


def test_spots_beyond_the_border_are_cut() -> None:
    image = np.zeros((20, 20), np.float32)
    ends = np.array([-0.5, 100.0, -30.0])
    deposit(image, GaussianSpots(ends, np.array([10.0, 10.0, 10.0]), np.ones(3), np.full(3, 1.0)))
    assert image.sum() == pytest.approx(0.5, abs=1e-4)
