"""OpenCV's camera with its Jacobians by point and parameters, forwards (projection) and backwards (rays)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from geometry.sensor import CAMERA_PARAMETERS

Array = NDArray[np.float64]

PINHOLE = ("fx_px", "fy_px", "cx_px", "cy_px")
TERMS = CAMERA_PARAMETERS[len(PINHOLE) :]
K1, K2, P1, P2, K3, K4, K5, K6, S1, S2, S3, S4, TAU_X, TAU_Y = range(len(TERMS))

_STEPS = 30  # of Newton's method at most: it doubles its digits each time
_REACHED = 1e-9  # a step so short that the next would be below rounding


@dataclass(frozen=True, eq=False)
class Mapped:
    """Values (N, 2) of a map with its Jacobians: by the point (N, 2, 2) and by the camera's parameters (N, 2, 18)."""

    value: Array
    by_point: Array
    by_camera: Array


def project(camera: Array, xy: Array) -> Mapped:
    """Pixels of ideal normalised coordinates (N, 2); camera (18,) in the order of CAMERA_PARAMETERS."""
    focal, centre = camera[:2], camera[2:4]
    seen, by_xy, by_terms = _distort(xy, camera[4:])
    by_camera = np.zeros((len(xy), 2, len(camera)), dtype=seen.dtype)
    by_camera[:, 0, 0], by_camera[:, 1, 1] = seen[:, 0], seen[:, 1]
    by_camera[:, 0, 2] = by_camera[:, 1, 3] = 1.0
    by_camera[:, :, 4:] = focal[:, None] * by_terms
    return Mapped(seen * focal + centre, focal[:, None] * by_xy, by_camera)


def undistort(camera: Array, uv: Array) -> Mapped:
    """Ideal normalised coordinates of pixels (N, 2), NaN where the lens has no inverse; by_point is by the pixel."""
    focal = camera[:2]
    goal = (uv - camera[2:4]) / focal
    xy = goal * (1.0 + 0.0 * camera[0])
    for _ in range(_STEPS if np.any(camera[4:] != 0) else 0):
        seen, by_xy, _ = _distort(xy, camera[4:])
        with np.errstate(all="ignore"):
            step = (_inverse2(by_xy) @ (goal - seen)[..., None])[..., 0]
        xy = xy + step
        if not np.any(np.abs(step) > _REACHED):
            break
    found = project(camera, xy)
    with np.errstate(all="ignore"):
        back = _inverse2(found.by_point)
        lost = ~(np.max(np.abs(found.value - uv), axis=1) < 1e-6)
    xy, back = np.where(lost[:, None], np.nan, xy), np.where(lost[:, None, None], np.nan, back)
    return Mapped(xy, back, -back @ found.by_camera)


