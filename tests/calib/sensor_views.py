"""Emulated boards with the stripe on them as numbers, by OpenCV's projection and plain geometry."""

from __future__ import annotations

import cv2
import numpy as np

from calib.sensor import BoardView, Corners, Stripe
from geometry import exp_so3

SIZE = (1280, 1024)
NAMES = ("fx", "fy", "cx", "cy")


def true_camera(rng: np.random.Generator, tilted: bool) -> np.ndarray:
    """A lens (18,) as makers build them, the chip upright or tilted by 1° to 10°."""
    camera = np.zeros(18)
    f = rng.uniform(2200, 2400)
    camera[:4] = f, f * rng.normal(1, 1e-3), 639.5 + rng.normal(0, 12), 511.5 + rng.normal(0, 12)
    camera[4], camera[5] = rng.uniform(-0.25, -0.08), rng.uniform(0.0, 0.3)
    camera[6:8] = rng.normal(0, 1e-3, 2)
    if tilted:
        tilt, way = np.deg2rad(rng.uniform(1, 10)), rng.uniform(0, 2 * np.pi)
        camera[16:] = tilt * np.cos(way), tilt * np.sin(way)
    return camera


def true_plane() -> tuple[np.ndarray, float]:
    """Normal (3,) and distance of a laser plane that cuts the field of view in depth."""
    normal = np.array([0.05, 0.92, 0.38]) / np.linalg.norm([0.05, 0.92, 0.38])
    return normal, float(normal @ [0, 0, 290.0])


def _project(camera: np.ndarray, R: np.ndarray, t: np.ndarray, xy: np.ndarray) -> np.ndarray:
    K = np.array([[camera[0], 0, camera[2]], [0, camera[1], camera[3]], [0, 0, 1.0]])
    points = np.column_stack([xy, np.zeros(len(xy))])
    return cv2.projectPoints(points, cv2.Rodrigues(R)[0], t, K, camera[4:])[0][:, 0]


def made_views(
    rng: np.random.Generator,
    camera: np.ndarray,
    count: int = 14,
    corner_px: float = 0.03,
    stripe_px: float = 0.03,
    tilt: float = 0.6,
    step: int = 6,
) -> list[BoardView]:
    """Views of a board of 9 × 6 corners, its stripe along the crossing of the two planes."""
    normal, distance = true_plane()
    grid = 10.0 * np.stack(np.meshgrid(np.arange(9), np.arange(6)), -1).reshape(-1, 2)
    views = []
    for k in range(count):
        a, b = rng.uniform(-tilt, tilt, 2) if tilt > 0 else (0.1, 0.2)
        turn = exp_so3(np.array([0, 0, rng.uniform(-3, 3)]))
        R = exp_so3(np.array([a, b, 0.0])) @ turn
        centre = np.array([rng.uniform(-35, 35), rng.uniform(-20, 20), rng.uniform(260, 320)])
        t = centre - R @ [40, 25, 0.0]
        uv = _project(camera, R, t, grid)
        uv = uv + corner_px * rng.standard_normal(uv.shape)
        covariance = np.broadcast_to(np.eye(2) * max(corner_px, 1e-3) ** 2, (54, 2, 2)).copy()
        views.append(
            BoardView(
                f"{k:03d}", Corners(grid, uv, covariance), _stripe(rng, camera, R, t, normal, distance, stripe_px, step)
            )
        )
    return views


def _stripe(rng, camera, R, t, normal, distance, sigma, step) -> Stripe:
    across, reach = (R.T @ normal)[:2], distance - normal @ t
    along = np.array([-across[1], across[0]]) / np.hypot(*across)
    xy = across * reach / (across @ across) + np.linspace(-90, 90, 901)[:, None] * along
    xy = xy[np.all((xy > -8) & (xy < [88, 58]), axis=1)][::step]
    if len(xy) < 20:
        return Stripe.nothing()
    uv = _project(camera, R, t, xy)
    tangent = np.gradient(uv, axis=0)
    n = np.column_stack([-tangent[:, 1], tangent[:, 0]]) / np.linalg.norm(tangent, axis=1)[:, None]
    return Stripe(uv + n * (sigma * rng.standard_normal(len(uv)))[:, None], n, np.full(len(uv), max(sigma, 1e-3)))
