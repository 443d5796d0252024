"""Stripes: accuracy near the bound, calibrated σ, both directions, several peaks, masks, clipping."""

import numpy as np
import pytest
from scipy.special import ndtr

from extraction import StripeConfig
from extraction.stripe import depth_direction, detect_stripe, extract_profile, flag_names
from geometry import Camera, InputError, Pose, Sensor, Sheet
from tests.pinned import pinned

ATOL_CLEAN_PX = 0.004  # without noise what is left is rounding to grey levels


def stripe_mean(centres, peak, sigma, height, background=10.0):
    """Mean grey levels (height, W) of stripes: one Gaussian per column, integrated over the pixel; NaN: no stripe."""
    row = np.arange(height)[:, None]
    out = np.full((height, len(centres)), float(background))
    area = peak * sigma * np.sqrt(2 * np.pi)
    return out + np.nan_to_num(area * (ndtr((row + 0.5 - centres) / sigma) - ndtr((row - 0.5 - centres) / sigma)))


def noisy(mean, rng, gain=0.025, read=1.0, top=255):
    """Shot noise, read noise, rounding and clipping, 8 bits."""
    grey = gain * rng.poisson(mean / gain) + rng.normal(0, read, mean.shape)
    return grey.round().clip(0, top).astype(np.uint8 if top <= 255 else np.uint16)


def curve(rng, width):
    """A gently curved stripe's row in every column."""
    u = np.arange(width)
    return 60 + rng.uniform(0, 40) + 10 * np.sin(u / 150 + rng.uniform(0, 6)) + rng.uniform(-0.05, 0.05) * u


def errors(peaks, centres):
    return peaks.uv_px[:, 1] - centres[peaks.section]


def test_clean_stripe_is_exact_to_rounding():
    centres = 40 + 0.013 * np.arange(600)
    image = stripe_mean(centres, 180, 1.7, 100).round().astype(np.uint8)
    peaks = detect_stripe(image)
    pinned(peaks)
    assert len(peaks) == 600
    assert np.abs(errors(peaks, centres)).max() < 10 * ATOL_CLEAN_PX
    assert np.sqrt(np.mean(errors(peaks, centres) ** 2)) < ATOL_CLEAN_PX
    np.testing.assert_allclose(np.median(peaks.width_px), np.hypot(1.7, 1 / np.sqrt(12)), rtol=0.01)
    np.testing.assert_allclose(np.median(peaks.amplitude_dn), 180, rtol=0.03)
    np.testing.assert_allclose(np.median(peaks.background_dn), 10, atol=0.1)


@pytest.mark.parametrize(("peak", "sigma", "gain", "read"), [(150, 1, 0.025, 1), (40, 2, 0.1, 2), (15, 2, 0.025, 1)])
def test_reported_sigma_is_the_scatter(peak, sigma, gain, read):
    """σ over scatter within 0.95 … 1.05 with the noise estimated from the frame alone (8 frames of 1,000 columns)."""
    rng, scaled = np.random.default_rng(11), []
    for _ in range(8):
        centres = curve(rng, 1000)
        peaks = detect_stripe(noisy(stripe_mean(centres, peak, sigma, 160), rng, gain, read))
        pinned(peaks)
        assert len(peaks) > 990
        scaled.append(errors(peaks, centres) / peaks.sigma_px)
    scatter = np.std(np.concatenate(scaled))
    assert 0.95 < 1 / scatter < 1.05
    assert abs(np.mean(np.concatenate(scaled))) < 0.06


def test_rows_are_columns_of_the_turned_image():
    rng = np.random.default_rng(2)
    image = noisy(stripe_mean(curve(rng, 400), 100, 1.5, 160), rng)
    a = detect_stripe(image, StripeConfig(direction="columns"))
    pinned(a)
    b = detect_stripe(np.ascontiguousarray(image.T), StripeConfig(direction="rows"))
    pinned(b)
    np.testing.assert_array_equal(a.uv_px, b.uv_px[:, ::-1])
    np.testing.assert_array_equal(a.normal, b.normal[:, ::-1])
    np.testing.assert_array_equal(a.section, b.section)


