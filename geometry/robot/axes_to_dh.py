"""A Denavit-Hartenberg table for a chain that is known by its joints' axes, such as a URDF's."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from geometry.errors import InputError
from geometry.pose import Pose
from geometry.robot.dh import DhRobot
from geometry.ties import first_least

Array = NDArray[np.float64]

COMMON_NORMAL_RAD = 0.02  # below this the common normal runs away and Hayati's β takes the place of d
ATOL_MM = 1e-7
_SAME_PART = 1e-9  # of a unit vector
_TOUCHING_MM = 1e-9


def robot_from_axes(points: ArrayLike, directions: ArrayLike, T_base_hand: Pose) -> DhRobot:
    """The standard DH model of revolute joints about given axes, without limits.

    Parameters
    ----------
    points : (n, 3)
        A point [mm] on every joint's axis, in the base, all readings at 0.
    directions : (n, 3)
        The axes, in the base.
    T_base_hand : Pose
        The hand's pose at readings 0.

    Returns
    -------
    DhRobot
        What no table can hold stands in T_base_first and T_last_hand; consecutive axes that are nearly parallel get
        d = 0 and Hayati's β.

    References
    ----------
    J. Denavit & R. Hartenberg, J. Applied Mechanics 1955; S. Hayati, IEEE CDC 1983.
    """
    p = np.asarray(points, dtype=float)
    z = np.asarray(directions, dtype=float)
    if p.ndim != 2 or p.shape[1:] != (3,) or p.shape != z.shape or len(p) == 0:
        raise InputError(f"points and directions of the axes must both be (n, 3), not {p.shape} and {z.shape}")
    z = z / np.linalg.norm(z, axis=1, keepdims=True)
    first = here = _base_frame(p[0], z[0])
    rows = []
    for i in range(1, len(p)):
        row = _row_to_axis(here, p[i], z[i])
        rows.append(row)
        here = here @ _link(row)
    rest = here.inverse() @ T_base_hand
    rows.append(_last_row(rest))
    theta, d, a, alpha, beta = np.array(rows).T
    T_last_hand = (here @ _link(rows[-1])).inverse() @ T_base_hand
    if np.max(np.abs(T_last_hand.matrix - np.eye(4))) < 1e-12:
        T_last_hand = Pose.identity()
    table = DhRobot.from_dh(theta, d, a, alpha, beta=beta)
    robot = replace(table, T_base_first=first, T_last_hand=T_last_hand)
    _check_axes(robot, p, z)
    return robot


def _base_frame(point: Array, axis: Array) -> Pose:
    """Frame 0: z along the first axis; the base itself where that is the base's z axis."""
    if np.hypot(axis[0], axis[1]) < 1e-12 and axis[2] > 0 and np.hypot(point[0], point[1]) < _TOUCHING_MM:
        return Pose.identity()
    origin = point - (point @ axis) * axis
    x = np.eye(3)[first_least(np.abs(axis), _SAME_PART)]
    x = x - (x @ axis) * axis
    x = x / np.linalg.norm(x)
    return Pose(np.column_stack([x, np.cross(axis, x), axis]), origin)


def _row_to_axis(here: Pose, point: Array, axis: Array) -> tuple[float, float, float, float, float]:
    """θ, d, a, α, β from the frame ``here`` to one whose z is the next axis."""
    back = here.inverse()
    p, v = back @ point, back.R @ axis  # the next axis, seen from here: own axis is z through the origin
    sine = np.hypot(v[0], v[1])
    if sine < np.sin(COMMON_NORMAL_RAD):
        foot = p - v * (p[2] / v[2])  # where the next axis crosses this frame's xy plane
        a = float(np.hypot(foot[0], foot[1]))
        theta = _angle(foot[1], foot[0]) if a > _TOUCHING_MM else 0.0
        u = _turned(v, -theta)
        return theta, 0.0, a if a > _TOUCHING_MM else 0.0, _angle(-u[1], u[2]), float(np.arcsin(u[0]))
    normal = np.array([-v[1], v[0], 0.0]) / sine  # z × v, the direction of the common normal
    a = float(p @ normal)
    if abs(a) < _TOUCHING_MM:
        a, sign = 0.0, 1.0 if normal[0] > -1e-9 else -1.0
    else:
        sign = float(np.sign(a))
    x = sign * normal
    theta = _angle(x[1], x[0])
    # height at which the normal leaves this axis: solve s v + ... = d z + a x in the plane that holds z and v
    across = np.cross(x, [0.0, 0.0, 1.0])
    d = float(p[2] - v[2] * (p @ across) / (v @ across))
    u = _turned(v, -theta)
    return theta, d, abs(a), _angle(-u[1], u[2]), 0.0


def _last_row(rest: Pose) -> tuple[float, float, float, float, float]:
    """What of the way from the last axis to the hand is a turn about and a shift along that axis."""
    theta = _angle(rest.R[1, 0], rest.R[0, 0])
    return theta, float(rest.t[2]), 0.0, 0.0, 0.0


def _angle(y: float, x: float) -> float:
    """arctan2 with a half turn always +π, whatever rounding makes of it."""
    angle = float(np.arctan2(y, x))
    return angle + 2 * np.pi if angle < 1e-12 - np.pi else angle


def _turned(v: Array, angle: float) -> Array:
    c, s = np.cos(angle), np.sin(angle)
    return np.array([c * v[0] - s * v[1], s * v[0] + c * v[1], v[2]])


def _link(row: tuple[float, float, float, float, float]) -> Pose:
    theta, d, a, alpha, beta = row
    return DhRobot.from_dh([theta], [d], [a], [alpha], beta=beta).pose([0.0])


def _check_axes(robot: DhRobot, points: Array, directions: Array) -> None:
    """InputError where the table lost an axis, as degenerate input might make it."""
    frames = robot.link_poses(np.zeros(robot.n_joints))[:-1]
    off = np.linalg.norm(np.cross(points - frames.t, directions), axis=1)
    turned = np.linalg.norm(np.cross(frames.R[:, :, 2], directions), axis=1)
    aligned = np.all(np.sum(frames.R[:, :, 2] * directions, axis=1) > 0)
    if not (np.all(off < ATOL_MM) and np.all(turned < 1e-9) and aligned):
        worst = int(np.nanargmax(off)) + 1 if np.any(np.isfinite(off)) else 1
        raise InputError(f"no Denavit-Hartenberg table holds the axes as given (joint {worst} is the worst)")
