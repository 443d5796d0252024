"""Stripes on lit, dark, cluttered and bent things: whole, in the right direction, with a σ that knows a bend."""

import cv2
import numpy as np
import pytest

from extraction import detect_stripe


def bell(rows, centre, width, peak):
    """A stripe (rows, N) of that σ across its own normal; none where its centre is NaN."""
    slope = np.nan_to_num(np.gradient(centre))
    own = width * np.hypot(1, slope)
    return np.nan_to_num(peak * np.exp(-0.5 * ((np.arange(rows)[:, None] - centre) / own) ** 2))


def seen(mean, rng):
    """Eight bits with the noise of a camera."""
    noisy = mean + rng.normal(size=mean.shape) * np.sqrt(0.04 * np.maximum(mean, 0) + 0.8)
    return np.clip(np.round(noisy), 0, 255).astype(np.uint8)


def right_sections(peaks, truth, within):
    """How many of the true sections hold a point near the truth, columns being sections."""
    assert len(peaks) == 0 or abs(peaks.normal[0, 1]) == 1
    own = np.abs(peaks.uv_px[:, 1] - truth[peaks.section]) <= within
    return len(np.unique(peaks.section[own])), own


@pytest.mark.parametrize("dark", [0.1, 0.25])
def test_stretches_ten_times_darker_are_the_stripe(dark):
    rng = np.random.default_rng(1)
    truth = 130 + 8 * np.sin(np.arange(480) / 60)
    albedo = np.where(np.arange(480) // 60 % 2 == 1, dark, 1.0)
    peaks = detect_stripe(seen(8 + bell(260, truth, 2.0, 150 * albedo), rng))
    assert right_sections(peaks, truth, 2)[0] >= 0.92 * 480


def test_a_course_that_comes_back_is_followed_along_the_sections_that_see_it_whole():
    """Along rows the same ridge is two halves that end where it turns."""
    rng = np.random.default_rng(2)
    truth = 300 + 55 * np.sin(np.arange(150) / 48)
    peaks = detect_stripe(seen(8 + bell(600, truth, 2.0, 90), rng))
    assert right_sections(peaks, truth, 2)[0] >= 149


def test_a_stripe_on_a_lit_board_is_no_ghost_of_the_squares_borders():
    """Squares of half the stripe's light: most of it is found along its own direction, nothing else unflagged."""
    rng = np.random.default_rng(4)
    rows, columns = np.mgrid[:380, :540]
    board = cv2.GaussianBlur(((rows // 36 + (columns + rows // 12) // 40) % 2).astype(float), (0, 0), 0.9)
    truth = 190 + 10 * np.sin(np.arange(540) / 45)
    peaks = detect_stripe(seen(12 + 45 * board + (0.25 + 0.75 * board) * bell(380, truth, 2.2, 110), rng))
    found, right = right_sections(peaks, truth, 3)
    assert found >= 0.7 * 540
    assert np.count_nonzero(~right & (peaks.flag == 0)) <= 0.01 * len(peaks)


def test_wide_bright_things_in_the_background_are_no_texture_of_a_narrow_stripes_kind():
    """A stepped floor before a lit room: each piece is as clear as the clutter, and far narrower."""
    rng = np.random.default_rng(5)
    mean = 60 + 14 * np.asarray(cv2.GaussianBlur(rng.normal(size=(420, 600)), (0, 0), 1.2)) / 0.23
    for k in range(12):
        at, long = (20 + 100 * (k % 6), 25 + 55 * (k // 6)), 40 + 10 * (k % 3)
        cv2.rectangle(mean, at, (at[0] + long, at[1] + 22), 130.0, -1)
    truth = np.full(600, np.nan)
    for start, stop, place in ((0, 180, 300), (185, 300, 330), (300, 410, 290), (415, 600, 320)):
        truth[start:stop] = place + 0.03 * np.arange(stop - start)
    peaks = detect_stripe(seen(mean + bell(420, truth, 1.7, 80), rng))
    found, right = right_sections(peaks, truth, 2)
    assert found >= 0.97 * np.count_nonzero(np.isfinite(truth))
    assert np.count_nonzero(~right & (peaks.flag == 0)) <= 0.01 * len(peaks)


@pytest.mark.parametrize("radius", [60.0, 190.0])
def test_a_bend_is_no_noise(radius):
    """Errors over σ on small and larger balls: drawn by the distance from the arc, skew of steep sections and all."""
    rng, wrong = np.random.default_rng(6), []
    for _ in range(3):
        u, middle = np.arange(2 * int(radius) + 40), radius + 20 + rng.uniform(-1, 1)
        truth = np.where(
            np.abs(u - middle) < 0.92 * radius,
            radius + 30 - np.sqrt(np.maximum(radius**2 - (u - middle) ** 2, 0)),
            np.nan,
        )
        away = np.hypot(u - middle, np.arange(int(radius) + 60)[:, None] - radius - 30) - radius
        mean = 5 + 130 * np.exp(-0.5 * (away / 1.7) ** 2) * np.isfinite(truth)
        peaks = detect_stripe(seen(mean, rng))
        error = (peaks.uv_px[:, 1] - truth[peaks.section]) / peaks.sigma_px
        wrong.append(error[np.isfinite(error)])
    assert 0.5 <= np.sqrt(np.mean(np.concatenate(wrong) ** 2)) <= 1.2


def board(rows, columns, square, turn_deg, lit):
    """Squares of 0 and 1 (rows, columns), turned; ``lit`` moves them."""
    v, u = np.mgrid[:rows, :columns].astype(float)
    c, s = np.cos(np.deg2rad(turn_deg)), np.sin(np.deg2rad(turn_deg))
    return ((u * c + v * s + lit) // square + (v * c - u * s + 2 * lit) // square) % 2


@pytest.mark.parametrize(("square", "least"), [(11, 0.45), (17, 0.4)])
def test_a_stripe_across_small_lit_squares_stands_above_their_white(square, least):
    """White half of it, where black gives the laser a tenth: those sections, and nothing else without a flag."""
    rng = np.random.default_rng(7)
    truth = 170 + 0.06 * np.arange(560)
    albedo = 0.1 + 0.8 * board(340, 560, square, 8, 3.0)
    light = albedo * (70 + bell(340, truth, 2.2, 150))
    peaks = detect_stripe(seen(4 + cv2.GaussianBlur(light, (0, 0), 0.9), rng))
    found, right = right_sections(peaks, truth, 2)
    assert found >= least * 560
    assert np.count_nonzero(~right & (peaks.flag == 0)) <= 0.02 * len(peaks)


@pytest.mark.parametrize("square", [11, 30])
def test_a_lamp_that_is_brighter_in_the_laser_off_picture_hides_no_stripe(square):
    """What is left of the print is below nothing then, square by square."""
    rng = np.random.default_rng(10)
    truth = 170 + 0.06 * np.arange(560)
    lit = 70 * (0.1 + 0.8 * board(340, 560, square, 8, 3.0))
    on = seen(20 + cv2.GaussianBlur(lit, (0, 0), 0.9) + bell(340, truth, 2.2, 60), rng)
    off = seen(1.3 * (20 + cv2.GaussianBlur(lit, (0, 0), 0.9)), rng)
    peaks = detect_stripe(on, laser_off=off)
    found, right = right_sections(peaks, truth, 2)
    assert found >= 0.85 * 560
    assert np.count_nonzero(~right & (peaks.flag == 0)) == 0


@pytest.mark.parametrize("square", [11, 17])
def test_small_squares_without_a_laser_are_no_stripe(square):
    rng = np.random.default_rng(8)
    light = (0.1 + 0.8 * board(340, 560, square, 8, 3.0)) * np.linspace(60, 90, 560)
    peaks = detect_stripe(seen(4 + cv2.GaussianBlur(light, (0, 0), 0.9), rng))
    assert np.count_nonzero(peaks.flag == 0) == 0


@pytest.mark.parametrize(("bar", "turn"), [(90, 0.2), (140, -0.1)])
def test_bright_bars_across_the_picture_do_not_hide_a_stripe(bar, turn):
    """Along their own direction they are faces, refused; the stripe lies along the other."""
    rng = np.random.default_rng(9)
    v, u = np.mgrid[:320, :560].astype(float)
    bars = cv2.GaussianBlur(np.where((u + turn * v) % 95 < 20, float(bar), 0.0), (0, 0), 0.9)
    truth = 150 + 0.05 * np.arange(560)
    peaks = detect_stripe(seen(8 + bars + bell(320, truth, 2.0, 90), rng))
    found, right = right_sections(peaks, truth, 2)
    assert found >= 0.9 * 560
    assert np.count_nonzero(~right & (peaks.flag == 0)) == 0
    assert np.count_nonzero(detect_stripe(seen(8 + bars, rng)).flag == 0) == 0
