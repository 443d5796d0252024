"""Room light: the scene as the camera sees it without the laser."""

from __future__ import annotations

import math
from dataclasses import replace
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from geometry import Sensor
from geometry.compiled import kernel
from perceptron_emu.config import EmulatorConfig
from perceptron_emu.image.deposit import gaussian_taps
from perceptron_emu.image.face_cells import Outlines, draw_cells, face_edges, faces_in_cells, pixel_cells
from perceptron_emu.image.ghosts import GLOSS_SEEN, lamp_electrons
from perceptron_emu.lens import sharp_sigma_px, working_f_number
from perceptron_emu.light import Cylinders, Light
from perceptron_emu.scene import Material, Scene
from perceptron_emu.solids import FlatFaces, body_of

Array = NDArray[np.float64]
Float32 = NDArray[np.float32]

LEVELS = 1e6  # steps of a face's radiance: faces of one plane stay alike whatever rounding made of their normals
NEAR_MM = 5.0  # what is nearer to the camera than this is not drawn
BLUR_REACH = 3.0  # σ of the blur that its kernel takes in
# room light is coarse on purpose: it is there to be told from the laser's, not to be measured
SIDE_LIT = 0.6  # about the mean cosine of light from the camera's side on a cylinder, 2/π


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
    if config.ambient.samples > 1:
        return _by_parts(scene, strings, material, config)
    sensor, camera = scene.sensor, scene.camera
    faces = _before_camera(_outlines(scene, strings, material, config))
    sigma = sharp_sigma_px(config.optics, sensor, config.laser.wavelength_nm)
    reach = math.ceil(BLUR_REACH * sigma)
    edges, cells = face_edges(faces, (camera.fx_px, camera.fy_px)), pixel_cells(sensor, reach)
    electrons = np.zeros(camera.shape, np.float32)
    lists = faces_in_cells(cells, edges)
    taps, of_white = gaussian_taps(sigma, reach), _electrons_of_white(config, sensor)
    draw_cells(cells, edges, lists, taps, of_white, electrons)
    lamp = lamp_electrons(scene, config, of_white) if config.ambient.shadows else None
    if lamp is not None:
        threads = 0 if strings is None else len(strings.labels)
        before = np.zeros(len(edges.level), np.float32)
        before[len(before) - threads :] = 1  # strings come last, one face each
        cover = np.zeros(camera.shape, np.float32)
        draw_cells(cells, edges._replace(level=before), lists, taps, np.ones_like(cover), cover)
        electrons += lamp * (1 - cover)
    return electrons


def _by_parts(scene: Scene, strings: Cylinders | None, material: Material, config: EmulatorConfig) -> Float32:
    """The sums of what smaller pixels see in every pixel."""
    n, optics = config.ambient.samples, config.optics
    finer = {"pixel_um": optics.pixel_um / n, "blur_px": optics.blur_px * n}
    once = config.ambient.model_copy(update={"samples": 1})
    fine = config.model_copy(update={"ambient": once, "optics": optics.model_copy(update=finer)})
    parts = ambient_electrons(replace(scene, sensor=_finer(scene.sensor, n)), strings, material, fine)
    across = parts[:, ::n].copy()
    for k in range(1, n):  # one order on every machine
        across += parts[:, k::n]
    total = across[::n].copy()
    for k in range(1, n):
        total += across[k::n]
    return total


@lru_cache(maxsize=8)
def _finer(sensor: Sensor, n: int) -> Sensor:
    """The sensor with every pixel cut into n × n."""
    camera = sensor.require_camera()
    return replace(
        sensor,
        uncertainty=None,
        direct=None,
        camera=replace(
            camera,
            width_px=n * camera.width_px,
            height_px=n * camera.height_px,
            fx_px=n * camera.fx_px,
            fy_px=n * camera.fy_px,
            cx_px=n * (camera.cx_px + 0.5) - 0.5,
            cy_px=n * (camera.cy_px + 0.5) - 0.5,
        ),
    )


def _outlines(scene: Scene, strings: Cylinders | None, material: Material, config: EmulatorConfig) -> Outlines:
    """All flat faces that turn to the camera, and the light that each sends back, in units of the irradiance."""
    towards = -np.array(config.ambient.direction) / np.linalg.norm(config.ambient.direction)
    bodies, fill = [body_of(solid) for solid in scene.solids], config.ambient.fill
    threads = 0 if strings is None else len(strings.labels)
    count = sum(len(body.flat.facing) for body in bodies) + threads
    room = Outlines(
        np.zeros(count + 1, np.int64),
        np.empty((sum(len(body.flat.ends) for body in bodies) + 4 * threads, 2, 3)),
        np.empty((count, 3)),
        np.empty(count, np.float32),
    )
    n, view = 0, scene.camera.T_sensor_camera
    for solid, body in zip(scene.solids, bodies, strict=True):
        albedo = solid.material.diffuse + solid.material.specular * GLOSS_SEEN
        R = solid.T_sensor_mesh.R
        direct = 0.0 if config.ambient.shadows else albedo * (1 - fill)
        lamp = _Lamp(R.T @ towards, albedo * fill, direct)
        t = view.R.T @ (solid.T_sensor_mesh.t - view.t)
        n = _add_body(room, n, body.flat, body.closed, (np.ascontiguousarray(view.R.T @ R), t), lamp)
    if strings is not None:
        ends = strings.starts, strings.starts + strings.lengths[:, None] * strings.directions
        level = np.float32(material.diffuse * (fill + (1 - fill) * SIDE_LIT))
        starts, stops = ((p - view.t) @ view.R for p in ends)
        n = _add_strings(room, n, starts, stops, strings.radius, level)
    return Outlines(room.begin[: n + 1], room.ends[: room.begin[n]], room.normal[:n], room.level[:n])


