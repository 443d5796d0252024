"""The part of the laser sheet that is lit by the fan and seen by the camera, as a polygon.

The lens is inverted here a second time, beside `extraction`, and that is meant: the emulator asks this room how far it
must light and trace, so an inverse shared with extraction would cut image and measurement alike and hide its own
errors. The two also answer differently: here a pixel beyond the lens's fold takes the last ray before it, there it has
none.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from geometry.compiled import kernel
from geometry.errors import InputError
from geometry.sensor.camera import Camera, undistort_near
from geometry.sensor.sensor import Sensor
from geometry.sensor.sheet import Sheet

Array = NDArray[np.float64]

MAX_DISTANCE_MM = 5000.0  # beyond this no line sensor measures; it closes a field of view that is open to the horizon


def field_of_view(sensor: Sensor, margin_px: float = 0.0, samples_per_side: int = 24) -> Array:
    """The field of view in the laser plane.

    Parameters
    ----------
    sensor : Sensor
        With a camera, or with a profile output that states its field of view.
    margin_px : float
        Strip along the image's border that is left out; a profile sensor's polygon stands as its maker gives it.
    samples_per_side : int
        Points along each side of the image.

    Returns
    -------
    Array
        A polygon (N, 2) of (y, z) [mm] in {P}, in order around it.

    Raises
    ------
    InputError
        Where the camera sees nothing of the lit sheet, or a profile sensor states no field of view.
    """
    if sensor.profile is not None:
        return sensor.profile.require_field_of_view()
    camera = sensor.require_camera()
    border = _image_border(camera, margin_px, samples_per_side)
    rays = np.column_stack([_undistort(camera, border), np.ones(len(border))]) @ camera.T_sensor_camera.R.T
    centre = camera.centre_mm
    # homogeneous point of the sheet on each ray: (y, z, 1) · w with w > 0 in front of the camera
    w = -rays[:, 0] / centre[0]
    homogeneous = np.column_stack([centre[1] * w + rays[:, 1], centre[2] * w + rays[:, 2], w])
    polygon = _clip(homogeneous, np.array([0.0, 0.0, 1.0]), 1.0 / MAX_DISTANCE_MM)
    for half_plane in _fan_half_planes(sensor.sheet):
        polygon = _clip(polygon, half_plane, 0.0)
    if len(polygon) < 3:
        raise InputError(
            "the camera sees nothing of the lit laser sheet: check [camera.pose], [camera] and [laser] fan_deg"
        )
    return np.asarray(polygon[:, :2] / polygon[:, 2:])


def inside_polygon(points: Array, polygon: Array) -> NDArray[np.bool_]:
    """Whether each point (..., 2) lies inside the simple polygon (N, 2) (crossing number)."""
    p = np.ascontiguousarray(points, dtype=float)
    return _inside(p.reshape(-1, 2), np.array(polygon, dtype=float, order="C")).reshape(p.shape[:-1])


@kernel
def _inside(points: Array, polygon: Array) -> NDArray[np.bool_]:
    out = np.zeros(len(points), np.bool_)
    for k in range(len(points)):
        x, y, within = points[k, 0], points[k, 1], False
        for i in range(len(polygon)):
            j = i + 1 if i + 1 < len(polygon) else 0
            if (polygon[i, 1] > y) != (polygon[j, 1] > y):
                slope = (polygon[j, 0] - polygon[i, 0]) / (polygon[j, 1] - polygon[i, 1])
                within ^= x < polygon[i, 0] + slope * (y - polygon[i, 1])
        out[k] = within
    return out


def _image_border(c: Camera, margin_px: float, n: int) -> Array:
    if not 0 <= margin_px < min(c.width_px, c.height_px) / 2:
        raise InputError(f"margin_px = {margin_px:g}: must lie between 0 and half of the image's shorter side")
    low, right, bottom = margin_px - 0.5, c.width_px - 0.5 - margin_px, c.height_px - 0.5 - margin_px
    corners = np.array([[low, low], [right, low], [right, bottom], [low, bottom]])
    t = np.arange(n)[:, None] / n
    sides = [a + t * (b - a) for a, b in zip(corners, np.roll(corners, -1, axis=0), strict=True)]
    return np.concatenate(sides)


def _undistort(c: Camera, uv_px: Array) -> Array:
    """Normalised image coordinates (N, 2) of distorted pixels, followed outwards from the image's centre.

    Where the lens model folds back before it reaches a pixel, no ray belongs to that pixel: the last one before the
    fold, in the same direction, is returned.
    """
    goal = (uv_px - [c.cx_px, c.cy_px]) / [c.fx_px, c.fy_px]
    if not any(c.distortion):
        return goal
    xy, reached, step = np.zeros_like(goal), np.zeros(len(goal)), np.full(len(goal), 1 / 8)
    while np.any(todo := (reached < 1) & (step > 1e-6)):
        t = np.minimum(reached[todo] + step[todo], 1.0)
        found, good = undistort_near(xy[todo], t[:, None] * goal[todo], c.distortion14)
        index = np.flatnonzero(todo)
        xy[index[good]], reached[index[good]] = found[good], t[good]
        step[index[~good]] /= 2
    return xy


def _fan_half_planes(sheet: Sheet) -> list[Array]:
    """Half-planes n · (y, z, 1) ≥ 0 whose intersection is the fan."""
    half = sheet.fan_rad / 2
    out = []
    for sign in (-1.0, 1.0):
        n = np.array([sign * np.cos(half), np.sin(half)])
        out.append(np.array([*n, -n @ sheet.origin_mm[1:]]))
    return [*out, np.array([0.0, 1.0, -sheet.origin_mm[2]])]


def _clip(polygon: Array, n: Array, limit: float) -> Array:
    """Sutherland-Hodgman: the part of the homogeneous polygon (N, 3) with n · p ≥ limit."""
    if len(polygon) == 0:
        return polygon
    d = polygon @ n - limit
    out: list[Array] = []
    for i, p in enumerate(polygon):
        j = (i + 1) % len(polygon)
        if d[i] >= 0:
            out.append(p)
        if (d[i] >= 0) != (d[j] >= 0):
            t = d[i] / (d[i] - d[j])
            out.append(p + t * (polygon[j] - p))
    return np.array(out).reshape(-1, 3)
