"""Ends of a stripe's pieces to a fraction of a section: drawn with a lens's blur, and rendered plates.

Speckle as strong as the light itself hides ends, and no test here says that their σ holds then.
"""

import math

import numpy as np
import pytest
from scipy.special import ndtr

from extraction import detect_stripe, extract_profile, piece_ends
from geometry import Pose
from perceptron_emu import EmulatorConfig, Scene, panel, project, render
from tests.perceptron_emu.conftest import make_sensor
from tests.pinned import pinned

SHAPE = (140, 420)
RENDERED_PX = 0.06  # of plates without speckle: four times what is measured


def drawn(rng, pieces, peak, width=2.0, blur=0.8, row=60.0):
    """A stripe lit from place to place along the columns, each border blurred, integrated over the pixels."""
    columns, rows = np.arange(SHAPE[1]), np.arange(SHAPE[0])[:, None]
    parts = (np.arange(32) + 0.5) / 32 - 0.5
    share = np.zeros(SHAPE[1])
    for begin, end in pieces:
        at = columns[:, None] + parts
        share += (ndtr((at - begin) / blur) * ndtr((end - at) / blur)).mean(axis=1)
    mean = 5 + peak * share * np.exp(-0.5 * ((rows - row - 0.03 * columns) / width) ** 2)
    noisy = mean + rng.normal(size=SHAPE) * np.sqrt(0.03 * mean + 0.64)
    return np.clip(np.round(noisy), 0, 255).astype(np.uint8)


@pytest.mark.parametrize(("peak", "blur", "within"), [(120, 0.1, 0.03), (120, 1.2, 0.06), (14, 0.8, 0.4)])
def test_ends_lie_where_the_light_steps_with_true_sigma(peak, blur, within):
    off, sigma = [], []
    for seed in range(12):
        rng = np.random.default_rng(seed)
        places = (60 + rng.uniform(0, 40), 330 + rng.uniform(0, 40))
        image = drawn(rng, [places], peak, blur=blur)
        (ends,) = piece_ends(image, detect_stripe(image))
        off += [ends.begin_px - places[0], ends.end_px - places[1]]
        sigma += [ends.sigma_begin_px, ends.sigma_end_px]
    assert np.abs(off).max() < within
    assert 0.65 < math.sqrt(np.mean((np.array(off) / sigma) ** 2)) < 1.4  # 24 ends


def test_both_ends_of_every_piece_and_none_at_the_border():
    pieces = [(-50, 100.3), (140.6, 250.2), (262.8, 600)]
    image = drawn(np.random.default_rng(1), pieces, 100)
    ends = piece_ends(image, detect_stripe(image))
    assert [e.piece for e in ends] == [0, 1, 2]
    assert ends[0].begin_px is None
    assert ends[2].end_px is None
    assert ends[2].sigma_end_px is None
    found = [ends[0].end_px, ends[1].begin_px, ends[1].end_px, ends[2].begin_px]
    np.testing.assert_allclose(found, [100.3, 140.6, 250.2, 262.8], rtol=0, atol=0.08)


def test_ends_of_a_stripe_at_the_pictures_border():
    """Its bell is cut by the border; what lies outside has no light and no weight."""
    image = drawn(np.random.default_rng(3), [(90.4, 330.7)], 110, row=2.0)
    (ends,) = piece_ends(image, detect_stripe(image))
    assert abs(ends.begin_px - 90.4) < 0.12
    assert abs(ends.end_px - 330.7) < 0.06


@pytest.mark.parametrize("row", [-1.0, 0.0, 1.0, 1.5, 1.75, 2.5])
def test_no_section_is_lost_at_the_pictures_border(row):
    """On whichever of its four sides."""
    image = drawn(np.random.default_rng(3), [(90.4, 330.7)], 110, row=row)
    for turned in (image, image[::-1], image.T, image.T[:, ::-1]):
        peaks = detect_stripe(np.ascontiguousarray(turned))
        assert len(np.unique(peaks.piece)) == 1
        assert len(peaks) == 240


def test_sections_that_are_rows_and_a_laser_off_image():
    off = np.full(SHAPE, 20, np.uint8)
    image = drawn(np.random.default_rng(2), [(90.4, 330.7)], 110) + np.uint8(20)
    for on, dark in ((image, off), (image.T, off.T)):
        on, dark = np.ascontiguousarray(on), np.ascontiguousarray(dark)
        (ends,) = piece_ends(on, detect_stripe(on, laser_off=dark), laser_off=dark)
        assert abs(ends.begin_px - 90.4) < 0.06
        assert abs(ends.end_px - 330.7) < 0.06


def test_without_points_there_are_no_ends():
    image = np.full(SHAPE, 9, np.uint8)
    assert piece_ends(image, detect_stripe(image)) == []


def test_the_borders_of_rendered_plates():
    """A plate in the sheet: its borders' images are where the stripe ends."""
    sensor, off = make_sensor(), []
    clean = EmulatorConfig.model_validate({"ambient": {"enabled": False}, "speckle": {"enabled": False}})
    for seed in range(3):
        rng = np.random.default_rng(seed)
        half = rng.uniform(15, 30)
        plate = Pose.from_fixed_xyz_deg([*rng.uniform(-12, 12, 2), 5.0], [0, rng.uniform(-10, 10), 300])
        image = render(Scene(sensor, solids=(panel(200, 2 * half, plate),)), clean, rng).image
        pinned(image)
        (ends,) = piece_ends(image, extract_profile(image, sensor).peaks)
        borders = []
        for side in (-half, half):
            a, b = plate @ np.array([-100.0, side, 0.0]), plate @ np.array([100.0, side, 0.0])
            borders.append(float(project(sensor, (a - a[0] / (b[0] - a[0]) * (b - a))[None])[0, 0]))
        off += [ends.begin_px - min(borders), ends.end_px - max(borders)]
    assert np.abs(off).max() < RENDERED_PX