class _Lamp(NamedTuple):
    """Room light on a body: the unit way to the lamp in its axes, what it sends back of the light from everywhere, and
    of the lamp's.
    """

    towards: Array
    fill: float
    direct: float


@kernel
def _add_body(room: Outlines, n: int, flat: FlatFaces, closed: bool, place: tuple[Array, Array], lamp: _Lamp) -> int:
    """Put those faces of a body that turn to the camera behind the first n; how many there are then.

    place: rotation and translation from the body's axes to the camera's.
    """
    R, t = place
    eye = np.empty(3)
    for a in range(3):
        eye[a] = -(R[0, a] * t[0] + R[1, a] * t[1] + R[2, a] * t[2])
    for f in range(len(flat.facing)):
        normal, first = flat.facing[f], flat.ends[flat.begin[f], 0]
        above = 0.0
        for a in range(3):
            above += normal[a] * (eye[a] - first[a])
        if closed and not above > 0:
            continue
        cosine = normal[0] * lamp.towards[0] + normal[1] * lamp.towards[1] + normal[2] * lamp.towards[2]
        level = lamp.fill + lamp.direct * max(-cosine if above < 0 else cosine, 0.0)
        room.level[n] = math.floor(level * LEVELS + 0.5) / LEVELS
        begin = room.begin[n]
        for e in range(flat.begin[f], flat.begin[f + 1]):
            for k in range(2):
                p = flat.ends[e, k]
                for a in range(3):
                    room.ends[begin, k, a] = R[a, 0] * p[0] + R[a, 1] * p[1] + R[a, 2] * p[2] + t[a]
            begin += 1
        for a in range(3):
            room.normal[n, a] = R[a, 0] * normal[0] + R[a, 1] * normal[1] + R[a, 2] * normal[2]
        room.begin[n + 1] = begin
        n += 1
    return n


@kernel
def _add_strings(room: Outlines, n: int, starts: Array, stops: Array, radius: float, level: np.float32) -> int:
    """Put strings behind the first n faces, each a strip across the camera's view, which is at 0."""
    corners, side = np.empty((4, 3)), np.empty(3)
    for s in range(len(starts)):
        p, q = starts[s], stops[s]
        side[0], side[1], side[2] = q[2] * p[1] - q[1] * p[2], q[0] * p[2] - q[2] * p[0], q[1] * p[0] - q[0] * p[1]
        size = max(math.sqrt(side[0] * side[0] + side[1] * side[1] + side[2] * side[2]), 1e-12)
        for a in range(3):
            across, along = side[a] * (radius / size), q[a] - p[a]
            corners[0, a], corners[1, a] = p[a] - across, q[a] - across
            corners[2, a], corners[3, a] = q[a] + across, p[a] + across
            room.normal[n, a] = along
        begin = room.begin[n]
        for k in range(4):
            for a in range(3):
                room.ends[begin + k, 0, a], room.ends[begin + k, 1, a] = corners[k, a], corners[(k + 1) % 4, a]
        d, u = room.normal[n].copy(), side / size
        room.normal[n, 0], room.normal[n, 1] = d[1] * u[2] - d[2] * u[1], d[2] * u[0] - d[0] * u[2]
        room.normal[n, 2] = d[0] * u[1] - d[1] * u[0]
        room.begin[n + 1], room.level[n] = begin + 4, level
        n += 1
    return n


def _before_camera(faces: Outlines) -> Outlines:
    """The faces cut at the near plane."""
    if len(faces.ends) == 0 or np.min(faces.ends[..., 2]) >= NEAR_MM:
        return faces
    begin, ends, normal, level = [0], [], [], []
    for f in range(len(faces.level)):
        own = faces.ends[faces.begin[f] : faces.begin[f + 1]]
        depth = own[..., 2]
        share = ((NEAR_MM - depth[:, 0]) / np.where(depth[:, 0] == depth[:, 1], 1.0, depth[:, 1] - depth[:, 0]))[
            :, None
        ]
        met = own[:, 0] + share * (own[:, 1] - own[:, 0])
        kept = np.where((depth < NEAR_MM)[..., None], met[:, None], own)[np.any(depth >= NEAR_MM, 1)]
        met = met[(depth[:, 0] < NEAR_MM) != (depth[:, 1] < NEAR_MM)]
        along = np.cross(faces.normal[f], [0.0, 0.0, 1.0])  # the cut's line, on which the rim goes in and out by turns
        met = met[np.argsort(met @ along, kind="stable")]
        if len(kept):
            ends.append(np.concatenate([kept, met[: len(met) // 2 * 2].reshape(-1, 2, 3)]))
            begin.append(begin[-1] + len(ends[-1]))
            normal.append(faces.normal[f])
            level.append(faces.level[f])
    if not ends:
        return Outlines(np.zeros(1, np.int64), np.empty((0, 2, 3)), np.empty((0, 3)), np.empty(0, np.float32))
    return Outlines(np.array(begin), np.concatenate(ends), np.array(normal), np.array(level, np.float32))


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
