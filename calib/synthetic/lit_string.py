"""Where a lit string seems to stand: every patch of it on its own, from camera pixel back to the sheet.

Nothing is shared with the offset that calibration takes off. It does not prove the reflectance of real thread, nor what
a finite aperture does.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from geometry import Sensor

Array = NDArray[np.float64]

WAIST_MM = 0.15
_REACH = 6.0  # of the patches, in waists of the sheet
_ACROSS = np.array([0.3, 0.5, 0.8])  # any direction that no string runs along


def lit_centroids(
    yz_mm: Array,
    directions: Array,
    radius_mm: float,
    sensor: Sensor,
    thread: tuple[float, float, float],
    turns: int = 72,
    steps: int = 25,
) -> Array:
    """What the camera's rays through the spots' centroids meet of the sheet.

    Point emitter, exact pinhole, Gaussian sheet, Lambert beside GGX (Walter et al., 2007).

    Parameters
    ----------
    yz_mm : ndarray (S, 2)
        Where the strings' axes cross the sheet, in {P}.
    directions : ndarray (S, 3)
        Of the strings, of unit length, in {P}.
    radius_mm : float
    sensor : Sensor
        With a camera.
    thread : tuple of float
        Albedo, reflectance at normal incidence, GGX α.
    turns, steps : int
        Patches around a string and along it.

    Returns
    -------
    ndarray (S, 2)
        As (y, z) in {P} [mm].
    """
    camera = sensor.require_camera()
    d = directions[:, None, None]
    e1 = np.cross(directions, _ACROSS)
    e1 = e1 / np.linalg.norm(e1, axis=1, keepdims=True)
    e2 = np.cross(directions, e1)
    phi = np.linspace(0, 2 * np.pi, turns, endpoint=False)[:, None, None]
    normal = np.cos(phi) * e1[:, None, None] + np.sin(phi) * e2[:, None, None]  # (S, turns, 1, 3)
    along = np.linspace(-_REACH, _REACH, steps)[:, None] * (WAIST_MM / np.abs(directions[:, :1]))[:, None, None]
    axis = np.concatenate([np.zeros((len(yz_mm), 1)), yz_mm], axis=1)[:, None, None]
    x = axis + along * d + radius_mm * normal  # (S, turns, steps, 3)
    to_light, to_camera = sensor.sheet.origin_mm - x, camera.centre_mm - x
    square = np.sum(to_camera**2, -1)
    light = to_light / np.linalg.norm(to_light, axis=-1, keepdims=True)
    view = to_camera / np.sqrt(square)[..., None]
    weight = np.exp(-2 * (x[..., 0] / WAIST_MM) ** 2) * _sent(normal, light, view, thread) / square
    seen = (x - camera.centre_mm) @ camera.T_sensor_camera.R
    uv = seen[..., :2] / seen[..., 2:]
    total = np.maximum(weight.sum(axis=(1, 2)), 1e-300)
    middle = np.sum(weight[..., None] * uv, axis=(1, 2)) / total[:, None]
    ray = np.column_stack([middle, np.ones(len(middle))]) @ camera.T_sensor_camera.R.T
    return np.asarray((camera.centre_mm - ray * (camera.centre_mm[0] / ray[:, :1]))[:, 1:])


def _sent(normal: Array, light: Array, view: Array, thread: tuple[float, float, float]) -> Array:
    """Light sent to the camera for a unit of it on a plane across its way, times the patch's foreshortening."""
    albedo, f0, alpha = thread
    nl, nv = np.clip(np.sum(normal * light, -1), 0, None), np.clip(np.sum(normal * view, -1), 0, None)
    half = light + view
    half = half / np.linalg.norm(half, axis=-1, keepdims=True)
    nh = np.sum(normal * half, -1)
    cos2 = np.maximum(nh**2, 1e-12)
    density = np.where(nh > 0, alpha**2 / (np.pi * cos2**2 * (alpha**2 + (1 - cos2) / cos2) ** 2), 0.0)
    fresnel = f0 + (1 - f0) * (1 - np.sum(half * light, -1)) ** 5 if f0 > 0 else 0.0
    masks = [2 / (1 + np.sqrt(1 + alpha**2 * (1 - c**2) / np.maximum(c, 1e-12) ** 2)) for c in (nl, nv)]
    glossy = density * fresnel * masks[0] * masks[1] / np.maximum(4 * nl * nv, 1e-12)
    return np.asarray(nl * nv * (albedo / np.pi + glossy))
