"""How what was solved moves a measured point in the base: the derivatives by which its σ follow."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from calib.sensor_errors import SensorErrors
from geometry import Pose, Robot, cross

Array = NDArray[np.float64]


def prediction_jacobian(
    T_hand_sensor: Pose, robot: Robot, errors: SensorErrors | None, readings: Array, yz_mm: Array
) -> Array:
    """Motions (F, M, 3, 6 + P + K) [mm] in the base of points of the sheet, by SCP, robot and sensor.

    readings (F, n): of the joints. yz_mm (F, M, 2): as measured.
    """
    hands = robot.pose(readings)
    sensors = hands @ T_hand_sensor
    points = np.concatenate([np.zeros((*yz_mm.shape[:2], 1)), yz_mm], -1)  # (F, M, 3) in {P}
    in_hand = points @ T_hand_sensor.R.T + T_hand_sensor.t
    by_scp = _carried(sensors.R, points, np.eye(6)[None])
    by_robot = _carried(hands.R, in_hand, robot.parameter_jacobian(readings))
    parts = [by_scp, by_robot]
    if errors is not None:
        twists, motions = errors.derivatives(yz_mm, np.zeros(len(errors.labels)))
        in_sheet = np.concatenate([np.zeros((*motions.shape[:2], 1, motions.shape[-1])), motions], -2)
        turned = twists[:3] + np.moveaxis(cross(twists[3:].T, points[..., None, :]), -1, -2)
        parts.append(sensors.R[:, None] @ (in_sheet + turned))
    return np.concatenate(parts, -1)


def _carried(R: Array, points: Array, twists: Array) -> Array:
    """Motions (F, M, 3, n) in the base of points (F, M, 3) of a body turned by R and moved by twists (F, 6, n)."""
    t = np.moveaxis(twists, -1, -2)[:, None]  # (F, 1, n, 6)
    moved = t[..., :3] + cross(np.broadcast_to(t[..., 3:], (*points.shape[:2], *t.shape[2:3], 3)), points[..., None, :])
    return np.asarray(R[:, None] @ np.moveaxis(moved, -1, -2))
