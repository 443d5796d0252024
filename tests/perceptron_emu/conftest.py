"""Sensors and scenes that the emulator's tests share."""

from __future__ import annotations

import numpy as np
import pytest

from geometry import Camera, Pose, Sensor, Sheet
from jig_cad import Jig
from perceptron_emu import Scene

CAMERA_ROTATION = np.array(
    [[0, -0.924016832, -0.382351793], [1, 0, 0], [0, -0.382351793, 0.924016832]]
)  # looks at the sheet some 290 mm in front of the emitter, from 120 mm beside it
TILTED = (-0.11, 0.06, 4e-4, -3e-4, 0.01, 0.02, -0.01, 0.004, 2e-4, -1e-4, 3e-4, 1e-4, 0.03, -0.05)


def make_sensor(distortion: tuple[float, ...] = (), **more: object) -> Sensor:
    values: dict[str, object] = {
        "width_px": 1280,
        "height_px": 1024,
        "fx_px": 2300.0,
        "fy_px": 2300.0,
        "cx_px": 639.5,
        "cy_px": 511.5,
        "T_sensor_camera": Pose(_orthonormal(CAMERA_ROTATION), np.array([120.0, 0, 0])),
        "distortion": distortion,
        "black_level": 10.0,
    } | more
    sheet = Sheet(fan_rad=values.pop("fan_rad", float(np.deg2rad(44))))  # type: ignore[arg-type]
    return Sensor(sheet, Camera(**values))  # type: ignore[arg-type]


def _orthonormal(matrix: np.ndarray) -> np.ndarray:
    u, _, vt = np.linalg.svd(matrix)
    return u @ vt


def jig_before(sensor: Sensor, rotation_deg: tuple[float, float, float] = (5, 25, 3), depth_mm: float = 290.0) -> Scene:
    """A nominal jig whose string A crosses the sheet at mid-height, straight ahead."""
    rotation = Pose.from_fixed_xyz_deg(rotation_deg, np.zeros(3)).R
    return Scene(sensor, Jig.nominal(), Pose(rotation, np.array([0, 0, depth_mm]) - rotation @ [50.0, 0, 0]))


@pytest.fixture
def sensor() -> Sensor:
    return make_sensor()


@pytest.fixture
def scene(sensor: Sensor) -> Scene:
    return jig_before(sensor)
