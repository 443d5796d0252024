"""From the lit surface that the camera sees to the axis of the string."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from calib.config import CalibConfig
from geometry import Pose, SensorModel, SurfacePoints
from jig_cad import Jig

Array = NDArray[np.float64]


def axis_points(
    surface: SurfacePoints,
    labels: Sequence[str],
    jig: Jig,
    sensor: SensorModel,
    T_sensor_jig: Pose,
    config: CalibConfig,
) -> tuple[Array, Array]:
    """Axis crossings (N, 2) [mm] and covariances (N, 2, 2) of labelled spots.

    surface: N spots, one a label. T_sensor_jig: for the strings' directions; 1° moves the axis by 0.01 radius or so.
    """
    raise NotImplementedError
