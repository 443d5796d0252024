"""Two near spots: taken apart down to 1.2 full widths at half maximum, one flagged point below; by own pictures."""

import cv2
import numpy as np
import pytest
from scipy.optimize import least_squares

from extraction import ExtractionConfig, SpotNoiseConfig, extract, extract_stages
from extraction.noise import PixelNoise
from extraction.spots.detect import prepare
from extraction.spots.fit import PLACE, Window, Windows
from extraction.spots.model import SPOT, Spot
from extraction.spots.two import NearPeak, fit_two, flat_topped, full_widths_apart
from tests.extraction.spots import make_sensor
from tests.pinned import pinned

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
        pinned(points)
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
        pinned(points)
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


def test_the_joint_fit_is_that_of_another_solver():
    """Weights of one variance: then least squares by scipy has the same answer, from the truth on."""
    rng = np.random.default_rng(6)
    y, x = np.mgrid[:19, :23].astype(float)

    def mean(q):
        a, h, c = q[6:9]
        bells = [
            np.exp(-0.5 * (a * (x - u) ** 2 + 2 * h * (x - u) * (y - v) + c * (y - v) ** 2))
            for u, v in (q[0:2], q[3:5])
        ]
        return q[2] * bells[0] + q[5] * bells[1] + q[9]

    truth = np.array([9.3, 8.8, 100.0, 13.9, 10.1, 70.0, 0.5, -0.1, 0.6, 12.0])
    grey = mean(truth) + rng.normal(0, 2, x.shape)
    other = least_squares(lambda q: (mean(q) - grey).ravel(), truth, xtol=1e-12, ftol=1e-12).x
    one = Spot(11.0, 9.0, 110.0, 0.2, 0.0, 0.5, 12.0, 0.0, 0.0)
    window = Window(grey, np.ones(grey.shape, dtype=np.bool_))
    stands, found = fit_two(window, one, NearPeak(14.0, 10.0, 65.0), PixelNoise(4.0, 0.0, 0.0, 0.0))
    pinned((stands, found))
    assert stands
    assert np.abs(found.q - other).max() < 1e-2 * np.abs(other).max()
    assert np.abs(found.q[[0, 1, 3, 4]] - other[[0, 1, 3, 4]]).max() < 2e-3  # a hundredth of σ
    assert 1.3 < full_widths_apart(found.q) < 1.5


def test_one_grainy_spot_is_no_flat_top():
    """A dozen pixels of speckle are explained by five moments to most; two spots would have to explain nearly all."""
    rng, n = np.random.default_rng(7), 400
    y, x = np.mgrid[:11, :11].astype(float)
    signal = 100 * np.exp(-0.5 * ((x - 5) ** 2 + (y - 5) ** 2) / 1.2)
    grey = signal * (1 + 0.3 * rng.normal(0, 1, (n, 11, 11))) + 5
    place, spots, out = np.zeros(n, PLACE), np.zeros(n, SPOT), np.zeros(n, dtype=np.bool_)
    place["rows"] = place["columns"] = 11
    for name, value in zip(SPOT.names, (5, 5, 100, 1 / 1.2, 0, 1 / 1.2, 5, 0, 0), strict=True):
        spots[name] = value
    flat_topped(Windows(grey, np.ones(grey.shape, dtype=np.bool_)), place, spots, out)
    assert np.mean(out) < 0.1


def dots(pitch):
    """Dots all over the image, as far apart as that in both directions, and how many of them lie whole in it."""
    rng, (y, x) = np.random.default_rng(8), np.mgrid[:HEIGHT, :WIDTH].astype(float)
    off = [(axis + pitch / 2) % pitch - pitch / 2 for axis in (x, y)]
    mean = 10 + 120 * np.exp(-0.5 * (off[0] ** 2 + off[1] ** 2) / SIGMA_PX**2)
    image = np.clip(np.round(mean + rng.normal(0, 1, mean.shape) * np.sqrt(0.03 * mean + 0.6)), 0, 255).astype(np.uint8)
    return image, ((WIDTH - 1 - pitch) // pitch) * ((HEIGHT - 1 - pitch) // pitch)


@pytest.mark.parametrize("pitch", [13, 16, 20])
def test_dots_that_fill_every_block_are_found_by_the_ground_between(pitch):
    image, whole = dots(pitch)
    points = extract(
        image,
        SENSOR,
        ExtractionConfig.model_validate({"localise": {"max_spots": 10000}, "detect": {"max_candidates": 30000}}),
    )
    pinned(points)
    inside = points.uv_px[np.all((points.uv_px > 5) & (points.uv_px < np.array([WIDTH, HEIGHT]) - 6), axis=1)]
    off = np.abs((inside + pitch / 2) % pitch - pitch / 2).max(axis=1)  # those at the border are cut by it
    assert len(inside) >= whole
    assert off.max() < 0.2


@pytest.mark.parametrize("grain", [2.5, 5.0])
def test_a_blotched_surface_is_no_grid_of_dots(grain):
    """Light fills its blocks too, but no ground lies between."""
    rng = np.random.default_rng(9)
    blotches = cv2.GaussianBlur(rng.normal(size=(HEIGHT, WIDTH)), (0, 0), grain)
    mean = 60 * np.clip(1 + 0.6 * blotches / blotches.std(), 0, None)
    image = np.clip(np.round(rng.normal(mean, np.sqrt(0.03 * mean + 0.6))), 0, 255).astype(np.uint8)
    assert not prepare(image, ExtractionConfig().detect).dense.any()
    assert len(extract(image, SENSOR)) <= 2


@pytest.mark.parametrize(("pitch", "told"), [(9, True), (60, False)])
def test_a_grid_too_fine_to_be_found_is_said(pitch, told):
    image, _ = dots(pitch)
    remarks = []
    points = extract(image, SENSOR, remark=remarks.append)
    pinned(points)
    assert any("full of light" in text for text in remarks) == told
    assert ("full of light" in extract_stages(image, SENSOR).reason) == told
    assert (len(points) > 0) != told
