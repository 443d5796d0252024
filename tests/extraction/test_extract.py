"""Images → surface points: recall, false alarms, covariance, scenes with stripes, edges, sparks, other cameras."""

import cv2
import numpy as np
import pytest

import assets
from extraction import (
    DetectConfig,
    ExtractionConfig,
    LocaliseConfig,
    SpotNoiseConfig,
    extract,
    extract_stages,
    image_to_sheet,
)
from extraction.spots import TrueSpot
from extraction.spots.detect import prepare
from tests.extraction.spots import camera, dot_grid, make_sensor, mean_frame, some_spots
from tests.pinned import pinned
from tests.recordings import MISSING, recording

SAMPLE, CELL_A = assets.path("samples", "cell_a"), recording("cell_a")  # half of the recording, and all of it
QUIET = ExtractionConfig(noise=SpotNoiseConfig(speckle_contrast=0.0, model_error=0.0))


def matched(points, spots, atol_px=0.5):
    """Index of the point at each true spot, -1 where there is none."""
    if not len(points):
        return [-1] * len(spots)
    distance = np.linalg.norm(points.uv_px[None] - np.array([(s.u_px, s.v_px) for s in spots])[:, None], axis=2)
    return [int(np.argmin(d)) if d.min() < atol_px else -1 for d in distance]


@pytest.mark.parametrize(("bits", "scale", "read"), [(8, 1.0, 0.5), (8, 1.0, 3.0), (10, 4.0, 3.0), (16, 200.0, 120.0)])
def test_every_spot_is_found_and_nothing_else(bits, scale, read):
    rng = np.random.default_rng(bits)
    sensor = make_sensor(bit_depth=bits)
    for _ in range(5):
        spots = some_spots(rng)
        image = camera(mean_frame(spots) * scale, rng, gain=0.025 * scale, read=read, bits=bits)
        points = extract(image, sensor, QUIET)
        pinned(points)
        assert -1 not in matched(points, spots)
        assert len(points) == len(spots)
        assert np.all(np.diff(points.score) <= 0)


def test_covariance_is_that_of_the_errors_in_px_and_mm():
    """200 frames' worth of spots without speckle: NEES of two degrees of freedom in the image and in the sheet."""
    rng, sensor = np.random.default_rng(3), make_sensor()
    px, mm = [], []
    for _ in range(40):
        spots = some_spots(rng)
        points = extract(camera(mean_frame(spots), rng), sensor, QUIET)
        pinned(points)
        truth = np.array([(s.u_px, s.v_px) for s in spots])
        true_mm, _ = image_to_sheet(sensor, truth)
        for s, k in enumerate(matched(points, spots)):
            e, d = points.uv_px[k] - truth[s], points.yz_mm[k] - true_mm[s]
            px.append(e @ np.linalg.solve(points.cov_uv_px2[k], e))
            mm.append(d @ np.linalg.solve(points.cov_yz_mm2[k], d))
    assert abs(np.mean(px) - 2) < 0.4
    assert np.mean(mm) == pytest.approx(np.mean(px), rel=0.02)


def test_shape_and_direction_are_reported():
    rng, sensor = np.random.default_rng(4), make_sensor()
    spots = [TrueSpot(100 + 60 * k, 200.3, 1500, 2.6, 0.9, -1.2 + 0.4 * k) for k in range(7)]
    points = extract(camera(mean_frame(spots), rng), sensor, QUIET)
    pinned(points)
    for s, k in zip(spots, matched(points, spots), strict=True):
        turned = (points.axis_rad[k] - s.axis_rad + np.pi / 2) % np.pi - np.pi / 2
        assert abs(turned) < 0.05
        np.testing.assert_allclose(points.sigma_px[k], [2.6, 0.9], rtol=0.08)


def test_a_long_stripe_is_no_spot_but_a_spot_beside_it_is():
    rng, sensor = np.random.default_rng(5), make_sensor()
    spots = some_spots(rng, 4)
    mean = mean_frame(spots)
    v = np.arange(512)[:, None]
    stripe = np.exp(-0.5 * ((v - 495) / 1.8) ** 2) * 40 * (np.abs(np.arange(640) - 300) > 60)
    stages = extract_stages(camera(mean + stripe, rng), sensor, QUIET)
    assert -1 not in matched(stages.points, spots)
    assert "too_long" in stages.candidates.reason
    assert len(stages.points) == len(spots)


