"""The box that a sensor's housing fills: what may touch the target, the floor or the table."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from geometry.sensor.sensor import Sensor

Array = NDArray[np.float64]

ACROSS_MM, BESIDE_MM, BEHIND_MM = 25.0, 30.0, 60.0  # around emitter and camera; assumed, of a compact line sensor


def housing_box(sensor: Sensor) -> Array:
    """Least and largest corner (2, 3) [mm] in {P} of the sensor's housing.

    As its file states it ([housing]); else a box around emitter and camera that ends at the front of both.
    """
    if sensor.housing_mm is not None:
        return sensor.housing_mm
    low, high = sensor.viewpoints_mm.min(axis=0), sensor.viewpoints_mm.max(axis=0)
    towards = sensor.profile is not None and sensor.profile.z_towards_sensor
    back = np.array([0.0, BEHIND_MM] if towards else [BEHIND_MM, 0.0])  # what is added below, and above, in z
    around = np.array([ACROSS_MM, BESIDE_MM, 0.0])
    return np.array([low - around - np.array([0, 0, back[0]]), high + around + np.array([0, 0, back[1]])])
