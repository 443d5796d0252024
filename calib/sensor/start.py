"""Where the bundle starts: homographies of the boards, a focal length from them, poses, a plane.

References
----------
Zhang, IEEE PAMI 22 (2000) 1330, with the principal point at the image's centre and square pixels: two linear equations
a view for 1/f².
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from calib.sensor.views import BoardView, BoardViews
from geometry import Pose, nearest_rotation, stack_poses

Array = NDArray[np.float64]


def homography(xy: Array, uv: Array) -> Array:
    """The map (3, 3) of points (N, 2) of a plane to their images (N, 2), by the direct linear transform."""
    (p, to_p), (q, to_q) = _centred(xy), _centred(uv)
    one, zero = np.ones(len(p)), np.zeros((len(p), 3))
    ph = np.column_stack([p, one])
    rows = np.concatenate(
        [np.hstack([ph, zero, -q[:, :1] * ph]), np.hstack([zero, ph, -q[:, 1:] * ph])],
    )
    h = np.linalg.svd(rows, full_matrices=True)[2][-1].reshape(3, 3)
    h = np.linalg.inv(to_q) @ h @ to_p
    return np.asarray(h / np.linalg.norm(h))


def focal_length(homographies: Array) -> float:
    """Focal length [px] of (V, 3, 3), pixels from the principal point; NaN where the boards do not tell."""
    h = homographies / np.linalg.norm(homographies, axis=(1, 2), keepdims=True)
    a, b = h[:, :, 0], h[:, :, 1]
    left = np.concatenate([a[:, 0] * b[:, 0] + a[:, 1] * b[:, 1], np.sum(a[:, :2] ** 2 - b[:, :2] ** 2, axis=1)])
    right = -np.concatenate([a[:, 2] * b[:, 2], a[:, 2] ** 2 - b[:, 2] ** 2])
    power = float(left @ left)
    inverse = float(left @ right) / power if power > 0 else np.nan
    return float(inverse**-0.5) if inverse > 0 else float("nan")


def board_pose(h: Array, focal: float) -> Pose:
    """T_camera_board of a homography [mm to px from the principal point], in front of the camera."""
    m = np.diag([1 / focal, 1 / focal, 1.0]) @ h
    m = m * (2 / (np.linalg.norm(m[:, 0]) + np.linalg.norm(m[:, 1])))
    m = m if m[2, 2] > 0 else -m
    r = nearest_rotation(np.column_stack([m[:, 0], m[:, 1], np.cross(m[:, 0], m[:, 1])]))
    return Pose(r, m[:, 2])


def board_poses(views: BoardViews, focal: float) -> Pose:
    """T_camera_board of all views."""
    return stack_poses([board_pose(homography(v.corners.xy_mm, v.corners.uv_px), focal) for v in views.views])


def view_homographies(views: tuple[BoardView, ...]) -> Array:
    """Homographies (V, 3, 3) of all views."""
    return np.stack([homography(v.corners.xy_mm, v.corners.uv_px) for v in views])


def stand_alike(homographies: Array, focal: float, within_rad: float) -> bool:
    """Whether all boards (V, 3, 3) face one way, seen through a lens of about that focal length [px].

    A board's normal is where its vanishing line says: the cross product of the first two columns.
    """
    line = np.cross(homographies[:, :, 0], homographies[:, :, 1]) * [focal, focal, 1.0]
    normal = line / np.linalg.norm(line, axis=1, keepdims=True)
    return bool(np.abs(normal @ normal.T).min() > np.cos(within_rad))


def fitted_plane(points: Array) -> Array:
    """The vector p (3) of the plane p · X = 1 through points (N, 3), by least squares across it."""
    centre = points.mean(axis=0)
    normal = np.linalg.svd(points - centre, full_matrices=False)[2][-1]
    distance = float(normal @ centre)
    return np.asarray(normal / (distance if abs(distance) > 1e-9 else 1e-9))


def _centred(points: Array) -> tuple[Array, Array]:
    """Points about their mean at unit mean distance, and the matrix that takes them there."""
    mean = points.mean(axis=0)
    scale = 1 / max(float(np.mean(np.linalg.norm(points - mean, axis=1))), 1e-12)
    return (points - mean) * scale, np.array([[scale, 0, -scale * mean[0]], [0, scale, -scale * mean[1]], [0, 0, 1]])
