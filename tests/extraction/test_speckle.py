"""Contrast and grain of the speckle by spots' residuals: against dense algebra, and against fields that are drawn."""

from __future__ import annotations

import numpy as np
import pytest
import scipy.fft
from numpy.typing import NDArray
from scipy.special import j1
from scipy.stats import multivariate_normal

from extraction import ExtractionConfig, LocaliseConfig, SpotNoiseConfig, extract, learn_speckle
from extraction.noise import NOISE
from extraction.spots.error import correlation, estimate_speckle
from extraction.spots.error.influence import DISTANCES2
from extraction.spots.error.speckle import POWERS, _BrightPixels, _likelihoods
from extraction.spots.fit import PLACE, Windows
from extraction.spots.frame import Fits
from extraction.spots.model import SPOT
from geometry import Camera, Pose, Sensor, Sheet
from tests.pinned import pinned

Array = NDArray[np.float64]

ROWS, COLUMNS, SIDE, OVER = 9, 11, 27, 6
BLACK_DN, GAIN, READ_DN = 4.0, 0.0251, 0.4


def sensor() -> Sensor:
    """A sensor of the frames' size that looks at the sheet from the side."""
    turn = np.linalg.svd(np.array([[0, -0.924, -0.382], [1, 0, 0], [0, -0.382, 0.924]]))
    pose, width, height = Pose(turn[0] @ turn[2], np.array([120.0, 0, 0])), COLUMNS * SIDE, ROWS * SIDE
    centre = (width - 1) / 2, (height - 1) / 2
    return Sensor(Sheet(), Camera(width, height, 2300.0, 2300.0, *centre, pose, black_level=BLACK_DN))


def drawn(
    along: float, across: float, grain_px: float, looks: int, rng: np.random.Generator
) -> tuple[NDArray[np.uint8], Array]:
    """Gaussian spots of 120 grey levels, each times its own field of a round pupil, and their centres (N, 2) [px]."""
    count, side = ROWS * COLUMNS, SIDE * OVER
    f = np.fft.fftfreq(side) * OVER
    pupil = (np.hypot(f[:, None], f) < 0.5 / grain_px).astype(np.float32)
    light = np.zeros((count, side, side), np.float32)
    for _ in range(looks):
        noise = rng.standard_normal((2, count, side, side), np.float32)
        light += np.abs(scipy.fft.ifft2(scipy.fft.fft2(noise[0] + 1j * noise[1]) * pupil)) ** 2
    light /= light.mean()
    at = (np.arange(side) + 0.5) / OVER - 0.5 - SIDE // 2
    shift, angle = rng.uniform(-0.5, 0.5, (count, 2)), rng.uniform(-np.pi / 2, np.pi / 2, count)
    x, y = at - shift[:, 0, None, None], at[:, None] - shift[:, 1, None, None]
    c, s = np.cos(angle)[:, None, None], np.sin(angle)[:, None, None]
    light *= np.exp(-0.5 * (((c * x + s * y) / along) ** 2 + ((c * y - s * x) / across) ** 2)) * 120.0
    pixels = light.reshape(count, SIDE, OVER, SIDE, OVER).mean(axis=(2, 4))
    mean = pixels.reshape(ROWS, COLUMNS, SIDE, SIDE).transpose(0, 2, 1, 3).reshape(ROWS * SIDE, COLUMNS * SIDE)
    noisy = rng.poisson(mean / GAIN) * GAIN + rng.normal(0, READ_DN, mean.shape) + BLACK_DN
    row, column = np.divmod(np.arange(count), COLUMNS)
    centres = np.column_stack([column, row]) * SIDE + SIDE // 2 + shift
    return np.clip(np.rint(noisy), 0, 255).astype(np.uint8), centres


# spots narrower than a pixel, wider ones, and a grain wider than a pixel
@pytest.mark.parametrize(
    ("along", "across", "grain_px", "looks"), [(0.75, 0.6, 0.5, 2), (1.4, 1.1, 0.5, 2), (2.1, 1.6, 1.1, 2)]
)
def test_sigma_by_the_speckle_learnt_is_the_scatter(along: float, across: float, grain_px: float, looks: int) -> None:
    image, centres = drawn(along, across, grain_px, looks, np.random.default_rng(5))
    many = ExtractionConfig(localise=LocaliseConfig(max_spots=2 * ROWS * COLUMNS))
    points = extract(image, sensor(), learn_speckle([image], sensor(), many))
    pinned(points)
    near = np.argmin(np.linalg.norm(points.uv_px[:, None] - centres, axis=2), axis=1)
    error = points.uv_px - centres[near]
    clear = np.array([flag == "" for flag in points.flag])
    assert clear.sum() > 0.8 * ROWS * COLUMNS
    stated = np.trace(points.cov_uv_px2[clear].mean(axis=0))
    assert np.sqrt(stated / np.mean(np.sum(error[clear] ** 2, axis=1))) == pytest.approx(1.0, abs=0.2)


def test_contrast_is_that_of_the_field() -> None:
    image, _ = drawn(1.4, 1.1, 0.5, 2, np.random.default_rng(5))
    noise = learn_speckle([image], sensor(), ExtractionConfig(localise=LocaliseConfig(max_spots=200))).noise
    pinned(noise)
    # the field's variance of pixels, from its definition on a fine grid
    wide = np.random.default_rng(6).standard_normal((2, 900, 900))
    f = np.fft.fftfreq(900) * OVER
    fine = np.abs(np.fft.ifft2(np.fft.fft2(wide[0] + 1j * wide[1]) * (np.hypot(f[:, None], f) < 1.0))) ** 2
    pixels = fine.reshape(150, OVER, 150, OVER).mean(axis=(1, 3)) / fine.mean()
    assert noise.speckle_contrast == pytest.approx(np.sqrt(pixels.var() / 2), rel=0.1)


