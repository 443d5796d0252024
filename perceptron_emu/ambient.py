"""Room light: the scene as the camera sees it without the laser."""

from __future__ import annotations

from functools import lru_cache

import cv2
import numpy as np
from numba import njit
from numpy.typing import NDArray

from geometry import SensorModel
from perceptron_emu.bodies import body_of
from perceptron_emu.config import EmulatorConfig
from perceptron_emu.optics import sharp_sigma_px, working_f_number
from perceptron_emu.projection import to_camera
from perceptron_emu.scene import Material, Scene
from perceptron_emu.strings import Cylinders
from perceptron_emu.transport import Light

Array = NDArray[np.float64]
Float32 = NDArray[np.float32]

LEVELS = 32767.0  # grey steps of a white surface
NEAR_MM = 5.0  # what is nearer to the camera than this is not drawn


def ambient_electrons(
    scene: Scene, strings: Cylinders | None, material: Material, config: EmulatorConfig, light: Light
) -> Float32:
    """Mean electrons (H, W) that the room's light brings, passed through the interference filter.

    A surface of albedo ρ under the irradiance E Δλ (directional part by Lambert's cosine, the rest from everywhere,
    no shadows) has the radiance L = ρ E Δλ/π; on the chip it gives π L T cos⁴α/(4 F²) (1 + m)⁻².
    """
    sensor = scene.sensor
    triangles, level = _faces(scene, strings, material, config)
    camera = to_camera(sensor, triangles)
    shape = (sensor.height_px, sensor.width_px)
    if len(camera) == 0:
        return np.zeros(shape, np.float32)
    inverse_depth, image = np.zeros(shape, np.float32), np.zeros(shape, np.uint16)
    keep = camera[..., 2].max(1) > NEAR_MM
    intrinsics = (sensor.fx_px, sensor.fy_px, sensor.cx_px, sensor.cy_px)
    camera, level = _clip_near(camera[keep], level[keep])
    # 16-bit levels: OpenCV blurs them three times as fast as floats, and a step is far below an electron
    steps = np.round(level * LEVELS).astype(np.uint16)
    _rasterise(image, inverse_depth, camera, steps, *intrinsics)
    if any(sensor.distortion):
        image = cv2.remap(image, *_distortion_maps(sensor), cv2.INTER_LINEAR)  # type: ignore[assignment]
    sigma = sharp_sigma_px(config.optics, sensor, config.laser.wavelength_nm)
    image = cv2.GaussianBlur(image, (0, 0), sigma)  # type: ignore[assignment]
    return image * _electrons_per_irradiance(config, sensor, light)


def _faces(scene: Scene, strings: Cylinders | None, material: Material, config: EmulatorConfig) -> tuple[Array, Array]:
    """All triangles (T, 3, 3) in {P} and the light that each sends back, in units of the irradiance."""
    camera = scene.sensor.camera_centre_mm
    towards = -np.array(config.ambient.direction) / np.linalg.norm(config.ambient.direction)
    fill = config.ambient.fill
    triangles, levels = [np.zeros((0, 3, 3))], [np.zeros(0)]
    for solid in scene.solids:
        pose = solid.T_sensor_mesh
        t = body_of(solid).triangles @ pose.R.T + pose.t
        normal = np.cross(t[:, 1] - t[:, 0], t[:, 2] - t[:, 0])
        normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-300)
        normal *= np.where(np.sum(normal * (camera - t[:, 0]), 1) < 0, -1, 1)[:, None]
        triangles.append(t)
        albedo = solid.material.diffuse + solid.material.specular * 0.5
        levels.append(albedo * (fill + (1 - fill) * np.maximum(normal @ towards, 0)))
    if strings is not None:
        ends = strings.starts, strings.starts + strings.lengths[:, None] * strings.directions
        side = np.cross(strings.directions, camera - strings.starts)
        side *= strings.radius / np.linalg.norm(side, axis=1, keepdims=True)
        quad = [ends[0] - side, ends[1] - side, ends[1] + side, ends[0] + side]
        triangles += [np.stack([quad[i] for i in three], 1) for three in ((0, 1, 2), (0, 2, 3))]
        levels += [np.full(len(side), material.diffuse * (fill + (1 - fill) * 0.6))] * 2
    return np.concatenate(triangles), np.concatenate(levels)


def _electrons_per_irradiance(config: EmulatorConfig, sensor: SensorModel, light: Light) -> Float32:
    """Electrons (H, W) of a perfect white surface that faces the light."""
    optics, ambient = config.optics, config.ambient
    wavelength = optics.filter_centre_nm or config.laser.wavelength_nm
    band_mw_mm2 = ambient.irradiance_mw_m2_nm * 1e-6 * optics.filter_fwhm_nm * optics.filter_peak * optics.transmission
    chip = band_mw_mm2 / (4 * working_f_number(optics, sensor) ** 2) * (optics.pixel_um * 1e-3) ** 2
    return np.float32(chip / LEVELS * light.electrons_per_mw(wavelength)) * _vignette(sensor, optics.vignetting)


