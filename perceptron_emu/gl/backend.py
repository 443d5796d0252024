"""The second renderer: depth maps by OpenGL from camera and laser, the stripe shaded on them in float, supersampled."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from geometry import Pose, Sensor
from perceptron_emu.config import EmulatorConfig
from perceptron_emu.gl.world import GlView, GlWorld, back_project, depth_and_identity, gl_world
from perceptron_emu.lens import to_camera
from perceptron_emu.light import (
    SHEET_REACH,
    TILE_PX,
    Light,
    LightNodes,
    LitScene,
    axis_meets_sheet_mm,
    cylinders,
    half_width_mm,
    join,
    light_strings,
    string_group,
    stripe_group,
    thread_of,
)
from perceptron_emu.scene import Scene

Array = NDArray[np.float64]

SUPERSAMPLING = 8  # a 0.3 mm string is then some 14 sub-pixels wide
LASER_COLUMNS, LASER_ROWS = 8192, 128  # 0.03 mm a column at 300 mm, a tenth of a string; the sheet is thin
SHADOW_BIAS_MM = 0.05  # less than a string's radius, more than the depth of a pixel of the laser's map
GRAZING = 0.02  # cosine of the view at which a footprint stops growing: a silhouette's is infinite
STENCIL = 2  # sub-pixels to either side that a normal is taken over
LASER_AXES = np.array([[0.0, -1, 0], [1, 0, 0], [0, 0, 1]])  # columns along y, rows across the sheet


@dataclass(frozen=True, eq=False)
class Shadow:
    """The laser's view and the depth map (H, W) [mm] that it sees, each pixel the farthest of its neighbours."""

    view: GlView
    depth: Array


def light_scene_gl(scene: Scene, config: EmulatorConfig) -> LitScene:
    """What our own light transport gives, found by OpenGL's depth buffers instead of geometry.

    The camera's depth map gives the surface behind every sub-pixel, its neighbours the normal, the laser's map the
    shadow. Every lit sub-pixel is a node with the light of its footprint, dA cos θₒ = Z² cos α/(f_x f_y). Meshes of
    48 sides stand for the strings.

    Parameters
    ----------
    scene : Scene
        A sensor with a camera, and what stands before it.
    config : EmulatorConfig
        Laser, lens, exposure and quantum yield.

    Returns
    -------
    LitScene
        As of `light_scene`.

    Raises
    ------
    MissingDependencyError
        Where OpenGL is not to be had.
    """
    strings = cylinders(scene.jig, scene.T_sensor_jig) if scene.jig else None
    world, light = gl_world(scene, strings), Light(scene.sensor, config)
    shadow, reach = _laser_depth(world, scene.sensor), _reach_mm(scene.sensor, config)
    n = len(strings.labels) if strings else 0
    parts: list[list[LightNodes]] = [[] for _ in range(n + 1 + len(scene.solids))]
    for tile, view in _lit_tiles(world, scene.sensor, reach):
        depth, number = depth_and_identity(world, view)
        xyz, normal = back_project(view, depth), _normals(back_project(view, depth), number)
        lit = (number > 0) & (np.abs(xyz[..., 0]) <= reach) & np.all(np.isfinite(normal), -1)
        lit[lit] = _reached(shadow, xyz[lit])
        for k in np.unique(number[lit]):
            mine = lit & (number == k)
            group = string_group(k - 1) if k <= n else stripe_group(k - 1 - n, *tile)
            material = thread_of(scene, config) if k <= n else scene.solids[k - 1 - n].material
            electrons = light.electrons(xyz[mine], normal[mine], material)
            electrons *= _footprint_mm2(view, scene.sensor, xyz[mine], normal[mine])
            parts[k].append(LightNodes(xyz[mine], electrons, np.full(len(electrons), group)))
    unhidden = np.zeros(0)
    if strings is not None:
        unhidden = light_strings(strings, thread_of(scene, config), scene.sensor, config, light).electrons.sum((1, 2))
    of_strings = tuple(_seen(parts[1 + i]) for i in range(n))
    return LitScene(strings, of_strings, unhidden, _seen([s for p in parts[1 + n :] for s in p]))


def _seen(parts: list[LightNodes]) -> LightNodes:
    whole = join(parts)
    keep = whole.electrons > 0
    return LightNodes(whole.xyz_mm[keep], whole.electrons[keep], whole.group[keep])


def _reach_mm(sensor: Sensor, config: EmulatorConfig) -> float:
    middle = axis_meets_sheet_mm(sensor)
    return float(SHEET_REACH / 2 * half_width_mm(config.laser, sensor, np.array([0.0, middle, 2 * middle])).max())


def _laser_depth(world: GlWorld, sensor: Sensor) -> Shadow:
    focal = LASER_COLUMNS / (2 * np.tan(sensor.sheet.fan_rad / 2))
    pose = Pose(LASER_AXES, np.array(sensor.sheet.origin_mm))
    view = GlView(pose, (focal, focal, (LASER_COLUMNS - 1) / 2, (LASER_ROWS - 1) / 2), LASER_COLUMNS, LASER_ROWS)
    depth, number = depth_and_identity(world, view)
    depth = np.where(number > 0, depth, 1e9)
    return Shadow(view, np.asarray(cv2.dilate(depth, np.ones((3, 3), np.uint8)), float))


