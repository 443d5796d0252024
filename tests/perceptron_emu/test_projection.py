"""Projection against OpenCV's. Does not prove that OpenCV's model fits a lens."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from perceptron_emu import project
from tests.perceptron_emu.conftest import TILTED, make_sensor

ATOL_PX = 1e-9


@pytest.mark.parametrize("terms", [0, 4, 5, 8, 12, 14])
def test_projection_agrees_with_opencv(terms: int) -> None:
    sensor = make_sensor(TILTED[:terms])
    rng = np.random.default_rng(terms)
    xyz = rng.uniform([-20, -80, 200], [20, 80, 450], (500, 3))
    T_camera_sensor = sensor.camera.T_sensor_camera.inverse()
    expected, _ = cv2.projectPoints(
        xyz, cv2.Rodrigues(T_camera_sensor.R)[0], T_camera_sensor.t, sensor.camera.matrix, sensor.camera.distortion14
    )
    np.testing.assert_allclose(project(sensor, xyz), expected[:, 0], rtol=0, atol=ATOL_PX)


def test_points_behind_the_camera_have_no_image() -> None:
    sensor = make_sensor()
    behind = sensor.camera.centre_mm - 10 * sensor.camera.T_sensor_camera.R[:, 2]
    assert np.all(np.isnan(project(sensor, behind)))