def _distort(xy: Array, k: Array) -> tuple[Array, Array, Array]:
    """Distorted coordinates (N, 2), by the ideal ones (N, 2, 2) and by the 14 terms (N, 2, 14)."""
    x, y = xy[:, 0], xy[:, 1]
    r2 = x * x + y * y
    r4, r6 = r2 * r2, r2 * r2 * r2
    top, bottom = 1 + k[K1] * r2 + k[K2] * r4 + k[K3] * r6, 1 + k[K4] * r2 + k[K5] * r4 + k[K6] * r6
    radial = top / bottom
    d_top = k[K1] + 2 * k[K2] * r2 + 3 * k[K3] * r4
    d_bottom = k[K4] + 2 * k[K5] * r2 + 3 * k[K6] * r4
    slope = 2 * (d_top - radial * d_bottom) / bottom  # ∂radial/∂x = slope · x
    a, b = r2 + 2 * x * x, r2 + 2 * y * y
    bent = np.stack(
        [
            x * radial + 2 * k[P1] * x * y + k[P2] * a + k[S1] * r2 + k[S2] * r4,
            y * radial + k[P1] * b + 2 * k[P2] * x * y + k[S3] * r2 + k[S4] * r4,
        ],
        -1,
    )
    by_xy = np.empty((len(xy), 2, 2), dtype=bent.dtype)
    px, py = 2 * k[S1] + 4 * k[S2] * r2, 2 * k[S3] + 4 * k[S4] * r2
    by_xy[:, 0, 0] = radial + slope * x * x + 2 * k[P1] * y + 6 * k[P2] * x + px * x
    by_xy[:, 0, 1] = slope * x * y + 2 * k[P1] * x + 2 * k[P2] * y + px * y
    by_xy[:, 1, 0] = slope * x * y + 2 * k[P1] * x + 2 * k[P2] * y + py * x
    by_xy[:, 1, 1] = radial + slope * y * y + 6 * k[P1] * y + 2 * k[P2] * x + py * y
    by_k = np.zeros((len(xy), 2, len(TERMS)), dtype=bent.dtype)
    for up, down, power in ((K1, K4, r2), (K2, K5, r4), (K3, K6, r6)):
        by_k[:, :, up] = xy * (power / bottom)[:, None]
        by_k[:, :, down] = -xy * (radial * power / bottom)[:, None]
    by_k[:, 0, P1], by_k[:, 1, P1] = 2 * x * y, b
    by_k[:, 0, P2], by_k[:, 1, P2] = a, 2 * x * y
    by_k[:, 0, S1], by_k[:, 0, S2], by_k[:, 1, S3], by_k[:, 1, S4] = r2, r4, r2, r4
    tilted, by_bent, by_tau = _tilt(bent, k[TAU_X], k[TAU_Y])
    by_k = by_bent @ by_k
    by_k[:, :, TAU_X:] = by_tau
    return tilted, by_bent @ by_xy, by_k


def _tilt(xy: Array, tau_x: float, tau_y: float) -> tuple[Array, Array, Array]:
    """OpenCV's tilted chip: a homography of (N, 2), with its Jacobians by the point and by (τx, τy)."""
    (sx, sy), (cx, cy) = np.sin([tau_x, tau_y]), np.cos([tau_x, tau_y])
    one, zero = 1.0 + 0 * sx, 0 * sx
    r = np.array([[cy, sy * sx, -sy * cx], [zero, cx, sx], [sy, -cy * sx, cy * cx]])
    shear = np.array([[r[2, 2], zero, -r[0, 2]], [zero, r[2, 2], -r[1, 2]], [zero, zero, one]])
    dr_x = np.array([[zero, sy * cx, sy * sx], [zero, -sx, cx], [zero, -cy * cx, -cy * sx]])
    dr_y = np.array([[-sy, cy * sx, -cy * cx], [zero, zero, zero], [cy, sy * sx, -sy * cx]])
    h = shear @ r
    p = np.concatenate([xy, np.ones((len(xy), 1))], 1)
    w = p @ h[2]
    out = (p @ h[:2].T) / w[:, None]
    by_point = (h[:2, :2] - out[:, :, None] * h[2, :2]) / w[:, None, None]
    by_tau = []
    for dr in (dr_x, dr_y):
        d_shear = np.array([[dr[2, 2], zero, -dr[0, 2]], [zero, dr[2, 2], -dr[1, 2]], [zero, zero, zero]])
        dh = d_shear @ r + shear @ dr
        by_tau.append((p @ dh[:2].T - out * (p @ dh[2])[:, None]) / w[:, None])
    return out, by_point, np.stack(by_tau, -1)


def _inverse2(m: Array) -> Array:
    det = m[:, 0, 0] * m[:, 1, 1] - m[:, 0, 1] * m[:, 1, 0]
    out = np.stack([np.stack([m[:, 1, 1], -m[:, 0, 1]], -1), np.stack([-m[:, 1, 0], m[:, 0, 0]], -1)], 1)
    return np.asarray(out / det[:, None, None])
