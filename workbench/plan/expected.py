"""What configurations of a cell would measure: where the strings will be seen, how well, and what that tells."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from calib.bundle import Bundle, FrameInformation, Hands, Model, frame_information
from extraction import image_to_sheet
from geometry import AxisPoints, Pose, Robot, Sensor, cross_plane_x0
from geometry.sensor import project
from jig_cad import Jig

Array = NDArray[np.float64]
Index = NDArray[np.intp]

# a speckled string spot's scatter: benchmarks/extraction_cells.py finds 0.0080 mm in y where a pixel is some 0.11 mm
SPOT_SIGMA_PX = 0.07
# what stays unknown of the way from the lit surface to the axis: twice the 0.007 mm that a thread of 0.3 mm of unknown
# gloss leaves (calib's surface offset), as it is common to a cell's frames and does not average
SURFACE_SIGMA_MM = 0.015


def view_information(
    robot: Robot,
    sensor: Sensor,
    jig: Jig,
    T_hand_sensor: Pose,
    Ts_base_jig: Pose,
    joints_rad: Array,
    location: Index,
    model: Model = "scp",
) -> FrameInformation:
    """The information of configurations (F, n) [rad] at locations (F,), indices into Ts_base_jig."""
    T_sensor_jig = (robot.pose(joints_rad) @ T_hand_sensor).inverse() @ Ts_base_jig[location]
    axes = expected_points(sensor, jig, T_sensor_jig)
    names = [str(k) for k in range(len(Ts_base_jig))]
    bundle = Bundle.of(axes, [names[k] for k in location], jig, Hands(robot, joints_rad), names)
    return frame_information(bundle, T_hand_sensor, Ts_base_jig, model)


def expected_points(sensor: Sensor, jig: Jig, T_sensor_jig: Pose) -> list[AxisPoints]:
    """Where the strings' axes will be seen at the poses (F), with the covariance that a spot there has."""
    starts = T_sensor_jig @ jig.starts[None]
    crossing, _ = cross_plane_x0(starts, (T_sensor_jig.R[:, None] @ jig.directions[..., None])[..., 0])
    spread = _spot_covariance(sensor, crossing.reshape(-1, 3)) + SURFACE_SIGMA_MM**2 * np.eye(2)
    covariance = spread.reshape(*crossing.shape[:2], 2, 2)
    count = len(jig.strings)
    none, plain = np.full(count, -1, dtype=np.intp), ("",) * count
    return [
        AxisPoints(jig.strings, none, yz, cov, plain) for yz, cov in zip(crossing[..., 1:], covariance, strict=True)
    ]


def _spot_covariance(sensor: Sensor, xyz_mm: Array) -> Array:
    """Covariance (N, 2, 2) [mm²] with which points (N, 3) of the sheet are measured."""
    if sensor.profile is not None:
        return np.broadcast_to(sensor.profile.require_covariance(), (len(xyz_mm), 2, 2))
    _, jacobian = image_to_sheet(sensor, project(sensor.require_camera(), xyz_mm))
    return np.asarray(SPOT_SIGMA_PX**2 * jacobian @ np.swapaxes(jacobian, -1, -2))
