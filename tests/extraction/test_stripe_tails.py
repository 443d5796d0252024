"""What lies beyond a stripe's ends: light that fades on a surface that turns away, and nothing beyond a cut.

Drawn stripes with truth, and rendered panels, whose bends are known by their tails alone.
"""

from dataclasses import replace

import numpy as np
import pytest

from assets import path as asset
from extraction import StripeConfig, extract_profile, measure_gap_flush, read_profile_csv, write_profile_csv
from perceptron_emu import EmulatorConfig, Material, Scene, render
from perceptron_emu.solids import random_panels
from tests.pinned import pinned
from workbench.files import read_sensor

WIDTH_PX, PEAK_DN = 1.2, 60.0
ATOL_MM = 1e-6  # of nine digits
ATOL_SHAKEN_MM = 1e-5
ATOL_MM = 1e-6  # of nine digits
FIRST, FACE_END, LIGHT_END = 300, 600, 620  # sections


@pytest.fixture(scope="module")
def sensor():
    return read_sensor(asset("sensors", "nominal"))


def drawn(rng, fading):
    """An image of the nominal sensor's size, and the course (sections,): straight, then steep, dim and out."""
    sections = np.arange(1280.0)
    beyond = np.maximum(sections - FACE_END, 0)
    course = 500.0 + np.minimum(0.05 * beyond**2, beyond)
    light = np.where(sections <= FACE_END, 1.0, np.maximum(np.exp(-beyond / 3), 0.15) if fading else 0.0)
    light *= (sections >= FIRST) & (sections <= LIGHT_END)
    bell = np.exp(-0.5 * ((np.arange(1024.0)[:, None] - course) / WIDTH_PX) ** 2)
    clean = 10.0 + PEAK_DN * light * bell
    return np.clip(np.round(clean + rng.normal(0, 1.0, clean.shape)), 0, 255).astype(np.uint8), course


def test_a_fading_stripe_is_followed_to_its_last_light(sensor):
    errors = []
    for seed in range(8):
        image, course = drawn(np.random.default_rng([12, seed]), True)
        profile = extract_profile(image, sensor)
        pinned(profile)
        tails = profile.tails.peaks
        end = int(profile.peaks.section.max())
        assert FACE_END - 1 <= end <= FACE_END + 4  # where the light falls to half
        beyond = tails[tails.section > end]
        assert len(set(range(end + 1, LIGHT_END + 1)) - set(beyond.section.tolist())) <= 1
        assert beyond.section.max() <= LIGHT_END + 1
        own = beyond[beyond.section <= LIGHT_END]
        errors.append((own.uv_px[:, 1] - course[own.section]) / own.sigma_px)
    off = np.concatenate(errors)
    assert 0.85 < np.sqrt(np.mean(off**2)) < 1.15
    assert abs(off.mean()) < 4 / np.sqrt(len(off))


def test_a_cut_stripe_has_no_tail(sensor):
    for seed in range(4):
        image, _ = drawn(np.random.default_rng([13, seed]), False)
        profile = extract_profile(image, sensor)
        pinned(profile)
        assert (profile.peaks.section.min(), profile.peaks.section.max()) == (FIRST, FACE_END)
        assert len(profile.tails) <= 1  # noise of three σ


def test_tails_are_none_of_the_profile_s_own_points(sensor):
    image, _ = drawn(np.random.default_rng(14), True)
    profile = extract_profile(image, sensor)
    pinned(profile)
    whole = profile.with_tails()
    assert len(whole) == len(profile) + len(profile.tails)
    assert len(profile[:0].with_tails()) == len(profile.tails)
    assert len(replace(profile, tails=None).with_tails()) == len(profile)
    assert not set(profile.peaks.section.tolist()) & set(profile.tails.peaks.section.tolist())
    assert set(profile.tails.peaks.piece.tolist()) <= set(profile.peaks.piece.tolist())


def test_a_written_profile_has_its_tails_again(sensor, tmp_path):
    image, _ = drawn(np.random.default_rng(16), True)
    profile = extract_profile(image, sensor)
    pinned(profile)
    write_profile_csv(profile, tmp_path / "p.csv")
    again = read_profile_csv(tmp_path / "p.csv")
    for a, b in ((profile, again), (profile.tails, again.tails)):
        assert b.peaks.section.tolist() == a.peaks.section.tolist()
        assert b.peaks.flag.tolist() == a.peaks.flag.tolist()
        assert np.abs(b.yz_mm - a.yz_mm).max() < ATOL_MM
    rows = (tmp_path / "p.csv").read_text().splitlines()
    assert sum(row.endswith(",tail") for row in rows) == len(profile.tails)
    assert again.tails.tails is None


def test_tails_along_the_normal_are_those_of_the_sections(sensor):
    image, _ = drawn(np.random.default_rng(15), True)
    plain = extract_profile(image, sensor)
    pinned(plain)
    normal = extract_profile(image, sensor, StripeConfig(along_normal=True))
    pinned(normal)
    assert normal.tails.peaks.section.tolist() == plain.tails.peaks.section.tolist()
    assert normal.peaks.section.tolist() == plain.peaks.section.tolist()
    assert np.abs(normal.tails.yz_mm - plain.tails.yz_mm).max() < 0.5


def shaken(profile, rng):
    """The profile with points that differ in their last digits, as another processor might give them."""
    parts = [
        replace(p, yz_mm=p.yz_mm * (1 + 1e-9 * rng.standard_normal(p.yz_mm.shape))) for p in (profile, profile.tails)
    ]
    return replace(parts[0], tails=parts[1])


@pytest.mark.parametrize(
    ("speckle", "rms_mm", "widest_mm"), [(False, 0.03, 0.06), (True, 0.15, 0.25)], ids=["plain", "speckle"]
)
def test_rendered_panels_have_their_gap_by_the_light_of_their_bends(sensor, speckle, rms_mm, widest_mm):
    errors = []
    for seed in (0, 8, 15, 30):  # bends whose light ends far beyond its half, or of less than a millimetre
        rng = np.random.default_rng([7, seed])
        panels, pose = random_panels(rng)
        config = EmulatorConfig.model_validate({"exposure": {"time_ms": 0.3}, "speckle": {"enabled": speckle}})
        image = render(Scene(sensor, None, solids=panels.solids(pose, Material(0.6))), config, rng).image
        pinned(image)
        profile = extract_profile(image, sensor)
        pinned(profile)
        answer = measure_gap_flush(profile)
        pinned(answer)
        assert answer.flag == ""
        assert answer.sigma_gap_mm < widest_mm
        moved = measure_gap_flush(shaken(profile, rng))
        pinned(moved)
        assert abs(moved.gap_mm - answer.gap_mm) < ATOL_SHAKEN_MM
        errors.append([answer.gap_mm - panels.gap_mm, (answer.gap_mm - panels.gap_mm) / answer.sigma_gap_mm])
    error, pull = np.array(errors).T
    assert np.sqrt(np.mean(error**2)) < rms_mm
    assert np.abs(pull).max() < 4
