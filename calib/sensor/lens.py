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
    seen, by_xy, by_terms = _distort_by_terms(xy, camera[4:])
    by_camera = np.zeros((len(xy), 2, len(camera)), dtype=seen.dtype)
    by_camera[:, 0, 0], by_camera[:, 1, 1] = seen[:, 0], seen[:, 1]
    by_camera[:, 0, 2] = by_camera[:, 1, 3] = 1.0
    by_camera[:, :, 4:] = focal[:, None] * by_terms
    return Mapped(seen * focal + centre, focal[:, None] * by_xy, by_camera)


def undistort(camera: Array, uv: Array, start: Array | None = None) -> Mapped:
    """Ideal normalised coordinates of pixels (N, 2), NaN where the lens has no inverse; by_point is by the pixel.

    start (N, 2): where the search begins, where something near is known.
    """
    xy = rays(camera, uv, start).value
    found = project(camera, xy)
    with np.errstate(all="ignore"):
        back = _inverse2(found.by_point)
    return Mapped(xy, back, -back @ found.by_camera)


@dataclass(frozen=True, eq=False)
class PinholeRays:
    """Ideal normalised coordinates (N, 2) of pixels, and their Jacobian by the pixel (N, 2, 2)."""

    value: Array
    by_point: Array


def rays(camera: Array, uv: Array, start: Array | None = None) -> PinholeRays:
    """As ``undistort``, without the Jacobian by the camera."""
    focal = camera[:2]
    goal = (uv - camera[2:4]) / focal
    xy = goal * (1.0 + 0.0 * camera[0]) if start is None else start * (1.0 + 0.0 * goal)
    for _ in range(_STEPS if np.any(camera[4:] != 0) or start is not None else 0):
        seen, by_xy = _distort(xy, camera[4:])
        with np.errstate(all="ignore"):
            step = (_inverse2(by_xy) @ (goal - seen)[..., None])[..., 0]
        xy = xy + step
        if not np.any(np.abs(step) > _REACHED):
            break
    seen, by_xy = _distort(xy, camera[4:])
    with np.errstate(all="ignore"):
        back = _inverse2(focal[:, None] * by_xy)
        lost = ~(np.max(np.abs((seen - goal) * focal), axis=1) < 1e-6)
    return PinholeRays(np.where(lost[:, None], np.nan, xy), np.where(lost[:, None, None], np.nan, back))


def _distort(xy: Array, k: Array) -> tuple[Array, Array]:
    """Distorted coordinates (N, 2), and by the ideal ones (N, 2, 2)."""
    bent, by_xy, _ = _bent(xy, k)
    if k[TAU_X] == 0 and k[TAU_Y] == 0:
        return bent, by_xy
    h = _tilt_matrix(k[TAU_X], k[TAU_Y])[0]
    tilted, by_bent = _by_homography(bent, h)
    return tilted, by_bent @ by_xy


@dataclass(frozen=True, eq=False)
class _Radial:
    """Powers of the radius, the radial factor and its denominator."""

    powers: tuple[Array, Array, Array]
    factor: Array
    bottom: Array


def _bent(xy: Array, k: Array) -> tuple[Array, Array, _Radial]:
    """Coordinates (N, 2) before the tilt, by the ideal ones (N, 2, 2)."""
    x, y = xy[:, 0], xy[:, 1]
    r2 = x * x + y * y
    r4 = r2 * r2
    r6 = r2 * r4
    top, bottom = 1 + k[K1] * r2 + k[K2] * r4 + k[K3] * r6, 1 + k[K4] * r2 + k[K5] * r4 + k[K6] * r6
    radial = top / bottom
    d_top = k[K1] + 2 * k[K2] * r2 + 3 * k[K3] * r4
    d_bottom = k[K4] + 2 * k[K5] * r2 + 3 * k[K6] * r4
    slope = 2 * (d_top - radial * d_bottom) / bottom  # ∂radial/∂x = slope · x
    bent = np.empty((len(xy), 2), dtype=radial.dtype)
    bent[:, 0] = x * radial + 2 * k[P1] * x * y + k[P2] * (r2 + 2 * x * x) + k[S1] * r2 + k[S2] * r4
    bent[:, 1] = y * radial + k[P1] * (r2 + 2 * y * y) + 2 * k[P2] * x * y + k[S3] * r2 + k[S4] * r4
    by_xy = np.empty((len(xy), 2, 2), dtype=radial.dtype)
    px, py = 2 * k[S1] + 4 * k[S2] * r2, 2 * k[S3] + 4 * k[S4] * r2
    both = slope * x * y + 2 * k[P1] * x + 2 * k[P2] * y
    by_xy[:, 0, 0] = radial + slope * x * x + 2 * k[P1] * y + 6 * k[P2] * x + px * x
    by_xy[:, 0, 1] = both + px * y
    by_xy[:, 1, 0] = both + py * x
    by_xy[:, 1, 1] = radial + slope * y * y + 6 * k[P1] * y + 2 * k[P2] * x + py * y
    return bent, by_xy, _Radial((r2, r4, r6), radial, bottom)


