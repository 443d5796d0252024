"""Room light: the scene as the camera sees it without the laser."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache

import cv2
import numpy as np
from numpy.typing import NDArray

from geometry import Sensor
from perceptron_emu.config import EmulatorConfig
from perceptron_emu.image.blurred import PixelPlaces, draw_blurred, gaussian_taps
from perceptron_emu.image.level_cells import Boxes, fill, levels, sources
from perceptron_emu.lens import sharp_sigma_px, to_camera, working_f_number
from perceptron_emu.light import Cylinders, Light
from perceptron_emu.scene import Material, Scene
from perceptron_emu.solids import body_of, rasterise

Array = NDArray[np.float64]
Float32 = NDArray[np.float32]

LEVEL_DECIMALS = 6  # of a face's radiance: faces of one plane stay alike whatever rounding made of their normals
NEAR_MM = 5.0  # what is nearer to the camera than this is not drawn
BLUR_REACH = 3.0  # σ of the blur that its kernel takes in
# room light is coarse on purpose: it is there to be told from the laser's, not to be measured
SIDE_LIT = 0.6  # about the mean cosine of light from the camera's side on a cylinder, 2/π
GLOSS_SEEN = 0.5  # part of the glossy reflectance that sends room light to the camera
MAX_VIEW = 4.0  # image sizes: farther out a lens's distortion shows nothing


def ambient_electrons(scene: Scene, strings: Cylinders | None, material: Material, config: EmulatorConfig) -> Float32:
    """Mean electrons that the room's light brings, passed through the interference filter.

    A surface of albedo ρ under the irradiance E Δλ (directional part by Lambert's cosine, the rest from everywhere,
    no shadows) has the radiance L = ρ E Δλ/π; on the chip it gives π L T cos⁴α/(4 F²) (1 + m)⁻².

    Parameters
    ----------
    scene : Scene
        A sensor with a camera, and solids.
    strings : Cylinders or None
        The jig's, where there is one.
    material : Material
        The strings'.
    config : EmulatorConfig
        Its room light and lens.

    Returns
    -------
    Float32
        (H, W) [e⁻].
    """
    sensor = scene.sensor
    facets, level = _facets(scene, strings, material, config)
    seen = to_camera(sensor, facets)
    keep = seen[..., 2].max(1, initial=0.0) > NEAR_MM
    seen, level = _clip_near(seen[keep], level[keep])
    sigma = sharp_sigma_px(config.optics, sensor, config.laser.wavelength_nm)
    view = _view(sensor, math.ceil(BLUR_REACH * sigma))
    camera = sensor.require_camera()
    intrinsics = (camera.fx_px, camera.fy_px, camera.cx_px - view.left, camera.cy_px - view.top)
    picture, box = rasterise(seen, np.round(level, LEVEL_DECIMALS).astype(np.float32), view.shape, intrinsics)
    shown, several = levels(picture, box, view.boxes)
    of_white = _electrons_of_white(config, sensor)
    electrons = np.zeros(camera.shape, np.float32)
    fill(electrons, shown, several, of_white)
    draw_blurred(electrons, picture, view.places, several, gaussian_taps(sigma, view.reach_px), of_white)
    return electrons


def _facets(scene: Scene, strings: Cylinders | None, material: Material, config: EmulatorConfig) -> tuple[Array, Array]:
    """All flat faces (F, 4, 3) in {P} and the light that each sends back, in units of the irradiance."""
    camera = scene.camera.centre_mm
    towards = -np.array(config.ambient.direction) / np.linalg.norm(config.ambient.direction)
    fill = config.ambient.fill
    facets, levels = [np.zeros((0, 4, 3))], [np.zeros(0)]
    for solid in scene.solids:
        pose, body = solid.T_sensor_mesh, body_of(solid)
        above = np.einsum("ij,ij->i", body.facing, pose.R.T @ (camera - pose.t) - body.facets[:, 0])
        seen = above > 0 if body.closed else np.ones(len(above), dtype=bool)
        facets.append((body.facets[seen].reshape(-1, 3) @ pose.R.T + pose.t).reshape(-1, 4, 3))
        towards_light = np.where(above[seen] < 0, -1, 1) * (body.facing[seen] @ (pose.R.T @ towards))
        albedo = solid.material.diffuse + solid.material.specular * GLOSS_SEEN
        levels.append(albedo * (fill + (1 - fill) * np.maximum(towards_light, 0)))
    if strings is not None:
        ends = strings.starts, strings.starts + strings.lengths[:, None] * strings.directions
        side = np.cross(strings.directions, camera - strings.starts)
        side *= strings.radius / np.linalg.norm(side, axis=1, keepdims=True)
        facets.append(np.stack([ends[0] - side, ends[1] - side, ends[1] + side, ends[0] + side], 1))
        levels.append(np.full(len(side), material.diffuse * (fill + (1 - fill) * SIDE_LIT)))
    return np.concatenate(facets), np.concatenate(levels)


@lru_cache(maxsize=8)
def _electrons_of_white(config: EmulatorConfig, sensor: Sensor) -> Float32:
    """Electrons (H, W) that a white surface facing the light brings."""
    optics, ambient = config.optics, config.ambient
    wavelength = optics.filter_centre_nm or config.laser.wavelength_nm
    band_mw_mm2 = ambient.irradiance_mw_m2_nm * 1e-6 * optics.filter_fwhm_nm * optics.filter_peak * optics.transmission
    chip = band_mw_mm2 / (4 * working_f_number(optics, sensor) ** 2) * (optics.pixel_um * 1e-3) ** 2
    per_mw = Light(sensor, config).electrons_per_mw(wavelength)
    return np.float32(chip * per_mw) * _vignette(sensor, optics.vignetting)


@lru_cache(maxsize=8)
def _vignette(sensor: Sensor, on: bool) -> Float32:
    camera = sensor.require_camera()
    x = (np.arange(camera.width_px, dtype=np.float32) - camera.cx_px) / camera.fx_px
    y = (np.arange(camera.height_px, dtype=np.float32)[:, None] - camera.cy_px) / camera.fy_px
    cosine2 = 1 / (1 + x * x + y * y)  # cos⁴α by products: a power's last bits are another processor's others
    return np.asarray(cosine2 * cosine2 if on else np.ones_like(cosine2), np.float32)


@dataclass(frozen=True, eq=False)
class _LensView:
    """From the part of the pinhole image that the lens shows to the image.

    left, top: where that part begins in the pinhole image, shape: its rows and columns. places: of the
    image's pixels in it. boxes: what the image's cells see of it within the blur's reach_px.
    """

    left: int
    top: int
    shape: tuple[int, int]
    places: PixelPlaces
    boxes: Boxes
    reach_px: int


@lru_cache(maxsize=4)
def _view(sensor: Sensor, reach_px: int) -> _LensView:
    camera = sensor.require_camera()
    u, v = np.meshgrid(np.arange(camera.width_px, dtype=np.float64), np.arange(camera.height_px, dtype=np.float64))
    pixels: Array = np.stack([u.ravel(), v.ravel()], -1)
    if any(camera.distortion):
        matrix = camera.matrix
        pixels = np.asarray(cv2.undistortPoints(pixels[:, None], matrix, camera.distortion14, P=matrix)[:, 0], float)
    largest = MAX_VIEW * max(camera.width_px, camera.height_px)
    pixels = np.clip(np.nan_to_num(pixels, nan=-largest), -largest, largest)
    left, top = (int(c) for c in np.floor(pixels.min(0)) - 1)
    right, bottom = (int(c) for c in np.ceil(pixels.max(0)) + 1)
    shape = bottom - top + 1, right - left + 1
    maps = (pixels - [left, top]).astype(np.float32).reshape(camera.height_px, camera.width_px, 2)
    along_u, along_v = np.ascontiguousarray(maps[..., 0]), np.ascontiguousarray(maps[..., 1])
    boxes = sources(along_u, along_v, reach_px, shape)
    return _LensView(left, top, shape, PixelPlaces.of(along_u, along_v, shape[1]), boxes, reach_px)


def _clip_near(camera: Array, level: Array) -> tuple[Array, Array]:
    """Flat faces (F, 4, 3) of the camera frame cut at the near plane, and their levels."""
    behind = camera[..., 2] < NEAR_MM
    whole = ~np.any(behind, 1)
    if np.all(whole):
        return camera, level
    out, levels = [camera[whole]], [level[whole]]
    for corners, value in zip(camera[~whole], level[~whole], strict=True):
        polygon = []
        for a, b in zip(corners, np.roll(corners, -1, 0), strict=True):
            if a[2] >= NEAR_MM:
                polygon.append(a)
            if (a[2] >= NEAR_MM) != (b[2] >= NEAR_MM):
                polygon.append(a + (NEAR_MM - a[2]) / (b[2] - a[2]) * (b - a))
        fan = [[polygon[0], polygon[i], polygon[i + 1], polygon[i + 1]] for i in range(1, len(polygon) - 1)]
        out.append(np.array(fan).reshape(-1, 4, 3))
        levels.append(np.full(len(fan), value))
    return np.concatenate(out), np.concatenate(levels)
