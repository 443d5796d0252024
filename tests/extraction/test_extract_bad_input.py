"""Images that can not be used: one sentence, or an empty answer with its reason; never a false point or a crash."""

import re
import resource

import numpy as np
import pytest

from extraction import ExtractionConfig, extract, extract_stages
from geometry import InputError, PerceptronEmuError
from tests.extraction.spots import camera, make_sensor, mean_frame, some_spots
from tests.pinned import pinned

SENSOR = make_sensor()
MOST_MORE_KB = 100_000


@pytest.mark.parametrize(
    ("image", "words"),
    [
        (np.zeros((512, 640, 3), np.uint8), "not colour"),
        (np.zeros((640, 512), np.uint8), "turned by 90°"),
        (np.zeros((100, 640), np.uint8), "640 × 100 px but .image. of the sensor says 640 × 512"),
        (np.zeros((1, 1), np.uint8), "1 × 1 px but"),
        (np.zeros((0, 0), np.uint8), "0 × 0 px but"),
        (np.zeros((512, 640)), "holds float64"),
        (np.full((512, 640), 300, np.uint16), "grey level 300, above the 255"),
        (None, "is NoneType, not an array"),
        (np.zeros(5, np.uint8), "shape .5,."),
    ],
)
def test_unusable_images_are_refused_in_one_sentence(image, words):
    with pytest.raises(InputError, match=words) as caught:
        extract(image, SENSOR)
    assert "\n" not in str(caught.value)


def test_a_huge_image_is_refused_before_anything_is_computed():
    image = np.lib.stride_tricks.as_strided(np.zeros(1, np.uint8), (60_000, 60_000), (0, 0))
    with pytest.raises(InputError, match="at most") as refused:
        extract(image, make_sensor(60_000, 60_000, fx_px=90_000.0, fy_px=90_000.0))
    pinned(str(refused.value))


def test_eight_bit_image_for_a_deeper_sensor_is_refused():
    with pytest.raises(InputError, match="8 bits") as refused:
        extract(np.zeros((512, 640), np.uint8), make_sensor(bit_depth=12))
    pinned(str(refused.value))


@pytest.mark.parametrize(
    ("image", "words"),
    [
        (np.zeros((512, 640), np.uint8), "blank"),
        (np.full((512, 640), 255, np.uint8), "blank"),
        (
            np.random.default_rng(0).normal(30, 5, (512, 640)).clip(0, 255).astype(np.uint8),
            "nothing stands above|none of",
        ),
        (np.random.default_rng(1).integers(0, 256, (512, 640)).astype(np.uint8), "nothing stands above|none of"),
        (np.where(np.random.default_rng(2).uniform(size=(512, 640)) < 0.9, 255, 0).astype(np.uint8), "saturated"),
    ],
)
def test_images_without_spots_are_empty_and_say_why(image, words):
    stages = extract_stages(image, SENSOR)
    assert len(stages.points) == 0
    assert len(extract(image, SENSOR)) == 0
    assert re.search(words, stages.reason)


@pytest.mark.parametrize("size", [(1, 1), (2, 3), (5, 5), (17, 4), (33, 40)])
def test_tiny_sensors_do_not_crash(size):
    width, height = size
    image = np.random.default_rng(3).integers(0, 255, (height, width)).astype(np.uint8)
    extract(image, make_sensor(width, height, fx_px=2.0 * max(size), fy_px=2.0 * max(size)))


def corrupted(rng: np.random.Generator, image: np.ndarray) -> np.ndarray:
    """One of the ways in which recordings go wrong."""
    image = image.copy()
    kind = rng.integers(0, 9)
    if kind == 0:
        image[rng.integers(0, 512) :] = rng.integers(0, 256)
    elif kind == 1:
        image = np.roll(image, rng.integers(0, 640), axis=1) ^ np.uint8(rng.integers(0, 256))
    elif kind == 2:
        image[rng.uniform(size=image.shape) < rng.uniform(0, 0.5)] = rng.integers(0, 256)
    elif kind == 3:
        image = np.rot90(image, rng.integers(0, 4)).copy()
    elif kind == 4:
        image = (image.astype(float) * rng.uniform(0, 30)).clip(0, 255).astype(np.uint8)
    elif kind == 5:
        image[:, :: rng.integers(1, 9)] = 255
    elif kind == 6:
        image = image[: rng.integers(0, 513), : rng.integers(0, 641)]
    elif kind == 7:
        image = np.frombuffer(rng.bytes(512 * 640), np.uint8).reshape(512, 640)
    else:
        image = np.repeat(image[:, :, None], rng.integers(1, 5), axis=2)
    return image


def fuzz(count: int, seed: int) -> None:
    rng = np.random.default_rng(seed)
    good = camera(mean_frame(some_spots(rng)), rng)
    for _ in range(count):
        try:
            points = extract(corrupted(rng, good), SENSOR)
        except PerceptronEmuError:
            continue
        assert len(points) <= ExtractionConfig().localise.max_spots
        assert np.all(np.isfinite(points.uv_px))
        assert np.all(np.isfinite(points.cov_yz_mm2))
        assert np.all(np.linalg.eigvalsh(points.cov_uv_px2) > 0)
        assert np.all((points.score >= 0) & (points.score <= 1))


def test_fuzz_raises_only_our_own_errors():
    fuzz(120, 1)


@pytest.mark.slow
def test_long_fuzz_raises_only_our_own_errors():
    """100,000 corrupted images in bounded memory; 492 s of processor time and 12 MB more when it was last run."""
    fuzz(200, 0)
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    fuzz(100_000, 2)
    assert resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before < MOST_MORE_KB
