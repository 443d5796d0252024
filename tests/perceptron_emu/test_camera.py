"""The chip by EMVA 1288 and the speckle by Goodman, on flats; what a photon-transfer measurement would find."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.special import j1

from perceptron_emu import EmulatorConfig
from perceptron_emu.chip import expose
from perceptron_emu.chip.dark import dark_levels, dark_pixels
from perceptron_emu.image import speckle_contrast
from perceptron_emu.image.speckle import speckle_field, speckle_of
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


def test_noise_hangs_on_all_bits_of_its_key() -> None:
    """Keys that share their low or their high half give images as unlike as any others."""
    keys = (5, 5 + 2**32, 5 + 2**63, 5 + 2**31)
    images = [flats(400.0, 1, key, prnu=0.0, dsnu_e=0.0)[0].ravel() for key in keys]
    correlation = np.corrcoef(images) - np.eye(len(keys))
    assert np.abs(correlation).max() < 6 / np.sqrt(images[0].size)


@pytest.mark.parametrize("bits", [8, 12])
@pytest.mark.parametrize("black", [0.0, 10.0])
def test_pixels_without_light_are_noisy_as_all_others(bits: int, black: float) -> None:
    """Their levels are looked up; a light of a millionth of an electron takes the common way. Histogram, variance in
    time and fixed pattern agree.
    """
    sensor = make_sensor(bit_depth=bits, black_level=black)
    noise = EmulatorConfig.model_validate({"noise": {"read_noise_e": 12.0, "dsnu_e": 7.0}}).noise
    dark = np.zeros(sensor.camera.shape, np.float32)
    without, with_light = (
        np.stack([expose(dark + np.float32(light), noise, sensor, 0.01, 977 * k + key) for k in range(4)]).astype(float)
        for light, key in ((0.0, 1), (1e-6, 10_000))
    )
    assert without.mean() == pytest.approx(with_light.mean(), abs=0.004 * max(1, without.std()))
    assert np.var(without, axis=0).mean() == pytest.approx(np.var(with_light, axis=0).mean(), rel=0.005)
    patterns = np.cov(without.mean(0).ravel(), with_light.mean(0).ravel())
    temporal = np.var(without, axis=0, ddof=1).mean() / 4
    assert patterns[0, 1] == pytest.approx(patterns[0, 0] - temporal, rel=0.02)
    shares = [np.bincount(i.astype(int).ravel(), minlength=1 << bits) / i.size for i in (without, with_light)]
    assert np.abs(np.cumsum(shares[0]) - np.cumsum(shares[1])).max() < 5 / np.sqrt(without.size)


def test_thresholds_and_the_look_up_of_dark_pixels_agree() -> None:
    rng = np.random.default_rng(4)
    level = np.sort(rng.normal(0.8, 0.3, 2**16))
    offset = rng.normal(0, 0.2, 5000).astype(np.float32)
    draws = rng.integers(0, 2**16, 5000).astype(np.uint16)
    dark = dark_pixels(level, offset, 1.0, 2.0)
    assert 0 < len(dark.above) <= 6
    out = np.empty(5000, np.uint8)
    dark_levels(draws, dark, 0, out)
    phase = np.floor(offset.astype(float) * 4096 + 0.5) / 4096
    assert np.array_equal(out, np.clip(np.floor(level[draws] + phase), 0, 2))


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
    field = speckle_field((5, -7), (900, 900), speckle_of(4.0, strength, 99))
    assert field.mean() == pytest.approx(1, abs=0.02)
    assert field.std() == pytest.approx(strength, rel=0.03)


@pytest.mark.parametrize("grain", [2.1, 5.0])
def test_speckle_has_the_grain_of_a_round_pupil(grain: float) -> None:
    """Intensities at a lag are correlated by (2 J₁(x)/x)², x = π·lag/grain (Goodman 2007, 4.4), seams included; whole
    fields are, of two keys, not.
    """
    first, second = (speckle_field((0, 0), (1024, 1024), speckle_of(grain, 1.0, key)) - 1 for key in (1, 2))
    for lag in (1, 2, 3, 5):
        x = np.pi * lag / grain
        expected = (2 * j1(x) / x) ** 2
        for a, b in ((first[lag:], first[:-lag]), (first[:, lag:], first[:, :-lag])):
            assert np.mean(a * b) == pytest.approx(expected, abs=0.02)
    assert np.mean(first * second) == pytest.approx(0, abs=0.01)


def test_seams_of_speckle_do_not_show() -> None:
    """Mean and contrast of the rows and columns in which tiles are blended are those of all others."""
    speckle = speckle_of(2.1, 1.0, 7)
    field, tile, seam = speckle_field((0, 0), (4096, 1024), speckle), speckle.tile, len(speckle.rise)
    blended = np.concatenate([field[k * tile : k * tile + seam].ravel() for k in range(16)])
    assert blended.mean() == pytest.approx(1, abs=0.02)
    assert blended.std() == pytest.approx(1, abs=0.03)


def test_speckle_of_overlapping_boxes_agrees() -> None:
    """Two boxes of one pattern show the same grains where they overlap, to the bit."""
    speckle = speckle_of(4.0, 2**-0.5, 5)
    large, part = speckle_field((-300, 0), (600, 700), speckle), speckle_field((-260, 70), (390, 520), speckle)
    assert np.array_equal(large[40:430, 70:590], part)


def test_bandwidth_and_depolarisation_lower_the_contrast() -> None:
    of = [
        speckle_contrast(EmulatorConfig.model_validate({"laser": {"bandwidth_nm": b}, "speckle": {"polarised": p}}))
        for b, p in ((0.01, True), (0.01, False), (5.0, False))
    ]
    assert of[0] == pytest.approx(1, abs=1e-3)
    assert of[1] == pytest.approx(2**-0.5, abs=1e-3)
    assert of[2] < 0.6