def one_spot(rng: np.random.Generator, residual: float = 1.0) -> Fits:
    """A window with a spot of 100 grey levels, σ 1.4 × 1.6 px, and residuals of 20 % of it."""
    rows = columns = 13
    place, spot, noise = np.zeros(1, PLACE), np.zeros(1, SPOT), np.zeros(1, NOISE)
    place["rows"], place["columns"], place["terms"] = rows, columns, 7
    values = {"u": 6.2, "v": 5.9, "height": 100.0, "a": 0.5, "h": 0.1, "c": 0.4, "level": 5.0}
    for name, value in values.items():
        spot[name] = value
    noise["floor"], noise["gain"], noise["dark"] = 0.3, 0.03, 5.0
    j, i = np.indices((rows, columns))
    x, y = i - 6.2, j - 5.9
    signal = 100.0 * np.exp(-0.5 * (0.5 * x * x + 0.2 * x * y + 0.4 * y * y))
    grey = 5.0 + signal + residual * (0.2 * signal * rng.normal(size=signal.shape) + rng.normal(size=signal.shape))
    return Fits(Windows(grey[None], np.ones((1, rows, columns), dtype=bool)), place, spot, noise)


def test_likelihood_is_that_of_the_residuals_freed_of_the_terms() -> None:
    fits = one_spot(np.random.default_rng(1))
    contrasts, grains = np.array([0.1, 0.3, 0.6]), np.array([0.3, 0.8])
    found = next(_likelihoods(fits, 0.006, contrasts, grains))
    j, i = (a.ravel() for a in np.indices((13, 13)))
    x, y = i - 6.2, j - 5.9
    bell = np.exp(-0.5 * (0.5 * x * x + 0.2 * x * y + 0.4 * y * y))
    chosen = bell >= min(max(np.sort(bell)[-30], 0.03), 0.1)
    x, y, i, j, bell = x[chosen], y[chosen], i[chosen], j[chosen], bell[chosen]
    residual = fits.windows.grey[0].ravel()[chosen] - 5.0 - 100.0 * bell
    camera = np.diag(0.3 + 0.03 * 100.0 * bell + 0.6**2)
    powers = [(a, b) for a in range(5) for b in range(5 - a)]
    terms = np.stack([bell * x**a * y**b for a, b in powers], axis=1)
    left = np.linalg.svd(terms.T)[2][len(powers) :]  # contrasts of the data that the terms do not enter
    slope2 = (0.5 * x + 0.1 * y) ** 2 + (0.1 * x + 0.4 * y) ** 2
    d2 = (i[:, None] - i) ** 2 + (j[:, None] - j) ** 2
    points = np.random.default_rng(2).uniform(-0.5, 0.5, (4, 400_000))
    dense = np.empty((2, 3))
    for g, grain in enumerate(grains):
        # ⟨x x'⟩ of two points of a pixel, weighted by the field's correlation
        q = np.pi * np.hypot(points[0] - points[1], points[2] - points[3]) / grain
        shared = (2 * j1(q) / q) ** 2
        within = np.mean(points[0] * points[1] * shared) / np.mean(shared)
        signal = 100.0 * bell * np.sqrt(1 + within * slope2)
        rho = sum(value * (d2 == d) for d, value in zip(DISTANCES2, correlation(grain), strict=True))
        for c, contrast in enumerate(contrasts):
            covariance = camera + (contrast**2 + 0.02**2) * rho * np.outer(signal, signal)
            dense[g, c] = multivariate_normal.logpdf(left @ residual, None, left @ covariance @ left.T)
    dense = np.logaddexp(dense, dense.max() + np.log(1e-3))  # a spot may be something else
    np.testing.assert_allclose(found - found[0, 0], dense - dense[0, 0], atol=0.1)


def test_an_odd_spot_does_not_speak_for_all() -> None:
    rng = np.random.default_rng(4)
    plain = [one_spot(rng) for _ in range(12)]
    odd = one_spot(rng, residual=5.0)
    alone, with_odd = estimate_speckle(plain, 0.006), estimate_speckle([*plain, odd], 0.006)
    pinned((alone, with_odd))
    assert with_odd.contrast == pytest.approx(alone.contrast, rel=0.05)


def test_what_is_given_is_kept() -> None:
    spots = [one_spot(np.random.default_rng(7))]
    known = estimate_speckle(spots, 0.006, contrast=0.4)
    pinned(known)
    assert known.contrast == 0.4
    assert estimate_speckle(spots, 0.006, grain_px=0.9).grain_px == 0.9
    config = ExtractionConfig(noise=SpotNoiseConfig(speckle_contrast=0.3, speckle_grain_px=0.5))
    assert learn_speckle([np.zeros((ROWS * SIDE, COLUMNS * SIDE), np.uint8)], sensor(), config) == config


def test_powers_that_few_columns_can_not_tell_apart_are_taken_once() -> None:
    """On four columns the fourth power of x is a sum of the lower ones: what is left does not hang on rounding."""
    y, x = (a.ravel() for a in np.mgrid[-4:5, -1:3].astype(float))
    powers = POWERS
    terms = x[:, None] ** powers[:, 0] * y[:, None] ** powers[:, 1]
    one = np.ones(len(x))
    distance2 = ((x[:, None] - x) ** 2 + (y[:, None] - y) ** 2).astype(np.intp)
    basis = _BrightPixels(one, one, one, one, terms, distance2).freed()
    assert basis is not None
    assert basis.shape == (36, 36 - 14)
    np.testing.assert_allclose(basis.T @ terms, 0.0, rtol=0, atol=1e-10)
    np.testing.assert_allclose(basis.T @ basis, np.eye(22), rtol=0, atol=1e-12)
