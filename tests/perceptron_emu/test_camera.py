"""The chip by EMVA 1288 and the speckle by Goodman, on flats; what a photon-transfer measurement would find."""

from __future__ import annotations

import numpy as np
import pytest

from perceptron_emu import EmulatorConfig
from perceptron_emu.chip import expose
from perceptron_emu.image import contrast
from perceptron_emu.image.speckle import speckle_field
from tests.perceptron_emu.conftest import make_sensor

REL = 0.02
TABLE = {"read_noise_e": 8.0, "dsnu_e": 5.0, "prnu": 0.01, "full_well_e": 9000.0, "gain_dn_per_e": 0.4,
         "dark_current_e_s": 0.0}  # fmt: skip


def flats(electrons: float, frames: int, first_key: int = 1, **noise: float) -> np.ndarray:
    sensor = make_sensor(bit_depth=12, black_level=64.0)
    config = EmulatorConfig.model_validate({"noise": TABLE | noise}).noise
    flat = np.full((sensor.camera.height_px, sensor.camera.width_px), electrons, np.float32)
    images = [expose(flat, config, sensor, 0.01, 977 * k + first_key) for k in range(frames)]
    return np.stack(images).astype(np.float64)


def test_photon_transfer_finds_gain_read_noise_and_well() -> None:
    dark, grey, full = flats(0.0, 2), flats(4000.0, 2), flats(40_000.0, 1)
    gain = (np.var(grey[1] - grey[0]) - np.var(dark[1] - dark[0])) / 2 / (grey.mean() - dark.mean())
    assert gain == pytest.approx(0.4, rel=REL)
    read = np.sqrt(np.var(dark[1] - dark[0]) / 2 - 1 / 12) / gain
    assert read == pytest.approx(8.0, rel=REL)
    assert (full.mean() - dark.mean()) / gain == pytest.approx(9000, rel=REL)


def test_the_fixed_pattern_is_the_cameras_own() -> None:
    dark, grey = flats(0.0, 8), flats(4000.0, 8)
    dsnu = np.sqrt(np.var(dark.mean(0)) - np.mean(np.var(dark, 0, ddof=1)) / 8) / 0.4
    assert dsnu == pytest.approx(5.0, rel=REL)
    spatial = np.var(grey.mean(0)) - np.mean(np.var(grey, 0, ddof=1)) / 8 - (dsnu * 0.4) ** 2
    assert np.sqrt(spatial) / (grey.mean() - dark.mean()) == pytest.approx(0.01, rel=REL)
    other = flats(0.0, 8, first_key=10_000, pattern_seed=7)
    correlation = np.corrcoef(dark.mean(0).ravel(), other.mean(0).ravel())[0, 1]
    assert abs(correlation) < 0.01


@pytest.mark.parametrize("mean", [0.5, 3.0, 40.0, 2000.0])
def test_shot_noise_has_poissons_mean_variance_and_skewness(mean: float) -> None:
    """With a read noise of 1 e⁻: the expansion is continuous, single electrons do not show as steps."""
    quiet = {"read_noise_e": 1.0, "dsnu_e": 0.0, "prnu": 0.0, "gain_dn_per_e": 1.0, "full_well_e": 3500.0}
    image = (flats(mean, 1, **quiet) - 64).ravel()
    if mean >= 40:
        third = np.mean((image - image.mean()) ** 3)  # Poisson's third moment is its mean
        assert third / np.var(image) ** 1.5 == pytest.approx(mean / (mean + 1) ** 1.5, abs=0.01)
        assert np.var(image) == pytest.approx(mean + 1 + 1 / 12, rel=0.01)
    assert image.mean() == pytest.approx(mean, abs=max(0.02, 0.002 * mean))


@pytest.mark.parametrize("strength", [1.0, 2**-0.5, 0.6, 0.4, 0.05, 0.0])
def test_speckle_has_its_contrast(strength: float) -> None:
    field = speckle_field((5, -7), (900, 900), 4.0, strength, 99)
    assert field.mean() == pytest.approx(1, abs=0.02)
    assert field.std() == pytest.approx(strength, rel=0.05)


def test_speckle_of_overlapping_boxes_agrees() -> None:
    """Two boxes of one pattern show the same grains where they overlap, but for the kernel's cut tail (rms 0.16)."""
    large = speckle_field((0, 0), (200, 300), 4.0, 1.0, 5)
    part = speckle_field((40, 70), (90, 120), 4.0, 1.0, 5)
    assert np.sqrt(np.mean((large[40:130, 70:190] - part) ** 2)) < 0.2


def test_bandwidth_and_depolarisation_lower_the_contrast() -> None:
    of = [
        contrast(EmulatorConfig.model_validate({"laser": {"bandwidth_nm": b}, "speckle": {"polarised": p}}))
        for b, p in ((0.01, True), (0.01, False), (5.0, False))
    ]
    assert of[0] == pytest.approx(1, abs=1e-3)
    assert of[1] == pytest.approx(2**-0.5, abs=1e-3)
    assert of[2] < 0.6
