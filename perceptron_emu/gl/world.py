"""A scene as OpenGL meshes, and its depth and identity maps from any pinhole view."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from geometry import Pose
from perceptron_emu.gl.context import draw_gl, load_pyrender
from perceptron_emu.light import Cylinders
from perceptron_emu.scene import Scene

if TYPE_CHECKING:
    import trimesh

Array = NDArray[np.float64]

STRING_SIDES = 48  # a string's outline misses the circle by 2e-3 of its radius: 0.0003 mm
FROM_GL = np.diag([1.0, -1.0, -1.0, 1.0])  # OpenGL's cameras look along −z with y up
NEAREST_MM = 1.0  # of a view's near plane: OpenGL's must not be 0


@dataclass(frozen=True, eq=False)
class GlView:
    """A pinhole view.

    Parameters
    ----------
    T_sensor_view : Pose
        Its axes (x right, y down, z forward) in {P}.
    intrinsics : tuple of float
        fx, fy, cx, cy [px], (0, 0) the centre of the first pixel.
    width, height : int
        [px].
    """

    T_sensor_view: Pose
    intrinsics: tuple[float, float, float, float]
    width: int
    height: int


@dataclass(frozen=True, eq=False)
class GlWorld:
    """meshes: pyrender's scene. identity: colour of each node. corners: of all boxes (N, 3) [mm] in {P}."""

    meshes: Any
    identity: dict[Any, tuple[int, int, int]]
    corners: Array


def gl_world(scene: Scene, strings: Cylinders | None) -> GlWorld:
    """Strings and solids as OpenGL's meshes in {P}.

    Parameters
    ----------
    scene : Scene
        Its solids are numbered S + 1 ….
    strings : Cylinders or None
        Numbered 1 … S.

    Returns
    -------
    GlWorld
        For `depth_and_identity`.
    """
    pyrender = load_pyrender()

    meshes = pyrender.Scene()
    bodies = [*_tubes(strings), *((s.mesh, s.T_sensor_mesh.matrix) for s in scene.solids)]
    identity, corners = {}, []
    for number, (mesh, pose) in enumerate(bodies, start=1):
        node = meshes.add(pyrender.Mesh.from_trimesh(two_sided(mesh), smooth=False), pose=pose)
        identity[node] = (number % 256, number // 256, 0)
        corners.append(mesh.bounding_box.vertices @ pose[:3, :3].T + pose[:3, 3])
    return GlWorld(meshes, identity, np.concatenate(corners) if corners else np.zeros((0, 3)))


def depth_and_identity(world: GlWorld, view: GlView) -> tuple[Array, NDArray[np.int64]]:
    """Depth along the view's axis and number of the body behind every pixel's centre.

    Parameters
    ----------
    world : GlWorld
        As made by `gl_world`.
    view : GlView
        Whence.

    Returns
    -------
    depth : Array
        (H, W) [mm], 0 where there is nothing.
    number : NDArray
        (H, W), 0 where there is nothing.
    """
    pyrender = load_pyrender()

    fx, fy, cx, cy = view.intrinsics
    depth = ((world.corners - view.T_sensor_view.t) @ view.T_sensor_view.R)[:, 2]
    # a depth buffer spends its bits near its near plane: 1 µm at 50 … 2000 mm, 0.1 µm at 400 … 900 mm
    near, far = max(NEAREST_MM, 0.95 * float(depth.min())), 1.05 * max(float(depth.max()), 2 * NEAREST_MM)
    camera = pyrender.IntrinsicsCamera(fx, fy, cx + 0.5, cy + 0.5, near, far)
    node = world.meshes.add(camera, pose=view.T_sensor_view.matrix @ FROM_GL)
    flags = pyrender.RenderFlags.SEG | pyrender.RenderFlags.SKIP_CULL_FACES
    try:
        colour, z = draw_gl(world.meshes, view.width, view.height, flags, world.identity)
    finally:
        world.meshes.remove_node(node)
    number = colour[..., 0].astype(np.int64) + 256 * colour[..., 1].astype(np.int64)
    return z.astype(float), np.where(z > 0, number, 0)


def two_sided(mesh: trimesh.Trimesh) -> trimesh.Trimesh:
    """The mesh with each face's reverse beside it: OpenGL leaves out the backs whatever pyrender's flags say."""
    import trimesh  # a quarter of a second, and most commands build no mesh

    return trimesh.Trimesh(mesh.vertices, np.vstack([mesh.faces, mesh.faces[:, ::-1]]), process=False)


def back_project(view: GlView, depth: Array) -> Array:
    """Points (H, W, 3) [mm] in {P} behind the pixels of a depth map (H, W)."""
    fx, fy, cx, cy = view.intrinsics
    x = (np.arange(view.width) - cx) / fx
    y = (np.arange(view.height)[:, None] - cy) / fy
    rays = np.stack(np.broadcast_arrays(x, y, 1.0), -1)
    return np.asarray((rays * depth[..., None]) @ view.T_sensor_view.R.T + view.T_sensor_view.t)


def _tubes(strings: Cylinders | None) -> list[tuple[trimesh.Trimesh, Array]]:
    if strings is None:
        return []
    import trimesh

    out = []
    for start, direction, length in zip(strings.starts, strings.directions, strings.lengths, strict=True):
        # the polygon's mean radius over its corners' is sin(π/n)/(π/n): made up for, so that the width is right
        radius = strings.radius * (np.pi / STRING_SIDES) / np.sin(np.pi / STRING_SIDES)
        segment = np.stack([start, start + length * direction])
        out.append((trimesh.creation.cylinder(radius, segment=segment, sections=STRING_SIDES), np.eye(4)))
    return out