def _reached(shadow: Shadow, xyz: Array) -> NDArray[np.bool_]:
    """Whether the laser's light gets to points (N, 3)."""
    p = (xyz - shadow.view.T_sensor_view.t) @ shadow.view.T_sensor_view.R
    fx, fy, cx, cy = shadow.view.intrinsics
    u, v = np.round(fx * p[:, 0] / p[:, 2] + cx).astype(int), np.round(fy * p[:, 1] / p[:, 2] + cy).astype(int)
    inside = (u >= 0) & (u < shadow.view.width) & (p[:, 2] > 0)
    v = np.clip(v, 0, shadow.view.height - 1)
    out = np.zeros(len(xyz), dtype=bool)
    out[inside] = p[inside, 2] <= shadow.depth[v[inside], u[inside]] + SHADOW_BIAS_MM
    return out


def _lit_tiles(world: GlWorld, sensor: Sensor, reach: float) -> list[tuple[tuple[int, int], GlView]]:
    """Supersampled views of the tiles of the pinhole image that show surface within reach of the sheet."""
    camera = sensor.require_camera()
    if not world.identity:
        return []
    margin = TILE_PX
    columns, rows = -(-(camera.width_px + 2 * margin) // TILE_PX), -(-(camera.height_px + 2 * margin) // TILE_PX)
    whole = _view(sensor, -margin, -margin, columns * TILE_PX, rows * TILE_PX, 1)
    depth, number = depth_and_identity(world, whole)
    x = back_project(whole, depth)[..., 0]
    # a pixel's neighbours too: surface steep to the sheet runs through it between two pixels' centres
    low = cv2.erode(np.where(number > 0, x, 1e9), np.ones((5, 5), np.uint8))
    high = cv2.dilate(np.where(number > 0, x, -1e9), np.ones((5, 5), np.uint8))
    hit = ((low <= reach) & (high >= -reach)).reshape(rows, TILE_PX, columns, TILE_PX).any((1, 3))
    return [
        (
            (int(i) - 1, int(j) - 1),
            _view(sensor, i * TILE_PX - margin, j * TILE_PX - margin, TILE_PX, TILE_PX, SUPERSAMPLING),
        )
        for j, i in np.argwhere(hit)
    ]


def _view(sensor: Sensor, u0: int, v0: int, width: int, height: int, q: int) -> GlView:
    """The part of the pinhole image whose first pixel is (u0, v0), each pixel divided into q × q."""
    camera = sensor.require_camera()
    cx, cy = ((c + 0.5 - o) * q - 0.5 for c, o in ((camera.cx_px, u0), (camera.cy_px, v0)))
    return GlView(camera.T_sensor_camera, (camera.fx_px * q, camera.fy_px * q, cx, cy), width * q, height * q)


def _normals(xyz: Array, number: NDArray[np.int64]) -> Array:
    """Unit normals (H, W, 3) by differences between neighbours of the same body, central where both sides have one."""
    tangents = [_difference(xyz, number, axis) for axis in (1, 0)]
    normal = np.cross(tangents[0], tangents[1])
    with np.errstate(invalid="ignore", divide="ignore"):
        return np.asarray(-normal / np.linalg.norm(normal, axis=-1, keepdims=True))


def _difference(xyz: Array, number: NDArray[np.int64], axis: int) -> Array:
    """Tangent (H, W, 3) along the image axis; NaN where the body has no neighbour there."""
    best = np.full(xyz.shape, np.nan)
    centre = np.arange(xyz.shape[axis])
    for step in (1, STENCIL):
        ahead, behind = (np.clip(centre + s, 0, len(centre) - 1) for s in (step, -step))
        shape = [-1 if a == axis else 1 for a in range(2)]
        has_ahead = (np.take(number, ahead, axis) == number) & (ahead != centre).reshape(shape)
        has_behind = (np.take(number, behind, axis) == number) & (behind != centre).reshape(shape)
        to = np.where(has_ahead[..., None], np.take(xyz, ahead, axis), xyz)
        from_ = np.where(has_behind[..., None], np.take(xyz, behind, axis), xyz)
        usable = has_ahead | has_behind if step == 1 else has_ahead & has_behind
        best[usable] = (to - from_)[usable]
    return best


def _footprint_mm2(view: GlView, sensor: Sensor, xyz: Array, normal: Array) -> Array:
    """Surface (N,) [mm²] behind a sub-pixel: Z² cos α/(f_x f_y) over the cosine of the surface's slope to the ray."""
    camera = to_camera(sensor, xyz)
    distance = np.linalg.norm(camera, axis=1)
    towards = (sensor.require_camera().centre_mm - xyz) / distance[:, None]
    slope = np.maximum(np.einsum("ij,ij->i", normal, towards), GRAZING)
    fx, fy = view.intrinsics[:2]
    return np.asarray(camera[:, 2] ** 3 / distance / (fx * fy) / slope)