def test_a_bright_post_scores_below_every_string():
    rng, sensor = np.random.default_rng(6), make_sensor()
    spots = some_spots(rng, 4)
    u, v = np.meshgrid(np.arange(640), np.arange(512))
    post = 3000 * np.exp(-0.5 * (((u - 40) / 6.0) ** 2 + ((v - 490) / 1.7) ** 2))
    points = extract(camera(mean_frame(spots) + post, rng), sensor, QUIET)
    pinned(points)
    found = matched(points, spots)
    assert -1 not in found
    assert max(found) == len(spots) - 1


def test_a_spot_on_the_edge_of_a_bright_body_is_found():
    rng, sensor = np.random.default_rng(7), make_sensor()
    body = 25.0 * (np.arange(640) > 320)
    for offset in (-6, -3, 0, 3, 6):
        spot = TrueSpot(320.3 + offset, 200.6, 700, 1.6, 0.85, 1.4)
        points = extract(camera(mean_frame([spot]) + body, rng), sensor, QUIET)
        pinned(points)
        assert matched(points, [spot], 1.0) != [-1]


def test_hot_pixels_are_no_spots():
    rng, sensor = np.random.default_rng(8), make_sensor()
    spots = some_spots(rng, 4)
    mean = mean_frame(spots)
    for _ in range(40):
        mean[rng.integers(0, 512), rng.integers(0, 640)] += rng.uniform(30, 200)
    stages = extract_stages(camera(mean, rng), sensor, QUIET)
    assert -1 not in matched(stages.points, spots)
    assert "pixel_spike" in stages.candidates.reason
    assert np.sum(stages.points.score > 0.5) == len(spots)


def test_saturated_spots_are_found_and_flagged():
    rng, sensor = np.random.default_rng(9), make_sensor()
    spots = [TrueSpot(100.2, 100.7, 9000, 2.0, 1.0, 0.3), TrueSpot(300.1, 300.2, 900, 2.0, 1.0, 0.3)]
    points = extract(camera(mean_frame(spots), rng), sensor, QUIET)
    pinned(points)
    bright, plain = matched(points, spots)
    assert points.flag[bright] == "saturated"
    assert points.flag[plain] == ""
    assert np.linalg.norm(points.uv_px[bright] - [100.2, 100.7]) < 0.05


def test_two_strings_that_touch_are_flagged():
    """What can not be told apart must not look trustworthy."""
    rng, sensor = np.random.default_rng(10), make_sensor()
    spots = [TrueSpot(200, 200, 1500, 2.0, 0.9, 1.5), TrueSpot(203.4, 202, 1200, 2.0, 0.9, 1.5)]
    points = extract(camera(mean_frame(spots), rng), sensor, QUIET)
    pinned(points)
    assert len(points)
    assert all(points.flag)


def test_fast_method_finds_the_same_spots():
    rng, sensor = np.random.default_rng(11), make_sensor()
    spots = some_spots(rng)
    image = camera(mean_frame(spots), rng)
    fast = extract(image, sensor, ExtractionConfig(localise=LocaliseConfig(method="fast")))
    pinned(fast)
    assert -1 not in matched(fast, spots)


def test_stages_are_the_same_path_as_extract():
    rng, sensor = np.random.default_rng(12), make_sensor()
    image = camera(mean_frame(some_spots(rng)), rng)
    stages, points = extract_stages(image, sensor), extract(image, sensor)
    np.testing.assert_array_equal(stages.points.uv_px, points.uv_px)
    assert stages.background.shape == stages.mask.shape == image.shape
    for point, k in zip(stages.points.uv_px, stages.candidate, strict=True):
        assert stages.candidates.reason[k] == ""
        assert np.linalg.norm(stages.candidates.peak_uv_px[k] - point) < 3
    assert sum(reason == "" for reason in stages.candidates.reason) == len(points)


