"""What configurations of a cell would measure: where the strings will be seen, how well, and what that tells."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from calib.bundle.information import FrameInformation, Model, frame_information
from calib.bundle.problem import Points, Problem, pad_points, robot_chain
from extraction import image_to_sheet
from geometry import AxisPoints, DhRobot, Pose, Sensor, cross_plane_x0
from geometry.sensor import project
from jig_cad import Jig

Array = NDArray[np.float64]
Index = NDArray[np.intp]

SPOT_SIGMA_PX = 0.07  # a speckled string spot's scatter, as cell recordings show it
SURFACE_SIGMA_MM = 0.015  # what stays unknown of the way from the lit surface to the axis


def view_information(
    robot: DhRobot,
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
    points = expected_points(sensor, jig, T_sensor_jig)
    anchor_sigma = 0.0 if jig.measured else jig.tolerance_mm / np.sqrt(12)
    problem = Problem(points, robot_chain(robot, joints_rad), location, len(Ts_base_jig), jig.anchors_mm, anchor_sigma)
    return frame_information(problem, T_hand_sensor, Ts_base_jig, model)


def expected_points(sensor: Sensor, jig: Jig, T_sensor_jig: Pose) -> Points:
    """Where the strings' axes will be seen at the poses (F), with the covariance that a spot there has."""
    starts = T_sensor_jig @ jig.starts[None]
    crossing, _ = cross_plane_x0(starts, (T_sensor_jig.R[:, None] @ jig.directions[..., None])[..., 0])
    flat = crossing.reshape(-1, 3)
    _, jacobian = image_to_sheet(sensor, project(sensor.require_camera(), flat))
    spread = SPOT_SIGMA_PX**2 * jacobian @ np.swapaxes(jacobian, -1, -2) + SURFACE_SIGMA_MM**2 * np.eye(2)
    covariance = spread.reshape(*crossing.shape[:2], 2, 2)
    count = len(jig.strings)
    none, plain = np.full(count, -1, dtype=np.intp), ("",) * count
    frames = [
        AxisPoints(jig.strings, none, yz, cov, plain) for yz, cov in zip(crossing[..., 1:], covariance, strict=True)
    ]
    return pad_points(frames, jig)
