"""How far sensor, hand and arm keep from the jig's own solids: its plates and posts, and the strings between them."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from geometry import Arm, Pose, Sensor
from jig_cad import Jig
from jig_cad.solids import PillarDesign, block_edge_mm

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

STEP_MM = 25.0  # of the points that stand for a body's middle line
HAND_MM = 60.0  # half the thickness of what joins hand and sensor, with its safety distance; assumed
ARM_MM = 100.0  # half the thickness of an arm's links, with theirs; assumed
FIRST_LINK = 2  # the base and the first links stand far off


def sensor_clearance_mm(sensor: Sensor, jig: Jig, T_sensor_jig: Pose) -> Array:
    """Least distance (N) [mm] of the line from emitter to camera from the jig's solids at the poses (N)."""
    line = _line(sensor.viewpoints_mm[None])[0]
    return distance_mm(jig, T_sensor_jig.inverse() @ line[None])


def arm_clears(robot: Arm, joints_rad: Array, T_hand_sensor: Pose, T_base_jig: Pose, jig: Jig) -> Mask:
    """Whether hand and arm keep off the jig at the readings (N, n).

    The arm stands as the lines between its links' origins, the hand as the line from the flange to the sensor's frame,
    each ARM_MM or HAND_MM thick: no maker's hull is known here.
    """
    if len(joints_rad) == 0:
        return np.zeros(0, dtype=bool)
    links = robot.link_poses(joints_rad)
    T_jig_base, hand = T_base_jig.inverse(), robot.pose(joints_rad)
    corners = np.stack([hand.t, (hand @ T_hand_sensor).t], axis=1)
    hand_off = distance_mm(jig, T_jig_base @ _line(corners))
    arm_off = distance_mm(jig, T_jig_base @ _line(links.t[:, FIRST_LINK:]))
    return np.asarray((hand_off > HAND_MM) & (arm_off > ARM_MM))


def distance_mm(jig: Jig, points: Array) -> Array:
    """Least distance (N) [mm] of points (N, K, 3) in {J} from the boxes around the jig's plates, posts and strings."""
    low, high = _boxes(jig)
    outside = np.maximum(np.maximum(low - points[:, :, None], points[:, :, None] - high), 0)
    return np.asarray(np.min(np.linalg.norm(outside, axis=-1), axis=(1, 2)))


def _boxes(jig: Jig) -> tuple[Array, Array]:
    """Least and largest corners (5, 3) of the boxes around both plates, the strings and both posts.

    Of lines that are no pillar: (1, 3), of the box around all strings and the blocks that hold them.
    """
    if jig.pillar is None:
        half = block_edge_mm(jig) / 2
        points = jig.anchors_mm[jig.used_anchors]
        return points.min(axis=0, keepdims=True) - half, points.max(axis=0, keepdims=True) + half
    design = PillarDesign()
    y0, z0, y1, z1 = design.plate(jig).bounds
    h, thick, r = jig.height_mm, design.plate_thickness_mm, design.post_diameter_mm / 2
    posts = design.posts_yz(jig)
    low = [[-thick, y0, z0], [h, y0, z0], jig.anchors_mm.min(axis=0)] + [[0.0, y - r, z - r] for y, z in posts]
    high = [[0.0, y1, z1], [h + thick, y1, z1], jig.anchors_mm.max(axis=0)] + [[h, y + r, z + r] for y, z in posts]
    return np.array(low), np.array(high)


def _line(corners: Array) -> Array:
    """Points (N, K, 3) along the lines through corners (N, C, 3), some STEP_MM apart."""
    parts = [corners[:, :1]]
    for k in range(corners.shape[1] - 1):
        length = float(np.max(np.linalg.norm(corners[:, k + 1] - corners[:, k], axis=-1)))
        share = np.linspace(0, 1, max(2, int(np.ceil(length / STEP_MM)) + 1))[1:, None]
        parts.append(corners[:, k : k + 1] + share * (corners[:, k + 1] - corners[:, k])[:, None])
    return np.concatenate(parts, axis=1)
