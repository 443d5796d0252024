"""The compiled error budget against dense matrices over all pixels, written from the definitions.

Proves the sums, not that speckle is as assumed: the rendered frames of test_extract_emulated are for that.
"""

import numpy as np
import pytest

from extraction.noise import NOISE as LAW
from extraction.spots import correlation
from extraction.spots.error import error_budget
from extraction.spots.error.influence import BRIGHT, CORE, DISTANCES2, WITHIN_PIXEL
from extraction.spots.fit import PLACE, Windows
from extraction.spots.frame import Fits
from extraction.spots.model import SPOT

ROWS, COLUMNS = 13, 15
NOISE = np.array([2.0, 0.02, 10.0, 0.16, 0.5])  # v₀, gain, level, k², what only the weights have


def model(terms):
    """Data, pixels in use, parameters, and the dense model: terms (P, n + 2), signal, mean, weights, coordinates."""
    p = np.array([6.8, 6.1, 90.0, 0.22, 0.1, 0.6, 11.0, 0.3, -0.2])
    if terms == 7:
        p[7:] = 0.0
    j, i = np.mgrid[:ROWS, :COLUMNS]
    x, y = (i - p[0]).ravel(), (j - p[1]).ravel()
    bell = np.exp(-0.5 * (p[3] * x * x + 2 * p[4] * x * y + p[5] * y * y))
    signal, mean = p[2] * bell, p[2] * bell + p[6] + p[7] * i.ravel() + p[8] * j.ravel()
    variance = NOISE[0] + NOISE[1] * np.maximum(mean - NOISE[2], 0)
    use = np.ones(ROWS * COLUMNS, dtype=bool)
    use[[3, 97, 111]] = False
    weight = use / (variance + NOISE[3] * signal**2 + NOISE[4])
    values, vectors = np.linalg.eigh(np.array([[p[3], p[4]], [p[4], p[5]]]))
    t = np.sqrt(values[0]) * (vectors[0, 0] * x + vectors[1, 0] * y)
    e = [bell, bell * x, bell * y, bell * x * x / 2, bell * x * y, bell * y * y / 2, np.ones_like(x)]
    e += [i.ravel(), j.ravel()] if terms == 9 else []
    e += [signal * (t**3 - 3 * t) / 6, signal * (t**4 - 6 * t**2 + 3) / 24]
    data = mean + np.random.default_rng(3).normal(0, np.sqrt(variance + 0.1 * signal**2))
    return data, use, p, np.column_stack(e), signal, mean, variance, weight, np.column_stack([x, y])


def budget(data, use, p, terms):
    place, spot, noise = np.zeros(1, PLACE), np.zeros(1, SPOT), np.zeros(1, LAW)
    place["rows"], place["columns"], place["terms"] = ROWS, COLUMNS, terms
    for name, value in zip(SPOT.names, p, strict=True):
        spot[name] = value
    for name, value in zip(("floor", "gain", "dark", "speckle2", "model2"), NOISE, strict=True):
        noise[name] = value
    windows = Windows(data.reshape(1, ROWS, COLUMNS), use.reshape(1, ROWS, COLUMNS))
    return error_budget(Fits(windows, place, spot, noise))


def speckle_matrix(signal, p, place, grain):
    """Covariance of speckle of contrast 1 over the pixels, cut where the classes of distance end."""
    slope = place @ np.array([[p[3], p[4]], [p[4], p[5]]])  # of the light's logarithm
    signal = signal * np.sqrt(1 + WITHIN_PIXEL * np.sum(slope**2, axis=1))
    d2 = np.rint(np.sum((place[:, None] - place[None]) ** 2, axis=2)).astype(int)
    rho = np.zeros(d2.shape)
    for distance, value in zip(DISTANCES2, correlation(grain), strict=True):
        rho[d2 == distance] = value
    return signal[:, None] * rho * signal[None]


@pytest.mark.parametrize("terms", [7, 9])
def test_covariance_is_that_of_the_linear_estimate(terms):
    data, use, p, e, signal, _, variance, weight, place = model(terms)
    about = budget(data, use, p, terms)
    fit = e[:, :terms]
    inverse = np.linalg.inv(fit.T @ (weight[:, None] * fit))
    precision = np.array([[p[3], p[4]], [p[4], p[5]]])
    move = np.linalg.inv(precision) / p[2] @ (inverse @ (weight[:, None] * fit).T)[1:3]
    np.testing.assert_allclose(about.camera[0, :2, :2], move @ np.diag(variance) @ move.T, rtol=1e-8)
    np.testing.assert_allclose(about.white[0, :2, :2], p[2] ** 2 * move @ move.T, rtol=1e-8)
    speckled = move @ speckle_matrix(signal, p, place, 0.5) @ move.T
    np.testing.assert_allclose(about.speckle[0, :2, :2] @ correlation(0.5), speckled, rtol=1e-8)


@pytest.mark.parametrize("terms", [7, 9])
def test_residuals_are_expected_as_the_hat_matrix_makes_them(terms):
    data, use, p, e, signal, mean, variance, weight, place = model(terms)
    about, height = budget(data, use, p, terms), signal.max()
    weight = np.where(signal > BRIGHT * height, weight, 0.0)
    core = np.flatnonzero((weight > 0) & (signal > CORE * height))
    hat = e @ np.linalg.inv(e.T @ (weight[:, None] * e)) @ (weight[:, None] * e).T
    left = np.eye(len(data)) - hat
    residual = left @ np.where(use, data - mean, 0.0)
    camera, speckle = left @ np.diag(variance) @ left.T, left @ speckle_matrix(signal, p, place, 0.5) @ left.T
    own = core, core
    noise = camera[own].sum() / height**2
    np.testing.assert_allclose(about.variance[0], np.sum(residual[core] ** 2) / height**2 - noise, rtol=1e-6)
    np.testing.assert_allclose(about.variance_speckle[0] @ correlation(0.5), speckle[own].sum() / height**2, rtol=1e-6)
    np.testing.assert_allclose(about.variance_camera[0], noise, rtol=1e-6)


def test_a_fit_without_information_has_no_covariance():
    data, use, p, *_ = model(7)
    assert np.isnan(budget(data, np.zeros_like(use), p, 7).camera).all()