def _distort_by_terms(xy: Array, k: Array) -> tuple[Array, Array, Array]:
    """As ``_distort``, and by the 14 terms (N, 2, 14)."""
    bent, by_xy, radial = _bent(xy, k)
    x, y = xy[:, 0], xy[:, 1]
    r2, r4, _ = radial.powers
    by_k = np.zeros((len(xy), 2, len(TERMS)), dtype=bent.dtype)
    for up, down, power in zip((K1, K2, K3), (K4, K5, K6), radial.powers, strict=True):
        by_k[:, :, up] = xy * (power / radial.bottom)[:, None]
        by_k[:, :, down] = -xy * (radial.factor * power / radial.bottom)[:, None]
    by_k[:, 0, P1] = by_k[:, 1, P2] = 2 * x * y
    by_k[:, 0, P2], by_k[:, 1, P1] = r2 + 2 * x * x, r2 + 2 * y * y
    by_k[:, 0, S1], by_k[:, 0, S2], by_k[:, 1, S3], by_k[:, 1, S4] = r2, r4, r2, r4
    tilted, by_bent, by_tau = _tilt(bent, k[TAU_X], k[TAU_Y])
    by_k = by_bent @ by_k
    by_k[:, :, TAU_X:] = by_tau
    return tilted, by_bent @ by_xy, by_k


def _tilt_matrix(tau_x: float, tau_y: float) -> tuple[Array, tuple[Array, Array]]:
    """OpenCV's tilted chip as a homography (3, 3), and its derivatives by (τx, τy)."""
    (sx, sy), (cx, cy) = np.sin([tau_x, tau_y]), np.cos([tau_x, tau_y])
    one, zero = 1.0 + 0 * sx, 0 * sx
    r = np.array([[cy, sy * sx, -sy * cx], [zero, cx, sx], [sy, -cy * sx, cy * cx]])
    shear = np.array([[r[2, 2], zero, -r[0, 2]], [zero, r[2, 2], -r[1, 2]], [zero, zero, one]])
    dr_x = np.array([[zero, sy * cx, sy * sx], [zero, -sx, cx], [zero, -cy * cx, -cy * sx]])
    dr_y = np.array([[-sy, cy * sx, -cy * cx], [zero, zero, zero], [cy, sy * sx, -sy * cx]])
    by = []
    for dr in (dr_x, dr_y):
        d_shear = np.array([[dr[2, 2], zero, -dr[0, 2]], [zero, dr[2, 2], -dr[1, 2]], [zero, zero, zero]])
        by.append(d_shear @ r + shear @ dr)
    return shear @ r, (by[0], by[1])


def _by_homography(xy: Array, h: Array) -> tuple[Array, Array]:
    """Points (N, 2) taken through a homography, and by the points (N, 2, 2)."""
    w = xy @ h[2, :2] + h[2, 2]
    out = (xy @ h[:2, :2].T + h[:2, 2]) / w[:, None]
    return out, (h[:2, :2] - out[:, :, None] * h[2, :2]) / w[:, None, None]


def _tilt(xy: Array, tau_x: float, tau_y: float) -> tuple[Array, Array, Array]:
    """The tilted chip's points (N, 2), with Jacobians by the point and by (τx, τy)."""
    h, by_angle = _tilt_matrix(tau_x, tau_y)
    out, by_point = _by_homography(xy, h)
    p = np.concatenate([xy, np.ones((len(xy), 1))], 1)
    w = p @ h[2]
    by_tau = [(p @ dh[:2].T - out * (p @ dh[2])[:, None]) / w[:, None] for dh in by_angle]
    return out, by_point, np.stack(by_tau, -1)


def _inverse2(m: Array) -> Array:
    det = m[:, 0, 0] * m[:, 1, 1] - m[:, 0, 1] * m[:, 1, 0]
    out = np.stack([np.stack([m[:, 1, 1], -m[:, 0, 1]], -1), np.stack([-m[:, 1, 0], m[:, 0, 0]], -1)], 1)
    return np.asarray(out / det[:, None, None])
