"""Numbers as files hold them: so many digits and places, no more and no fewer."""

from __future__ import annotations

import json
import math

import numpy as np
import pytest

from geometry.rounding import (
    clean,
    json_text,
    rounded,
    rounded_by_sigma,
    rounded_covariance,
    rounded_number,
    rounded_transform,
)


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