@lru_cache(maxsize=8)
def _vignette(sensor: SensorModel, on: bool) -> Float32:
    x = (np.arange(sensor.width_px, dtype=np.float32) - sensor.cx_px) / sensor.fx_px
    y = (np.arange(sensor.height_px, dtype=np.float32)[:, None] - sensor.cy_px) / sensor.fy_px
    return np.asarray((1 + x * x + y * y) ** -2 if on else np.ones((1, 1)), np.float32)


@lru_cache(maxsize=4)
def _distortion_maps(sensor: SensorModel) -> tuple[Float32, Float32]:
    """For every pixel of the distorted image the place in the pinhole image."""
    u, v = np.meshgrid(np.arange(sensor.width_px, dtype=np.float64), np.arange(sensor.height_px, dtype=np.float64))
    pixels = np.stack([u.ravel(), v.ravel()], -1)[:, None]
    ideal = cv2.undistortPoints(pixels, sensor.camera_matrix, sensor.distortion14, P=sensor.camera_matrix)[:, 0]
    maps = ideal.astype(np.float32).reshape(sensor.height_px, sensor.width_px, 2)
    return np.ascontiguousarray(maps[..., 0]), np.ascontiguousarray(maps[..., 1])


def _clip_near(camera: Array, level: Array) -> tuple[Array, Array]:
    """Triangles (T, 3, 3) of the camera frame cut at the near plane, and their levels."""
    behind = camera[..., 2] < NEAR_MM
    whole = ~np.any(behind, 1)
    out, levels = [camera[whole]], [level[whole]]
    for corners, value in zip(camera[~whole], level[~whole], strict=True):
        polygon = []
        for a, b in zip(corners, np.roll(corners, -1, 0), strict=True):
            if a[2] >= NEAR_MM:
                polygon.append(a)
            if (a[2] >= NEAR_MM) != (b[2] >= NEAR_MM):
                polygon.append(a + (NEAR_MM - a[2]) / (b[2] - a[2]) * (b - a))
        fan = [[polygon[0], polygon[i], polygon[i + 1]] for i in range(1, len(polygon) - 1)]
        out.append(np.array(fan).reshape(-1, 3, 3))
        levels.append(np.full(len(fan), value))
    return np.concatenate(out), np.concatenate(levels)


@njit(cache=True, error_model="numpy", fastmath=True)
def _rasterise(image, inverse_depth, camera, level, fx, fy, cx, cy):  # type: ignore[no-untyped-def]
    """Nearest triangle of every pixel's centre; 1/z is linear in the image."""
    height, width = image.shape
    for t in range(len(camera)):
        c = camera[t]
        u0, v0 = fx * c[0, 0] / c[0, 2] + cx, fy * c[0, 1] / c[0, 2] + cy
        u1, v1 = fx * c[1, 0] / c[1, 2] + cx, fy * c[1, 1] / c[1, 2] + cy
        u2, v2 = fx * c[2, 0] / c[2, 2] + cx, fy * c[2, 1] / c[2, 2] + cy
        area = (u1 - u0) * (v2 - v0) - (u2 - u0) * (v1 - v0)
        if abs(area) < 1e-9:
            continue
        low, high = int(max(np.ceil(min(v0, v1, v2)), 0.0)), int(min(np.floor(max(v0, v1, v2)), height - 1.0))
        w0, w1, w2 = 1 / c[0, 2] / area, 1 / c[1, 2] / area, 1 / c[2, 2] / area
        for j in range(low, high + 1):
            left, right = 1e30, -1e30
            for a, b, p, q in ((u0, v0, u1, v1), (u1, v1, u2, v2), (u2, v2, u0, v0)):
                if (b <= j) != (q <= j):
                    cut = a + (j - b) * (p - a) / (q - b)
                    left, right = min(left, cut), max(right, cut)
            first, last = int(max(np.ceil(left), 0.0)), int(min(np.floor(right), width - 1.0))
            if first > last:
                continue
            a0 = (u1 - first) * (v2 - j) - (u2 - first) * (v1 - j)
            a1 = (u2 - first) * (v0 - j) - (u0 - first) * (v2 - j)
            inverse = a0 * w0 + a1 * w1 + (area - a0 - a1) * w2
            step = (v1 - v2) * w0 + (v2 - v0) * w1 + (v0 - v1) * w2
            for i in range(first, last + 1):
                if inverse > inverse_depth[j, i]:
                    inverse_depth[j, i] = inverse
                    image[j, i] = level[t]
                inverse += step
