"""Numbers as files hold them: so many digits and places, no more and no fewer."""

from __future__ import annotations

import json
import math

import numpy as np
import pytest

from geometry import Pose
from geometry.rounding import (
    clean,
    json_text,
    rounded,
    rounded_by_sigma,
    rounded_covariance,
    rounded_number,
    rounded_transform,
)

NOISE = 1e-12  # relative, of a solved number from one processor to another


@pytest.mark.parametrize(
    ("value", "kept"),
    [
        (123456.7894, 123456.789),  # nine digits
        (123456.7896, 123456.79),
        (0.12345674, 0.1234567),  # seven places
        (0.12345676, 0.1234568),
        (-1e-9, 0.0),
        (1234567894.0, 1234567890.0),
        (math.inf, math.inf),
    ],
)
def test_a_number_has_nine_digits_and_seven_places(value: float, kept: float) -> None:
    assert rounded_number(value) == kept
    assert math.copysign(1, rounded_number(-1e-9)) == 1
    assert rounded({"x_mm": [value, 3, "text", None, True]}) == {"x_mm": [kept, 3, "text", None, True]}


@pytest.mark.parametrize(
    ("value", "sigma", "kept"),
    [
        (1.23456789123, 0.9, 1.2345679),  # σ begins at the first place: a millionth of it at the seventh
        (1.23456789123, 0.1, 1.2345679),
        (1.23456789123, 0.099, 1.23456789),
        (1234.56789123, 50.0, 1234.56789),
        (1.23456789123, 0.0, 1.2345679),
        (1.23456789123, math.inf, 1.2345679),
    ],
)
def test_a_number_is_kept_to_a_millionth_of_its_sigma(value: float, sigma: float, kept: float) -> None:
    assert rounded_by_sigma(value, sigma) == kept


def test_a_transform_keeps_nine_places_of_its_rotation() -> None:
    m = np.eye(4)
    m[0, 1], m[0, 3], m[1, 0] = 0.1234567894, 1234.56789456, -1e-11
    kept = rounded_transform(m)
    assert (kept[0, 1], kept[0, 3]) == (0.123456789, 1234.56789)
    assert math.copysign(1, kept[1, 0]) == 1
    assert rounded({"T_a_b": m.tolist(), "t_mm": m.tolist()})["T_a_b"] == kept.tolist()
    assert rounded({"T_a_b": m.ravel().tolist()})["T_a_b"] == kept.ravel().tolist()
    assert rounded({"T_a_b": [0.12345678949]})["T_a_b"] == [0.1234568]
    assert rounded({"t_a": m.ravel().tolist()})["t_a"][1] == 0.1234568


def test_a_covariance_keeps_six_digits_of_every_sigma_and_six_places_of_correlations() -> None:
    sigma, correlation = np.array([1.23456749, 1e-3]), 0.12345649
    m = np.array([[sigma[0] ** 2, correlation * sigma.prod()], [correlation * sigma.prod(), sigma[1] ** 2]])
    kept = rounded_covariance(m)
    np.testing.assert_allclose(np.sqrt(np.diag(kept)), [1.23457, 1e-3], rtol=1e-14)
    assert kept[0, 1] / np.sqrt(kept[0, 0] * kept[1, 1]) == pytest.approx(0.123456, abs=1e-14)
    assert rounded({"covariance": m.tolist()})["covariance"] == kept.tolist()
    assert rounded({"covariance": m.ravel().tolist()})["covariance"] == kept.ravel().tolist()
    assert rounded({"covariances": m.tolist()})["covariances"] != kept.tolist()
    flat = np.array([[1.23456749, 0.0], [0.0, 0.0]])
    assert rounded_covariance(flat)[0, 0] == 1.23457


@pytest.mark.parametrize("less", [1e-4, 1e-7, 1e-10])
def test_unknowns_that_trade_places_keep_what_they_are_known_to_together(less: float) -> None:
    """Two of σ 1 whose sum is known far better: rounding changes that by a twentieth at most."""
    m = np.array([[1.0, -1 + less], [-1 + less, 1.0]])
    kept = rounded_covariance(m)
    assert kept.sum() == pytest.approx(m.sum(), rel=0.05)
    assert np.linalg.eigvalsh(kept)[0] > 0


def test_what_json_can_not_hold_becomes_null() -> None:
    told = {"a": np.array([1.0, math.nan]), "b": np.float64(math.inf), 3: (np.int64(4), "µ"), "c": np.bool_(True)}
    assert clean(told) == {"a": [1.0, None], "b": None, "3": [4, "µ"], "c": True}
    text = json_text(told)
    assert text.isascii()
    assert json.loads(text) == clean(told)
    assert json_text({"a": 1}) == '{\n "a": 1\n}'
    assert json_text({"a": [1]}, indent=None) == '{"a": [1]}'


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
