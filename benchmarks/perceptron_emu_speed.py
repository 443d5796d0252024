"""CPU time of a frame beside its peers, and memory over many frames.

Run: python benchmarks/perceptron_emu_speed.py [--frames 1000]. Figures are process times, the smallest of several
runs; peers are run in the same process: a numpy normal draw and quantisation of the same frame, Embree rays through
trimesh for the same picture, pyrender's depth map.
"""

from __future__ import annotations

import argparse
import resource
import time
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import trimesh

from geometry import Camera, Pose, Sensor, Sheet, nearest_rotation
from jig_cad import Jig
from jig_cad.solids import jig_solids
from perceptron_emu import (
    ALUMINIUM,
    BLACK_PLATE,
    EmulatorConfig,
    Material,
    Scene,
    Solid,
    cylinders,
    mean_electrons,
    panel,
    render,
)
from perceptron_emu.gl import GlView, depth_and_identity, gl_problem, gl_world

REPEATS = 25
LENS = (-0.11, 0.06, 4e-4, -3e-4, 0.01, 0.02, -0.01, 0.004, 2e-4, -1e-4, 3e-4, 1e-4, 0.03, -0.05)  # all 14 terms


def main() -> None:
    """Print every time beside its peer's, as milliseconds and as a share of numpy's draw in the same run."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--frames", type=int, default=1000, help="for the memory's growth; the goal speaks of 10,000")
    parser.add_argument("--peers", action="store_true", help="Embree and pyrender too")
    options = parser.parse_args()
    full = EmulatorConfig()
    clean = full.off("noise", "speckle", "ambient")
    bounces = full.model_copy(update={"light": full.light.model_copy(update={"bounces": True})})
    for bits in (8, 12):
        jig, plate, ball = (distorted(s, bits) for s in (example_scene(), plate_scene(), ball_scene()))
        runs: dict[str, Callable[[], object]] = {
            "noise-free, laser light alone": anew(jig, lambda s: mean_electrons(s, clean)),
            "noise-free, with room light": anew(jig, lambda s: mean_electrons(s, full.off("speckle"))),
            "full camera and speckle": anew(jig, lambda s: render(s, full.off("ambient"))),
            "full camera, speckle and room light": anew(jig, lambda s: render(s, full)),
            "the same, light that bounces": anew(jig, lambda s: render(s, bounces)),
            "plate, camera and speckle": anew(plate, lambda s: render(s, full.off("ambient"))),
            "sphere, camera and speckle": anew(ball, lambda s: render(s, full.off("ambient"))),
            "sphere, light that bounces": anew(ball, lambda s: render(s, bounces.off("ambient"))),
        }
        show_all(f"CPU time of a 1280 x 1024 frame of {bits} bits, a new pose each, 14 lens terms", runs)
    if options.peers:
        show("  peer: Embree through trimesh, one ray a pixel", embree(example_scene()), 2)
        if gl_problem() is None:
            show("  peer: pyrender, depth map alone", pyrender_depth(example_scene()), 5)
    print(f"memory: {growth_mb(example_scene(), full, options.frames):.1f} MB more after {options.frames} frames")


def show_all(title: str, runs: dict[str, Callable[[], object]]) -> None:
    """Least process times of runs taken in turn, so that a busy moment meets all alike."""
    runs = {"peer: numpy normal draw and quantise": numpy_noise} | runs
    best = dict.fromkeys(runs, np.inf)
    for repeat in range(1 + REPEATS):
        for name, run in runs.items():
            start = time.process_time()
            run()
            if repeat:  # the first compiles
                best[name] = min(best[name], time.process_time() - start)
    print(title)
    draw = next(iter(best.values()))
    for name, seconds in best.items():
        print(f"  {name:50s} {1e3 * seconds:8.2f} ms  {seconds / draw:.2f} of a draw")


def anew(scene: Scene, run: Callable[[Scene], object]) -> Callable[[], object]:
    """The run on the scene at a new pose every time: nothing kept by pose can help."""
    rng = np.random.default_rng(3)

    def once() -> object:
        step = Pose.exp(np.r_[rng.uniform(-2, 2, 3), rng.uniform(-0.03, 0.03, 3)])
        solids = tuple(replace(s, T_sensor_mesh=step @ s.T_sensor_mesh) for s in scene.solids)
        return run(replace(scene, T_sensor_jig=step @ scene.T_sensor_jig, solids=solids))

    return once


def distorted(scene: Scene, bits: int) -> Scene:
    """The scene before a camera with a distorting lens on a tilted chip."""
    return replace(scene, sensor=scene.sensor.with_camera(distortion=LENS, bit_depth=bits))


def plate_scene() -> Scene:
    """A matte plate under the whole stripe."""
    place = Pose.from_fixed_xyz_deg([5, 5, 90], [0, 0, 305.0])
    return Scene(example_scene().sensor, solids=(panel(170, 80, place, Material(0.6), "plate"),))


def ball_scene() -> Scene:
    """A matte ball of 40 mm on a plate."""
    ball = Solid(trimesh.creation.icosphere(4, 20.0), Material(0.6), Pose(np.eye(3), np.array([3.0, 0, 295.0])), "ball")
    return Scene(example_scene().sensor, solids=(ball, *plate_scene().solids))


def show(name: str, run: Callable[[], object], repeats: int = REPEATS) -> None:
    """Print the least process time of several runs, the first (which compiles) not counted."""
    run()
    best = np.inf
    for _ in range(repeats):
        start = time.process_time()
        run()
        best = min(best, time.process_time() - start)
    print(f"  {name:50s} {1e3 * best:8.1f}")


def example_scene() -> Scene:
    """A jig in view of the nominal sensor, tilted as a plan would have it."""
    tilt = np.deg2rad(22.5)
    rotation = nearest_rotation([[0, -np.cos(tilt), -np.sin(tilt)], [1, 0, 0], [0, -np.sin(tilt), np.cos(tilt)]])
    pose = Pose(rotation, np.array([120.0, 0, 0]))
    camera = Camera(1280, 1024, 2300.0, 2300.0, 639.5, 511.5, pose, black_level=10.0)
    sensor = Sensor(Sheet(fan_rad=np.deg2rad(44.0)), camera)
    jig, turn = Jig.nominal(), Pose.from_fixed_xyz_deg([8, 14, -5], [0, 0, 0]).R
    place = Pose(turn, np.array([0, 0, 300.0]) - turn @ [50.0, 0, 0])
    solids = [
        Solid(mesh, ALUMINIUM if name.startswith("post") else BLACK_PLATE, place, name)
        for name, mesh in jig_solids(jig, strings=False).items()
    ]
    return Scene(sensor, jig, place, tuple(solids))


def numpy_noise() -> object:
    """The least that a camera's noise costs in numpy: one draw for each pixel, rounded and clipped."""
    noise = np.random.default_rng(0).standard_normal((1024, 1280), dtype=np.float32)
    noise *= 0.5
    noise += 10.5
    return np.clip(noise, 0, 255, out=noise).astype(np.uint8)


