"""Corners of a checkerboard by their grey levels: exact where the picture is their model, whatever is in the way."""

from __future__ import annotations

import numpy as np
import pytest

from extraction.board.saddle import Saddles, fit_saddles
from geometry.special import erf

ATOL_PX = 1e-6
SHAPE = (90, 120)
RADIUS = 6
BLUR, CONTRAST, LEVEL, SLOPE = 1.3, 50.0, 110.0, (0.4, -0.3)


def _picture(at: np.ndarray, turns: np.ndarray) -> np.ndarray:
    """Every pixel as the nearest corner has it: grey levels of the module's model, written down anew."""
    v, u = np.mgrid[0 : SHAPE[0], 0 : SHAPE[1]].astype(float)
    nearest = np.argmin([np.hypot(u - a, v - b) for a, b in at], axis=0)
    out = np.zeros(SHAPE)
    for k, ((a, b), (first, second)) in enumerate(zip(at, turns, strict=True)):
        x, y = u - a, v - b
        d = [np.cos(t) * y - np.sin(t) * x for t in (first, second)]
        steps = [erf(e / (np.sqrt(2) * BLUR)) for e in d]
        model = LEVEL + CONTRAST * steps[0] * steps[1] + SLOPE[0] * x + SLOPE[1] * y
        out[nearest == k] = model[nearest == k]
    return out


AT = np.array([[20.3, 20.8], [55.0, 20.4], [113.6, 22.2], [30.7, 84.3], [80.4, 60.49]])
TURNS = np.array([[0.1, 1.6], [-0.4, 1.3], [0.0, 1.5708], [0.8, 2.2], [-0.2, 1.1]])
STARTS = AT + np.array([[0.6, -0.4], [-0.5, 0.5], [0.3, 0.4], [0.2, -0.6], [-0.4, -0.3]])
ALONG = np.stack([np.cos(TURNS + 0.1), np.sin(TURNS + 0.1)], axis=-1)


def _fitted(grey: np.ndarray, usable: np.ndarray | None = None) -> Saddles:
    return fit_saddles(grey, STARTS, ALONG, RADIUS, np.ones(SHAPE, bool) if usable is None else usable)


def test_exact_corners_come_back_also_at_the_pictures_borders() -> None:
    """Two lie 6 px from a border: their windows reach beyond it."""
    found = _fitted(_picture(AT, TURNS))
    assert found.good.all()
    np.testing.assert_allclose(found.uv_px, AT, rtol=0, atol=ATOL_PX)
    np.testing.assert_allclose(found.blur_px, BLUR, rtol=1e-5)
    np.testing.assert_allclose(found.contrast_dn, CONTRAST, rtol=1e-5)
    assert found.misfit_dn.max() < 1e-4


def test_pixels_that_may_not_be_used_move_nothing() -> None:
    """A stripe's light across every window, and a scratch in one: what is left tells the same."""
    grey, usable = _picture(AT, TURNS), np.ones(SHAPE, bool)
    usable[18:21], usable[59:61], usable[82:84] = False, False, False
    usable[15:27, 51] = False
    grey[~usable] = 255.0
    found = _fitted(grey, usable)
    assert found.good.all()
    np.testing.assert_allclose(found.uv_px, AT, rtol=0, atol=ATOL_PX)
    assert found.misfit_dn.max() < 1e-4


def test_a_corner_with_too_few_pixels_or_far_from_its_start_is_none() -> None:
    """Six tenths of a window, half its radius."""
    grey, usable = _picture(AT, TURNS), np.ones(SHAPE, bool)
    usable[:, 50:55] = False  # 55 of the window's 121 pixels: 0.55 are left
    assert _fitted(grey, usable).good.tolist() == [True, False, True, True, True]
    usable[:, 50:52] = True  # 0.73
    assert _fitted(grey, usable).good.all()


def test_the_covariance_is_that_of_the_scatter() -> None:
    """200 pictures with noise of 2 DN."""
    rng, exact = np.random.default_rng(3), _picture(AT, TURNS)
    found = [_fitted(exact + rng.normal(0, 2.0, SHAPE)) for _ in range(200)]
    off = np.array([f.uv_px - AT for f in found])
    assert np.all([f.good for f in found])
    covariance = np.mean([f.covariance_px2 for f in found], axis=0)
    squared = np.einsum("nki,kij,nkj->nk", off, np.linalg.inv(covariance), off)
    assert np.mean(squared) == pytest.approx(2.0, abs=0.25)  # four σ of 1,000 squares of two degrees of freedom
    assert np.mean([f.misfit_dn for f in found]) == pytest.approx(2.0, rel=0.06)
