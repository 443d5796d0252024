"""The camera's lens, inverted: distorted pixels → rays, by Newton on OpenCV's 14-term model with analytic Jacobian."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from geometry import Sensor

Array = NDArray[np.float64]

CONVERGED = 1e-13  # largest last step on the normalised image plane
ATOL_NORMALISED = 1e-12  # largest residual of the forward model there: about 2e-9 px at f = 2000 px
MAX_STEPS = 40  # Newton doubles its digits a step: beyond ten there is no root


@dataclass(frozen=True, eq=False)
class Rays:
    """Ideal pinhole rays (x, y, 1) of distorted pixels.

    xy: normalised coordinates (N, 2), NaN where the model has no inverse on the branch of the image centre.
    jacobian: d(xy)/d(uv) (N, 2, 2) [1/px].
    """

    xy: Array
    jacobian: Array


def undistort(sensor: Sensor, uv_px: Array) -> Rays:
    """Ideal rays of distorted pixels: what `cv2.projectPoints` does, inverted.

    Parameters
    ----------
    sensor
        A sensor with a camera.
    uv_px
        Pixels (N, 2).

    Returns
    -------
    rays
        Directions (x, y, 1) in the camera's frame with their Jacobian, exact to rounding; NaN outside the branch of the
        model that holds the image's centre.

    Raises
    ------
    InputError
        Where the sensor has no camera.
    """
    camera = sensor.require_camera()
    focal = np.array([camera.fx_px, camera.fy_px])
    seen = (np.asarray(uv_px, dtype=float) - [camera.cx_px, camera.cy_px]) / focal
    if not any(camera.distortion):
        return Rays(seen, np.broadcast_to(np.diag(1 / focal), (len(seen), 2, 2)).copy())
    k = camera.distortion14
    with np.errstate(all="ignore"):  # pixels outside the model's domain run to NaN and are reported as such
        unbend = np.asarray(np.linalg.inv(_tilt(k[12], k[13])), dtype=float)
        flat, flat_by_seen = _projective(unbend, seen)
        xy, inverse = _solve(flat, k)
        jacobian = inverse @ (flat_by_seen / focal)
        valid = np.all(np.isfinite(jacobian), axis=(1, 2))
    xy[~valid], jacobian[~valid] = np.nan, np.nan
    return Rays(xy, jacobian)


def _solve(goal: Array, k: Array) -> tuple[Array, Array]:
    """Newton's root of lens(xy) = goal (N, 2) and d(xy)/d(goal); NaN where it is not on the centre's branch."""
    xy = goal.copy()
    for _ in range(MAX_STEPS):
        bent, j = _lens(xy, k)
        step = (_inverse2(j) @ (goal - bent)[..., None])[..., 0]
        xy += step
        moving = np.max(np.abs(step), axis=1, initial=0.0) > CONVERGED * (1 + np.abs(xy).max(axis=1, initial=0.0))
        if not np.any(moving):
            break
    bent, j = _lens(xy, k)
    good = np.max(np.abs(bent - goal), axis=1, initial=0.0) <= ATOL_NORMALISED * (
        1 + np.abs(goal).max(axis=1, initial=0)
    )
    for t in (0.25, 0.5, 0.75, 1.0):  # a fold between the centre and the root means another branch
        good &= np.linalg.det(_lens(t * xy, k)[1]) > 0
    xy[~good] = np.nan
    return xy, _inverse2(j)


def _lens(xy: Array, k: Array) -> tuple[Array, Array]:
    """Radial, tangential and thin-prism terms on normalised coordinates (N, 2), with their Jacobian (N, 2, 2)."""
    x, y = xy[:, 0], xy[:, 1]
    r2 = x * x + y * y
    top = 1 + r2 * (k[0] + r2 * (k[1] + r2 * k[4]))
    bottom = 1 + r2 * (k[5] + r2 * (k[6] + r2 * k[7]))
    radial = top / bottom
    slope = (k[0] + r2 * (2 * k[1] + 3 * r2 * k[4]) - radial * (k[5] + r2 * (2 * k[6] + 3 * r2 * k[7]))) / bottom
    px, py = k[8] + 2 * r2 * k[9], k[10] + 2 * r2 * k[11]  # d(prism)/d(r²)
    bent = np.column_stack(
        [
            x * radial + 2 * k[2] * x * y + k[3] * (r2 + 2 * x * x) + r2 * (k[8] + r2 * k[9]),
            y * radial + k[2] * (r2 + 2 * y * y) + 2 * k[3] * x * y + r2 * (k[10] + r2 * k[11]),
        ]
    )
    j = np.empty((len(x), 2, 2))
    j[:, 0, 0] = radial + 2 * x * x * slope + 2 * k[2] * y + 6 * k[3] * x + 2 * x * px
    j[:, 0, 1] = 2 * x * y * slope + 2 * k[2] * x + 2 * k[3] * y + 2 * y * px
    j[:, 1, 0] = 2 * x * y * slope + 2 * k[2] * x + 2 * k[3] * y + 2 * x * py
    j[:, 1, 1] = radial + 2 * y * y * slope + 6 * k[2] * y + 2 * k[3] * x + 2 * y * py
    return bent, j


def _tilt(tau_x: float, tau_y: float) -> Array:
    """Homography (3, 3) of a chip tilted by τx, then τy [rad] (OpenCV's Scheimpflug model)."""
    (sx, sy), (cx, cy) = np.sin([tau_x, tau_y]), np.cos([tau_x, tau_y])
    about_x = np.array([[1, 0, 0], [0, cx, sx], [0, -sx, cx]])
    about_y = np.array([[cy, 0, -sy], [0, 1, 0], [sy, 0, cy]])
    r = about_y @ about_x
    return np.asarray(np.array([[r[2, 2], 0, -r[0, 2]], [0, r[2, 2], -r[1, 2]], [0, 0, 1]]) @ r)


def _projective(h: Array, xy: Array) -> tuple[Array, Array]:
    """The homography ``h`` (3, 3) of points (N, 2), with its Jacobian (N, 2, 2)."""
    w = xy @ h[2, :2] + h[2, 2]
    out = (xy @ h[:2, :2].T + h[:2, 2]) / w[:, None]
    return out, (h[:2, :2] - out[:, :, None] * h[2, :2]) / w[:, None, None]


def _inverse2(m: Array) -> Array:
    """Inverse of matrices (N, 2, 2) in closed form; infinite where singular."""
    det = m[:, 0, 0] * m[:, 1, 1] - m[:, 0, 1] * m[:, 1, 0]
    out = np.empty_like(m)
    out[:, 0, 0], out[:, 1, 1] = m[:, 1, 1] / det, m[:, 0, 0] / det
    out[:, 0, 1], out[:, 1, 0] = -m[:, 0, 1] / det, -m[:, 1, 0] / det
    return out