def embree(scene: Scene) -> Callable[[], object]:
    """A ray for every pixel against the same solids, strings as tubes."""
    strings = cylinders(scene.jig, scene.T_sensor_jig) if scene.jig else None
    parts = [s.mesh.copy().apply_transform(s.T_sensor_mesh.matrix) for s in scene.solids]
    if strings is not None:
        ends = strings.starts + strings.lengths[:, None] * strings.directions
        pairs = zip(strings.starts, ends, strict=True)
        parts += [trimesh.creation.cylinder(strings.radius, segment=np.stack(p)) for p in pairs]
    world, s = trimesh.util.concatenate(parts), scene.camera
    u, v = np.meshgrid(np.arange(s.width_px), np.arange(s.height_px))
    rays = np.stack([(u - s.cx_px) / s.fx_px, (v - s.cy_px) / s.fy_px, np.ones(u.shape)], -1).reshape(-1, 3)
    rays = rays @ s.T_sensor_camera.R.T
    origins = np.broadcast_to(s.centre_mm, rays.shape)
    return lambda: world.ray.intersects_first(origins, rays)  # type: ignore[attr-defined] # a mesh's, says trimesh


def pyrender_depth(scene: Scene) -> Callable[[], object]:
    """The depth map of the same scene by OpenGL, without any light on it."""
    s = scene.camera
    world = gl_world(scene, cylinders(scene.jig, scene.T_sensor_jig) if scene.jig else None)
    view = GlView(s.T_sensor_camera, (s.fx_px, s.fy_px, s.cx_px, s.cy_px), s.width_px, s.height_px)
    return lambda: depth_and_identity(world, view)


def growth_mb(scene: Scene, config: EmulatorConfig, frames: int) -> float:
    """Growth of the process's largest memory [MB] over frames in which the jig wanders, after 30 to warm up."""
    rng = np.random.default_rng(1)
    before = 0
    for k in range(30 + frames):
        if k == 30:
            before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
        step = Pose.exp(np.r_[rng.uniform(-5, 5, 3), rng.uniform(-0.05, 0.05, 3)])
        solids = tuple(replace(s, T_sensor_mesh=step @ s.T_sensor_mesh) for s in scene.solids)
        render(replace(scene, T_sensor_jig=step @ scene.T_sensor_jig, solids=solids), config, rng)
    return (resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before) / 1024


if __name__ == "__main__":
    main()