@pytest.mark.parametrize(
    "folder", [SAMPLE, pytest.param(CELL_A, marks=pytest.mark.skipif(not CELL_A.is_dir(), reason=MISSING))]
)
def test_cell_a_shows_its_strings_above_all_clutter(folder):
    """Five spots lead the score in each frame but 11 and 25, which hide strings. Proves no position."""
    sensor = make_sensor(1280, 1024)
    for path in sorted((folder / "images").glob("*.png")):
        points = extract(cv2.imread(str(path), cv2.IMREAD_UNCHANGED), sensor)
        pinned(points)
        visible = {"011": 3, "025": 4}.get(path.stem, 5)
        assert np.sum(points.score > 0.65) >= visible
        narrow = points.sigma_px[:visible, 1]
        assert np.all((narrow > 0.6) & (narrow < 1.1))


def test_a_grid_of_dots_is_measured_whole():
    image, centres = dot_grid(20, 24.0, np.random.default_rng(21))
    said = []
    points = extract(image, make_sensor(512, 512), None, said.append)
    pinned(points)
    assert len(points) == 400
    assert not said
    distance = np.linalg.norm(points.uv_px[:, None] - centres, axis=2)
    assert np.all(distance.min(axis=0) < 0.1)
    assert len(set(distance.argmin(axis=1))) == 400


def in_the_dark(part, offset, whole, rng):
    """A part of a dark image (whole, whole) with noise of 1 DN."""
    image = rng.normal(10.0, 1.0, (whole, whole)).round().clip(0, 255).astype(np.uint8)
    image[offset : offset + len(part), offset : offset + len(part)] = part
    return image


@pytest.mark.parametrize(("side", "pitch", "size"), [(20, 16.0, 512), (12, 14.0, 256), (6, 14.0, 200), (20, 12.0, 400)])
def test_a_fine_grid_of_dots_in_a_part_of_the_image_is_measured_whole(side, pitch, size):
    rng = np.random.default_rng(23)
    part, centres = dot_grid(side, pitch, rng, size)
    said = []
    points = extract(in_the_dark(part, 200, 1024, rng), make_sensor(1024, 1024), None, said.append)
    pinned(points)
    assert len(points) == side * side
    assert not said
    distance = np.linalg.norm(points.uv_px[:, None] - (centres + 200), axis=2)
    assert np.all(distance.min(axis=0) < 0.15)


def test_dots_too_near_to_each_other_in_a_part_of_the_image_are_said_to_be_lost():
    rng = np.random.default_rng(24)
    part, _ = dot_grid(30, 9.0, rng)
    said = []
    points = extract(in_the_dark(part, 200, 1024, rng), make_sensor(1024, 1024), None, said.append)
    pinned(points)
    assert len(points) < 900
    assert len(said) == 1
    assert said[0].startswith("a part of the image is full of light")


def test_a_rough_part_of_the_image_is_no_grid():
    """Speckled metal in a part of the image has peaks and ground between them, too, but not evenly apart."""
    rng = np.random.default_rng(25)
    grains = cv2.GaussianBlur(rng.exponential(size=(400, 400)), (0, 0), 2.0)
    part = np.clip(10 + 400 * np.maximum(grains - 1.1, 0) + rng.normal(size=grains.shape), 0, 255).round()
    image, said = in_the_dark(part.astype(np.uint8), 200, 1024, rng), []
    prepared = prepare(image, ExtractionConfig().detect)
    assert not prepared.dense.any()
    assert not prepared.too_fine
    extract(image, make_sensor(1024, 1024), None, said.append)
    assert not said


@pytest.mark.parametrize(
    ("config", "words"),
    [
        (
            {"localise": LocaliseConfig(max_spots=30)},
            "100 spots were found and the 30 best kept, 70 left out: max_spots of [localise] may be raised",
        ),
        (
            {"detect": DetectConfig(max_candidates=30)},
            "100 peaks stand above the noise and the 30 brightest were looked at, 70 left out: max_candidates of "
            "[detect] may be raised, or threshold",
        ),
    ],
)
def test_what_a_limit_of_number_leaves_out_is_said(config, words):
    image, _ = dot_grid(10, 40.0, np.random.default_rng(22))
    said = []
    assert len(extract(image, make_sensor(512, 512), ExtractionConfig(**config), said.append)) == 30
    assert said == [words]
