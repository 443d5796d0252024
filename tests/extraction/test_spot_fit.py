"""The spot's fit against its bound: exact recovery, RMSE, covariance, clipping; truths by quadrature, not the model."""

import cv2
import numpy as np
import pytest

from extraction.spots import TrueSpot, fit_peaks, fit_stack, mean_image, position_bound
from geometry import InputError
from tests.pinned import pinned

ATOL_EXACT_PX = 2e-3  # the pixel's integral is taken to fourth order in 1/σ
SIDE = 11


def stack(rng, count, electrons, background, read, shape=(1.3, 1.3, 0.0), side=SIDE):
    """Images, true centres and the mean bound (2, 2)."""
    phases = rng.uniform(-0.5, 0.5, (100, 2))
    spots = [TrueSpot(side // 2 + u, side // 2 + v, electrons, *shape, background) for u, v in phases]
    mean = np.array([mean_image(s, (side, side)) for s in spots])
    bound = np.mean([position_bound(s, (side, side), read, round_spot=shape[0] == shape[1]) for s in spots], axis=0)
    pick = rng.integers(0, 100, count)
    return rng.poisson(mean[pick]) + rng.normal(0, read, (count, side, side)), side // 2 + phases[pick], bound


@pytest.mark.parametrize(("along", "across"), [(1.3, 1.3), (2.4, 0.9), (1.0, 0.8), (3.2, 1.1)])
def test_noise_free_spot_is_recovered(along, across):
    rng = np.random.default_rng(1)
    spots = [TrueSpot(*rng.uniform(7.5, 8.5, 2), 5000, along, across, rng.uniform(-1.5, 1.5), 12.0) for _ in range(50)]
    fit = fit_stack([mean_image(s, (17, 17)) for s in spots], 1.0)
    pinned(fit)
    assert np.all(fit.converged)
    np.testing.assert_allclose(fit.uv_px, [(s.u_px, s.v_px) for s in spots], atol=ATOL_EXACT_PX)
    np.testing.assert_allclose(np.linalg.eigvalsh(fit.shape_px2), [(across**2, along**2)] * 50, rtol=0.02)


@pytest.mark.parametrize(
    ("light", "limit"), [((300, 5, 2), 1.10), ((1000, 50, 2), 1.06), ((10_000, 20, 5), 1.04), ((100_000, 20, 5), 1.04)]
)
def test_round_spots_reach_the_bound(light, limit):
    """3,000 spots: the ratio's own standard deviation is 0.009, so the limits stand 2-3 σ above the reach of 1.03."""
    images, truth, bound = stack(np.random.default_rng(2), 3000, *light)
    fit = fit_stack(images, light[2] ** 2)
    pinned(fit)
    rmse = np.sqrt(np.mean((fit.uv_px - truth) ** 2))
    assert 0.96 < rmse / np.sqrt(np.trace(bound) / 2) < limit
    assert np.mean(fit.converged) > 0.998


@pytest.mark.parametrize("shape", [(3.0, 0.9, 0.6), (2.2, 1.2, -0.5)])
def test_elongated_spots_reach_the_bound_in_both_axes(shape):
    images, truth, bound = stack(np.random.default_rng(3), 3000, 3000, 20, 5, shape, side=15)
    fit = fit_stack(images, 25.0)
    pinned(fit)
    turn = np.array([[np.cos(shape[2]), -np.sin(shape[2])], [np.sin(shape[2]), np.cos(shape[2])]])
    scatter = np.std((fit.uv_px - truth) @ turn, axis=0)
    np.testing.assert_allclose(scatter / np.sqrt(np.diag(turn.T @ bound @ turn)), 1.0, atol=0.06)


def test_reported_covariance_is_that_of_the_errors():
    """NEES of 2 degrees of freedom; mean of 3,000 has a standard deviation of 0.04."""
    images, truth, _ = stack(np.random.default_rng(4), 3000, 2000, 10, 3, (2.0, 1.0, 0.4))
    fit = fit_stack(images, 9.0)
    pinned(fit)
    error = fit.uv_px - truth
    nees = np.einsum("ni,nij,nj->n", error, np.linalg.inv(fit.cov_uv_px2), error)
    assert abs(np.mean(nees) - 2.0) < 0.15


def test_clipped_pixels_are_left_out():
    """Bias stays below a tenth of a pixel's hundredth where the naive centroid of a clipped, off-centre spot fails."""
    rng = np.random.default_rng(5)
    spots = [TrueSpot(*rng.uniform(7.5, 8.5, 2), 20_000, 2.0, 1.1, 0.7, 10.0) for _ in range(300)]
    images = np.array([rng.poisson(mean_image(s, (17, 17))) for s in spots], dtype=float)
    fit = fit_stack(np.minimum(images, 600.0), 1.0, saturation=600.0)
    pinned(fit)
    error = fit.uv_px - [(s.u_px, s.v_px) for s in spots]
    assert np.sqrt(np.mean(error**2)) < 0.02
    assert np.all(np.abs(np.mean(error, axis=0)) < 0.004)


def test_bound_is_the_inverse_information_of_the_quadrature_model():
    """The bound's derivatives against numeric ones of the mean image."""
    spot = TrueSpot(5.2, 4.9, 3000, 1.8, 1.0, 0.5, 20)
    step = 1e-5

    def image(u=0.0, v=0.0, n=0.0, b=0.0, a=0.0, c=0.0, t=0.0):
        s = TrueSpot(
            spot.u_px + u,
            spot.v_px + v,
            spot.electrons + n,
            spot.along_px + a,
            spot.across_px + c,
            spot.axis_rad + t,
            20 + b,
        )
        return mean_image(s, (11, 11)).ravel()

    names = ("u", "v", "n", "b", "a", "c", "t")
    jacobian = np.column_stack([(image(**{k: step}) - image(**{k: -step})) / (2 * step) for k in names])
    information = jacobian.T @ (jacobian / (image() + 4.0)[:, None])
    np.testing.assert_allclose(position_bound(spot, (11, 11), 2.0), np.linalg.inv(information)[:2, :2], rtol=1e-5)


def test_fast_method_is_near_the_bound_and_says_so():
    """Its own covariance is right; a log-parabola loses a few per cent on round spots matched to the blur."""
    images, truth, bound = stack(np.random.default_rng(6), 3000, 1000, 5, 2)
    kernel = cv2.getGaussianKernel(9, 1.3, cv2.CV_64F)
    smooth = np.stack([cv2.sepFilter2D(im.astype(np.float32), cv2.CV_32F, kernel, kernel) for im in images])
    best = smooth[:, 3:-3, 3:-3].reshape(len(images), -1).argmax(1)
    u, v = best % 5 + 3, best // 5 + 3
    peaks = np.column_stack([u, v + SIDE * np.arange(len(images))])
    fit = fit_peaks(
        smooth.reshape(-1, SIDE), peaks, np.full(len(images), 5.0), np.full(len(images), 50.0), kernel[:, 0]
    )
    error = fit.uv_px - [0, SIDE] * np.stack([np.zeros(len(images)), np.arange(len(images))], 1) - truth
    assert np.sqrt(np.mean(error**2) / (np.trace(bound) / 2)) < 1.15
    assert 0.5 < np.sqrt(np.mean(fit.cov_uv_px2[:, 0, 0])) / np.std(error[:, 0]) < 2.0


@pytest.mark.parametrize(
    ("images", "variance", "words"),
    [
        (np.zeros((3, 4, 9)), 1.0, "H, W ≥ 5"),
        (np.zeros((2, 9, 9)), 0.0, "read_variance"),
        (np.full((1, 9, 9), np.nan), 1.0, "finite"),
    ],
)
def test_bad_stacks_are_refused(images, variance, words):
    with pytest.raises(InputError, match=words) as refused:
        fit_stack(images, variance)
    pinned(str(refused.value))


def test_blank_and_noise_windows_end_without_a_trustworthy_spot():
    """Nothing is raised; what converged on noise alone has an uncertainty of its own width."""
    rng = np.random.default_rng(7)
    fit = fit_stack(np.concatenate([np.zeros((3, 9, 9)), rng.normal(10, 2, (200, 9, 9))]), 4.0)
    pinned(fit)
    sure = fit.converged & (np.trace(fit.cov_uv_px2, axis1=1, axis2=2) < 2 * 0.1**2)
    assert not np.any(sure)
