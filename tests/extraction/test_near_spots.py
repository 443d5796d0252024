"""Two near spots: taken apart down to 1.2 full widths at half maximum, one flagged point below; by own pictures."""

import numpy as np
import pytest

from extraction import ExtractionConfig, SpotNoiseConfig, extract
from tests.extraction.spots import make_sensor

WIDTH, HEIGHT, FINE, SIGMA_PX = 160, 128, 5, 1.3
QUIET = ExtractionConfig(noise=SpotNoiseConfig(speckle_contrast=0.0, model_error=0.0))
SENSOR = make_sensor(WIDTH, HEIGHT)


def picture(
    rng: np.random.Generator, apart: float, ratio: float, shape=(SIGMA_PX, SIGMA_PX), contrast: float = 0.0
) -> tuple[np.ndarray, np.ndarray]:
    """Two Gaussians, summed over fine pixels, so many full widths apart in any direction; and their centres (2, 2)."""
    turn = rng.uniform(0, np.pi)
    half = 0.5 * apart * 2.3548 * np.hypot(SIGMA_PX, 12**-0.5) * np.array([np.cos(turn), np.sin(turn)])
    centres = np.array([80, 64]) + rng.uniform(-0.5, 0.5, 2) + [-half, half]
    u, v = ((np.arange(n * FINE) + 0.5) / FINE - 0.5 for n in (WIDTH, HEIGHT))
    light = sum(
        high * np.outer(np.exp(-0.5 * ((v - y) / shape[1]) ** 2), np.exp(-0.5 * ((u - x) / shape[0]) ** 2))
        for (x, y), high in zip(centres, (120, 120 * ratio), strict=True)
    )
    light = light.reshape(HEIGHT, FINE, WIDTH, FINE).mean(axis=(1, 3))
    mean = 10 + light * np.maximum(rng.normal(1, contrast, light.shape), 0)
    image = rng.poisson(mean / 0.025) * 0.025 + rng.normal(0, 0.7, mean.shape)
    return image.round().clip(0, 255).astype(np.uint8), centres


@pytest.mark.parametrize("apart", [1.2, 1.5, 2.0, 3.0])
@pytest.mark.parametrize("ratio", [1.0, 0.6])
def test_two_are_taken_apart_and_each_sigma_is_true(apart, ratio):
    """40 errors of two spots in two directions: the mean of error²/σ² has a standard deviation of 0.16."""
    rng, seen = np.random.default_rng(int(100 * apart)), []
    for _ in range(20):
        image, centres = picture(rng, apart, ratio)
        points = extract(image, SENSOR, QUIET)
        assert len(points) == 2
        assert all(flag == ("crowded" if apart < 1.6 else "") for flag in points.flag)
        one = np.linalg.norm(points.uv_px - centres, axis=1).sum()
        error = points.uv_px - (centres if one < 2 * apart else centres[::-1])
        seen += [e @ np.linalg.solve(cov, e) / 2 for e, cov in zip(error, points.cov_uv_px2, strict=True)]
    assert 0.5 < np.mean(seen) < 1.6


@pytest.mark.parametrize("apart", [1.2, 2.0])
def test_the_default_settings_take_them_apart_too(apart):
    rng = np.random.default_rng(3)
    for _ in range(5):
        image, centres = picture(rng, apart, 0.8)
        points = extract(image, SENSOR)
        assert len(points) == 2
        assert np.all(np.linalg.norm(points.uv_px[:, None] - centres, axis=2).min(axis=0) < 0.2)


@pytest.mark.parametrize("config", [None, QUIET])
@pytest.mark.parametrize("apart", [0.8, 1.0])
def test_nearer_ones_are_one_point_with_a_flag(apart, config):
    rng = np.random.default_rng(4)
    for _ in range(5):
        assert extract(picture(rng, apart, 1.0)[0], SENSOR, config).flag == ("odd_shape",)


@pytest.mark.parametrize(("shape", "contrast"), [((1.3, 1.3), 0.0), ((2.6, 0.9), 0.0), ((2.6, 0.9), 0.33)])
def test_one_spot_stays_one(shape, contrast):
    """Speckle breaks a long one into several peaks."""
    rng = np.random.default_rng(5)
    for _ in range(30):
        assert len(extract(picture(rng, 0.0, 0.5, shape, contrast)[0], SENSOR)) == 1