@pytest.mark.parametrize(
    ("rule", "expected"), [("strongest", "middle"), ("first", "top"), ("last", "low"), ("continuous", "middle")]
)
def test_selection_among_three_stripes(rule, expected):
    rng, u = np.random.default_rng(3), np.arange(500)
    stripes = {"top": 30 + 0.01 * u, "middle": 70 + 5 * np.sin(u / 80), "low": 130 - 0.02 * u}
    mean = 10 + sum(
        stripe_mean(rows, {"top": 60, "middle": 120, "low": 40}[name], 1.5, 160, 0) for name, rows in stripes.items()
    )
    image = noisy(mean, rng)
    peaks = detect_stripe(image, StripeConfig(select=rule))
    pinned(peaks)
    assert len(peaks) > 495
    assert np.abs(errors(peaks, stripes[expected])).max() < 0.4
    assert len(detect_stripe(image, StripeConfig(select="all"))) > 1485


def test_continuous_ignores_brighter_reflections_that_come_and_go():
    rng, u = np.random.default_rng(4), np.arange(600)
    centres = 90 + 6 * np.sin(u / 100)
    flashes = np.where((u // 40) % 3 == 0, 40.0 + 20 * rng.random(600), np.nan)
    image = noisy(10 + stripe_mean(centres, 70, 1.5, 160, 0) + stripe_mean(flashes, 110, 1.5, 160, 0), rng)
    for rule in ("continuous", "strongest"):
        chain = detect_stripe(image, StripeConfig(select=rule))
        pinned(chain)
        assert np.abs(errors(chain, centres)).max() < 0.4
        assert len(chain) > 595


def test_gap_in_the_stripe_stays_empty():
    rng, u = np.random.default_rng(5), np.arange(500)
    centres = np.where((u > 200) & (u < 260), np.nan, 80.0)
    peaks = detect_stripe(noisy(stripe_mean(centres, 90, 1.5, 160), rng))
    pinned(peaks)
    assert not np.any((peaks.section > 201) & (peaks.section < 259))
    assert len(peaks) >= 435


def test_width_limits_reject_broad_light():
    rng = np.random.default_rng(6)
    image = noisy(
        10 + stripe_mean(np.full(300, 50.0), 60, 1.3, 200, 0) + stripe_mean(np.full(300, 140.0), 90, 5, 200, 0), rng
    )
    assert np.median(detect_stripe(image).uv_px[:, 1]) == pytest.approx(140, abs=0.2)
    narrow = detect_stripe(image, StripeConfig(max_width_px=2.5))
    pinned(narrow)
    assert np.median(narrow.uv_px[:, 1]) == pytest.approx(50, abs=0.1)


def test_clipped_stripe_is_flagged_and_unbiased():
    """Peak 600 DN on an 8-bit chip: the flanks carry the position, and σ says so."""
    rng = np.random.default_rng(7)
    centres = 60 + 0.021 * np.arange(800)
    peaks = detect_stripe(noisy(stripe_mean(centres, 600, 1.8, 120), rng))
    pinned(peaks)
    assert len(peaks) > 780
    assert all(flag_names(f) == "saturated" for f in peaks.flag)
    scaled = errors(peaks, centres) / peaks.sigma_px
    assert 0.8 < np.std(scaled) < 1.25
    assert abs(np.mean(errors(peaks, centres))) < 0.01


def test_laser_off_frame_takes_away_what_is_not_laser():
    rng = np.random.default_rng(8)
    centres = 100 + 0.03 * np.arange(400)
    lamp = stripe_mean(np.full(400, 40.0), 160, 2.0, 160, 20.0)
    on, off = noisy(lamp + stripe_mean(centres, 60, 1.6, 160, 0), rng), noisy(lamp, rng)
    assert np.median(detect_stripe(on).uv_px[:, 1]) == pytest.approx(40, abs=0.2)
    peaks = detect_stripe(on, laser_off=off)
    pinned(peaks)
    assert len(peaks) == 400
    scaled = errors(peaks, centres) / peaks.sigma_px
    assert 0.9 < np.std(scaled) < 1.1


def test_mask_and_region():
    rng = np.random.default_rng(9)
    image = noisy(
        10 + stripe_mean(np.full(300, 40.0), 90, 1.5, 160, 0) + stripe_mean(np.full(300, 110.0), 60, 1.5, 160, 0), rng
    )
    mask = np.ones(image.shape, dtype=bool)
    mask[:70] = False
    masked = detect_stripe(image, mask=mask)
    pinned(masked)
    assert np.median(masked.uv_px[:, 1]) == pytest.approx(110, abs=0.1)
    assert not np.any(masked.uv_px[:, 1] < 69)
    region = detect_stripe(image, StripeConfig(region_px=(50, 80, 250, 160)))
    pinned(region)
    assert region.section.min() >= 50
    assert region.section.max() < 250
    np.testing.assert_allclose(region.uv_px[:, 1], 110, atol=0.5)


def test_steep_stripe_along_its_normal():
    """At 60° a section sees the stripe twice as wide; along the normal the width is the stripe's own and σ is right."""
    rng = np.random.default_rng(10)
    centres = 20 + np.tan(np.pi / 3) * np.arange(150)
    image = noisy(stripe_mean(centres, 120, 1.5 / np.cos(np.pi / 3), 320), rng)
    sections = detect_stripe(image)
    pinned(sections)
    peaks = detect_stripe(image, StripeConfig(along_normal=True))
    pinned(peaks)
    inner = (peaks.section > 10) & (peaks.section < 140)
    assert np.median(sections.width_px) == pytest.approx(3.0, rel=0.05)
    assert np.median(peaks.width_px[inner]) == pytest.approx(1.5, rel=0.06)
    np.testing.assert_allclose(np.abs(peaks.normal[inner] @ [np.sin(np.pi / 3), -np.cos(np.pi / 3)]), 1, atol=0.02)
    off = (peaks.uv_px[:, 1] - 20 - np.tan(np.pi / 3) * peaks.uv_px[:, 0]) * np.cos(np.pi / 3)
    assert np.abs(off[inner]).max() < 0.1
    assert 0.8 < np.std(off[inner] / peaks.sigma_px[inner]) < 1.25


def test_sixteen_bits():
    rng = np.random.default_rng(12)
    centres = curve(rng, 300)
    image = noisy(stripe_mean(centres, 9000, 1.6, 160, 400), rng, gain=2.0, read=20, top=65535)
    peaks = detect_stripe(image)
    pinned(peaks)
    assert len(peaks) == 300
    assert 0.85 < np.std(errors(peaks, centres) / peaks.sigma_px) < 1.15


@pytest.mark.parametrize("kind", ["black", "white", "noise", "tiny", "flat"])
def test_no_laser_gives_no_points(kind):
    """False points are worse than missing ones: at most two of 1,280 sections on pure noise."""
    rng = np.random.default_rng(13)
    image = {
        "black": np.zeros((200, 300), np.uint8),
        "white": np.full((200, 300), 255, np.uint8),
        "noise": rng.normal(30, 4, (1024, 1280)).round().clip(0, 255).astype(np.uint8),
        "tiny": np.zeros((1, 1), np.uint8),
        "flat": np.full((200, 300), 77, np.uint8),
    }[kind]
    assert len(detect_stripe(image)) <= (2 if kind == "noise" else 0)


def test_step_edge_is_no_stripe():
    rng = np.random.default_rng(14)
    mean = np.full((200, 300), 20.0)
    mean[100:] = 150
    assert len(detect_stripe(noisy(mean, rng))) <= 3


@pytest.mark.parametrize(
    ("image", "extra", "message"),
    [
        (np.zeros((10, 10, 3), np.uint8), {}, "grey levels"),
        (np.zeros((10, 10), np.float32), {}, "uint8 or uint16"),
        (None, {}, "NoneType"),
        (np.zeros((10, 10), np.uint8), {"laser_off": np.zeros((9, 10), np.uint8)}, "laser-off"),
        (np.zeros((10, 10), np.uint8), {"mask": np.zeros((9, 10), bool)}, "mask"),
        (np.zeros((10, 10), np.uint8), {"config": StripeConfig(region_px=(0, 0, 11, 5))}, "region_px"),
    ],
)
def test_bad_input_is_one_sentence(image, extra, message):
    with pytest.raises(InputError, match=message) as refused:
        detect_stripe(image, **extra)
    pinned(str(refused.value))


def sensor(**changes) -> Sensor:
    R = np.array([[0, -np.cos(0.4), -np.sin(0.4)], [1, 0, 0], [0, -np.sin(0.4), np.cos(0.4)]])
    values = {"width_px": 400, "height_px": 300, "fx_px": 900.0, "fy_px": 900.0, "cx_px": 199.5, "cy_px": 149.5}
    return Sensor(Sheet(), Camera(**{**values, "T_sensor_camera": Pose(R, np.array([120.0, 0, 0])), **changes}))


def test_profile_of_a_flat_board_is_a_straight_line_in_mm():
    """A board at z = 280 + 0.1·y through a distorting lens: image rows by OpenCV, points by the product."""
    import cv2

    s = sensor(distortion=(-0.2, 0.1, 1e-3, -5e-4, 0.0))
    y = np.linspace(-80, 80, 4001)
    board = np.column_stack([np.zeros_like(y), y, 280 + 0.1 * y])
    camera, to_camera = s.camera, s.camera.T_sensor_camera.inverse()
    rvec = cv2.Rodrigues(to_camera.R)[0]
    uv = cv2.projectPoints(board, rvec, to_camera.t, camera.matrix, camera.distortion14)[0][:, 0]
    order = np.argsort(uv[:, 0])
    rows = np.interp(np.arange(400), uv[order, 0], uv[order, 1], left=np.nan, right=np.nan)
    image = noisy(stripe_mean(rows, 140, 1.6, 300), np.random.default_rng(15))
    profile = extract_profile(image, s)
    pinned(profile)
    assert len(profile) > 300
    off = profile.yz_mm[:, 1] - (280 + 0.1 * profile.yz_mm[:, 0])
    across = np.array([-0.1, 1.0])
    sigma = np.sqrt(np.einsum("i,nij,j->n", across, profile.cov_yz_mm2, across))
    inner = slice(3, -3)
    assert 0.85 < np.std(off[inner] / sigma[inner]) < 1.15
    assert abs(np.mean(off[inner])) < 3 * np.mean(sigma) / np.sqrt(len(off))


def test_depth_direction_follows_the_camera():
    R = sensor().camera.T_sensor_camera.R
    turned = Pose(R @ np.array([[0, -1.0, 0], [1, 0, 0], [0, 0, 1]]), np.array([120.0, 0, 0]))
    assert depth_direction(sensor()) == "columns"
    assert depth_direction(sensor(T_sensor_camera=turned)) == "rows"


def test_image_must_fit_the_sensor():
    with pytest.raises(InputError, match="400 × 300") as refused:
        extract_profile(np.zeros((400, 300), np.uint8), sensor())
    pinned(str(refused.value))


def test_plateau_lies_midway_between_its_flanks():
    """Peak 3,000 DN, clipped over a dozen pixels: unbiased, no worse than σ says; the error is one of phase."""
    rng = np.random.default_rng(16)
    centres = 60 + 0.021 * np.arange(800)
    for sigma in (1.8, 2.5):
        peaks = detect_stripe(noisy(stripe_mean(centres, 3000, sigma, 130), rng))
        pinned(peaks)
        assert len(peaks) > 790
        assert all(flag_names(f) == "saturated" for f in peaks.flag)
        assert abs(np.mean(errors(peaks, centres))) < 0.005
        assert 0.4 < np.std(errors(peaks, centres) / peaks.sigma_px) < 1.1


def test_one_plateau_with_several_peaks_is_one_point():
    """Ragged flanks make a detector answer twice on one clipped run; each answer alone would have one flank."""
    rng = np.random.default_rng(17)
    centres = np.full(500, 80.0)
    signal = 2500 * np.exp(-0.5 * ((np.arange(160)[:, None] - centres) / 4.5) ** 2)
    grey = 60 + rng.normal(0, 2, signal.shape) + signal * rng.gamma(12, 1 / 12, signal.shape)
    image = grey.round().clip(0, 255).astype(np.uint8)
    peaks = detect_stripe(image, StripeConfig(select="all"))
    pinned(peaks)
    assert np.bincount(peaks.section, minlength=500).max() == 1
    assert len(peaks) > 490
    assert 0.8 < np.std(errors(peaks, centres) / peaks.sigma_px) < 1.25
