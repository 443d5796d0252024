"""A direct map from pixels to the laser plane: what it says, where it says nothing, and what is none."""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np
import pytest

from extraction.sheet import image_to_sheet
from geometry import Camera, InputError, Pose, Sensor, Sheet
from geometry.sensor import DirectMap, SensorUncertainty, calibration_covariance
from tests.pinned import pinned

SIZE = (640, 480)
H = np.array([[0.1, 0.01, -30.0], [-0.02, 0.12, 250.0], [1e-5, 2e-4, 1.0]])
POWERS = ((0, 0, 1.0, 300.0), (1, 0, 40.0, -2.0), (0, 1, 3.0, 30.0), (1, 1, 0.3, -0.2), (0, 4, 0.01, 0.05))


def sensor_with(direct: DirectMap | None) -> Sensor:
    towards = np.array([[0.0, 0, -1], [1, 0, 0], [0, -1, 0]])
    camera = Camera(*SIZE, 700.0, 700.0, 319.5, 239.5, Pose(towards, np.array([120.0, 0, 300])))
    return Sensor(Sheet(), camera, direct=direct, uncertainty=SensorUncertainty.from_sigma({"fx_px": 0.0}))


def pixels() -> np.ndarray:
    return np.random.default_rng(0).uniform([0, 0], [639, 479], (50, 2))


def test_a_homography_is_opencvs() -> None:
    yz, _ = image_to_sheet(sensor_with(DirectMap(H)), pixels())
    np.testing.assert_allclose(yz, cv2.perspectiveTransform(pixels()[None], H)[0], rtol=0, atol=1e-9)


def test_a_polynomial_is_that_of_the_file() -> None:
    at = (pixels() - [319.5, 239.5]) / 400.0  # the half diagonal of 640 × 480
    u, v = at.T
    y = 1 + 40 * u + 3 * v + 0.3 * u * v + 0.01 * v**4
    z = 300 - 2 * u + 30 * v - 0.2 * u * v + 0.05 * v**4
    yz, _ = image_to_sheet(sensor_with(DirectMap(polynomial=POWERS)), pixels())
    np.testing.assert_allclose(yz, np.column_stack([y, z]), rtol=0, atol=1e-9)


@pytest.mark.parametrize("direct", [DirectMap(H), DirectMap(polynomial=POWERS)], ids=["homography", "polynomial"])
def test_the_jacobian_is_that_of_differences(direct: DirectMap) -> None:
    sensor, step = sensor_with(direct), 1e-3
    _, jacobian = image_to_sheet(sensor, pixels())
    for k in range(2):
        d = step * np.eye(2)[k]
        slope = (image_to_sheet(sensor, pixels() + d)[0] - image_to_sheet(sensor, pixels() - d)[0]) / (2 * step)
        np.testing.assert_allclose(jacobian[:, :, k], slope, rtol=0, atol=1e-7)


def test_beyond_the_pixels_of_its_fit_it_says_nothing() -> None:
    direct = DirectMap(H, seen_px=(100.0, 50.0, 500.0, 400.0))
    yz, jacobian = image_to_sheet(sensor_with(direct), np.array([[100.0, 50], [99, 200], [300, 401], [300, 200]]))
    assert np.isfinite(yz).all(axis=1).tolist() == [True, False, False, True]
    assert np.isnan(jacobian[1]).all()


def test_what_it_leaves_of_its_camera_is_in_the_sensors_own_sigma() -> None:
    points = np.array([[3.0, 290.0], [-8.0, 310.0]])
    sigma = SensorUncertainty.from_sigma({"plane_shift_mm": 0.02})
    plain, mapped = (replace(sensor_with(d), uncertainty=sigma) for d in (None, DirectMap(H, rms_mm=0.2)))
    more = calibration_covariance(mapped, points) - calibration_covariance(plain, points)
    np.testing.assert_allclose(more, np.broadcast_to(0.02 * np.eye(2), (2, 2, 2)), rtol=0, atol=1e-12)


@pytest.mark.parametrize(
    ("fields", "words"),
    [
        ({}, "exactly one"),
        ({"homography": H, "polynomial": POWERS}, "exactly one"),
        ({"homography": np.ones((3, 3))}, "invertible"),
        ({"homography": np.full((3, 3), np.nan)}, "invertible"),
        ({"polynomial": ((-1, 0, 1.0, 1.0),)}, "powers"),
        ({"polynomial": ((9, 6, 1.0, 1.0),)}, "powers"),
        ({"polynomial": ((1, 0, 1.0, 1.0), (1, 0, 2.0, 1.0))}, "same powers"),
        ({"homography": H, "rms_mm": -1.0}, "rms_mm"),
        ({"homography": H, "seen_px": (5.0, 0.0, 1.0, 9.0)}, "seen_px"),
    ],
)
def test_what_is_no_map_is_refused(fields: dict[str, object], words: str) -> None:
    with pytest.raises(InputError, match=words) as refused:
        DirectMap(**fields)
    pinned(str(refused.value))


def test_a_map_needs_an_image() -> None:
    with pytest.raises(InputError, match="needs \\[image\\] and \\[camera\\]") as refused:
        Sensor(Sheet(), direct=DirectMap(H))
    pinned(str(refused.value))
