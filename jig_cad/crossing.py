"""Where strings cross the laser plane, and how that moves with the target's pose and with every anchor."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from geometry import Pose, Prediction, SheetPoints, cross

Array = NDArray[np.float64]
Index = NDArray[np.intp]


def predict_crossings(
    anchors_mm: Array,
    start: Index,
    end: Index,
    T_sensor_target: Pose,
    shifts: Array,
    points: SheetPoints,
    motions: Array | None = None,
) -> Prediction:
    """Crossings less measured points (F, M, 2) [mm], with their Jacobians.

    anchors_mm (A, 3): nominal. start, end (S,): anchors of every string. shifts (2A,): of the anchors' y and z [mm].
    motions (K, A, 3): further shape unknowns that move the anchors so, behind the shifts' columns.
    A point carried by a twist (v, ω) moves by v + ω × c, and its string then slides along itself back into the plane:
    row r of the Jacobian is (g, c × g) with g = e_r - slope_r e_x, in sensor axes.
    """
    moved = anchors_mm.copy()
    moved[:, 1:] += shifts.reshape(-1, 2)
    in_sensor = moved @ np.swapaxes(T_sensor_target.R, -1, -2) + T_sensor_target.t[:, None, :]  # (F, A, 3)
    frame = np.arange(len(points))[:, None]
    first, second = start[points.feature], end[points.feature]  # (F, M)
    begin = in_sensor[frame, first]
    along = in_sensor[frame, second] - begin
    slope = along / along[..., :1]
    crossing = begin - begin[..., :1] * slope
    seen = points.present[..., None]
    g = np.zeros((*seen.shape[:2], 2, 3))
    g[..., 0] = -slope[..., 1:] * seen
    g[..., 0, 1] = g[..., 1, 2] = points.present
    twist = np.concatenate([g, cross(crossing[..., None, :], g)], -1)  # (F, M, 2, 6)
    share = (-begin[..., 0] / along[..., 0])[..., None]  # of the way from start to end
    anchor = np.arange(len(anchors_mm))
    weight = (1 - share) * (first[..., None] == anchor) + share * (second[..., None] == anchor)  # (F, M, A)
    across = g @ T_sensor_target.R[:, None, :, 1:]  # (F, M, 2, 2): by y and z of a shift, target axes
    by_shape = (weight[..., None, :, None] * across[..., :, None, :]).reshape(*twist.shape[:3], 2 * len(anchor))
    if motions is not None:
        along_all = g @ T_sensor_target.R[:, None]  # (F, M, 2, 3): by a motion in target axes
        moved_by = np.einsum("fma,kac->fmck", weight, motions)
        by_shape = np.concatenate([by_shape, along_all @ moved_by], -1)
    residual = (crossing[..., 1:] - points.yz_mm) * seen
    return Prediction(residual, twist, by_shape)


def offset_from_lines(points_mm: Array, starts: Array, directions: Array) -> tuple[Array, Array]:
    """Perpendicular offsets (N, 3) [mm] of points (N, 3) from lines through (N, 3) along unit (N, 3), and d/dpoint."""
    across = np.eye(3) - directions[:, :, None] * directions[:, None, :]
    return (across @ (points_mm - starts)[..., None])[..., 0], across
