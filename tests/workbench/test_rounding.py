"""What files hold of a number: enough for every use, less than what hangs on a processor."""

import math

import numpy as np

from geometry import Pose, rounded, rounded_by_sigma, rounded_covariance

NOISE = 1e-12  # relative, of a solved number from one processor to another


def test_noise_is_not_written() -> None:
    rng = np.random.default_rng(2)
    pose = Pose.exp(np.array([1234.5, -310.1, 77.7, 0.4, -1.1, 2.0])).matrix
    root = rng.normal(size=(6, 6)) * np.array([[0.2], [0.3], [0.1], [1e-4], [2e-4], [1e-4]])
    result = {
        "T_hand_sensor": pose,
        "covariance": root @ root.T,
        "chi2": 1.2345678901,
        "points": [{"y_mm": -0.1234567891}],
    }
    for _ in range(20):
        moved = {
            k: v * (1 + rng.uniform(-NOISE, NOISE, v.shape)) for k, v in result.items() if isinstance(v, np.ndarray)
        }
        moved["covariance"] = (moved["covariance"] + moved["covariance"].T) / 2
        assert rounded(result | moved) == rounded(result)


def test_a_reader_gets_what_was_solved() -> None:
    pose = Pose.exp(np.array([1234.5, -310.1, 77.7, 0.4, -1.1, 2.0])).matrix
    again = np.array(rounded({"T_base_jig": pose})["T_base_jig"])
    np.testing.assert_allclose(again[:3, :3], pose[:3, :3], rtol=0, atol=1e-9)
    np.testing.assert_allclose(again[:3, 3], pose[:3, 3], rtol=1e-8, atol=0)
    root = np.random.default_rng(1).normal(size=(6, 6)) * 0.01
    np.testing.assert_allclose(rounded(root @ root.T, "covariance"), root @ root.T, rtol=1e-4, atol=1e-9)


def test_plain_values_stay_and_no_zero_is_negative() -> None:
    given = {"n": 3, "text": "1.23456789012", "flag": True, "none": None, "zero": -1e-17, "tiny": [1e-20]}
    out = rounded(given)
    assert out == {"n": 3, "text": "1.23456789012", "flag": True, "none": None, "zero": 0.0, "tiny": [0.0]}
    assert math.copysign(1.0, out["zero"]) == 1.0
    assert math.isnan(rounded(float("nan")))


def test_flat_matrices_stay_flat() -> None:
    assert rounded({"T_x": list(np.eye(4).ravel())})["T_x"] == np.eye(4).ravel().tolist()
    assert len(rounded({"covariance": list(np.eye(6).ravel())})["covariance"]) == 36


def test_numbers_that_count_together_keep_a_millionth_of_their_sigma() -> None:
    assert rounded_by_sigma(2299.276242961158, 1.6) == rounded_by_sigma(2299.276242961155, 1.6) == 2299.276243
    assert rounded_by_sigma(-0.00028054503355640, 2e-4) == -0.000280545
    assert rounded_by_sigma(-1e-15, 2e-4) == 0.0
    assert rounded_by_sigma(1.23456789012, 0.0) == 1.2345679


def test_no_rounding_makes_a_variance_negative() -> None:
    """Of numbers that trade places: 34 px each, and together known to a thousandth of that."""
    root = np.array([[34.0, 0.0, 0.0], [34.0, 4e-4, 0.0], [-0.01, 1e-7, 1e-5]])
    kept = rounded_covariance(root @ root.T)
    way = np.array([1.0, -1.0, 0.0])
    assert np.linalg.eigvalsh(kept / np.sqrt(np.outer(np.diag(kept), np.diag(kept))))[0] > 0
    np.testing.assert_allclose(way @ kept @ way, way @ root @ root.T @ way, rtol=0.1, atol=0)
