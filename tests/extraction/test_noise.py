"""The frame's noise variance from white noise frames of known σ, cut off at grey level 0 or not."""

import numpy as np
import pytest

from extraction import DetectConfig, SpotNoiseConfig
from extraction.spots.detect import prepare
from extraction.spots.noise import noise_model
from tests.extraction.spots import make_sensor

ROUNDING = 1 / 12


def measured(level, sigma, blur_px=1.3):
    image = np.random.default_rng(4).normal(level, sigma, (512, 640)).round().clip(0, 255).astype(np.uint8)
    prepared = prepare(image, DetectConfig(blur_sigma_px=blur_px))
    return noise_model(prepared, make_sensor(), SpotNoiseConfig()).variance_dn2


@pytest.mark.parametrize("blur_px", [0.8, 1.3, 2.5])
@pytest.mark.parametrize("sigma", [0.5, 6.0])
def test_variance_is_that_of_the_noise(sigma, blur_px):
    assert measured(100.25, sigma, blur_px) == pytest.approx(sigma**2 + ROUNDING, rel=0.04)


@pytest.mark.parametrize("level", [0.0, 0.7, 1.5, 3.0])
@pytest.mark.parametrize("sigma", [0.8, 2.0, 5.0])
def test_noise_that_grey_level_0_cuts_off_is_put_right(level, sigma):
    assert measured(level, sigma) == pytest.approx(sigma**2 + ROUNDING, rel=0.15)


@pytest.mark.parametrize("sigma", [0.3, 0.4, 0.5])
def test_dark_pixels_of_two_grey_levels_tell_their_noise(sigma):
    assert measured(0.0, sigma) == pytest.approx(sigma**2 + ROUNDING, rel=0.1)
