"""Where the light falls: stripe against the exact line, and both renderers against each other.

Run: python benchmarks/perceptron_emu_accuracy.py. The exact line is the plane's intersection with the sheet, projected
by cv2.projectPoints. The peers are pyrender's depth buffers, shaded in float (skipped where there is no OpenGL).
"""

from __future__ import annotations

import cv2
import numpy as np

from geometry import Camera, Pose, Sensor, Sheet, nearest_rotation
from jig_cad import Jig
from perceptron_emu import EmulatorConfig, Scene, mean_electrons, panel, render
from perceptron_emu.gl import gl_problem, light_scene_gl
from perceptron_emu.image import draw

TILTED = (-0.11, 0.06, 4e-4, -3e-4, 0.01, 0.02, -0.01, 0.004, 2e-4, -1e-4, 3e-4, 1e-4, 0.03, -0.05)
COLUMNS = np.arange(250, 1000)


def main() -> None:
    """Print bias and scatter of everything that can be compared."""
    config = EmulatorConfig().off("noise", "speckle", "ambient")
    rng = np.random.default_rng(7)
    print("stripe on tilted planes against the exact line [px]      bias      scatter")
    for name, distortion in (("pinhole", ()), ("14 terms, tilted chip", TILTED)):
        errors = [stripe_error(sensor_with(distortion), tilted_plane(rng), config) for _ in range(8)]
        worst = max(abs(float(np.mean(e))) for e in errors)
        print(f"  {name:48s} {worst:9.6f} {max(float(np.std(e)) for e in errors):9.6f}  (worst of {len(errors)})")
    if (problem := gl_problem()) is not None:
        print(f"pyrender skipped: {problem}")
        return
    sensor, plane = sensor_with(()), Pose.from_fixed_xyz_deg([12, 15, 4], [0, 0, 300])
    scene = Scene(sensor, solids=(panel(400, 400, plane),))
    apart = centroids(gl_electrons(scene, config)) - centroids(mean_electrons(scene, config))
    print(f"ours against pyrender, plane                       {abs(np.mean(apart)):9.6f} {np.std(apart):9.6f}")
    worst = max(strings_apart(sensor, rng, config) for _ in range(4))
    print(f"ours against pyrender, strings, largest            {worst:9.6f}")


def sensor_with(distortion: tuple[float, ...]) -> Sensor:
    """The nominal sensor with the given distortion."""
    tilt = np.deg2rad(22.5)
    rotation = nearest_rotation([[0, -np.cos(tilt), -np.sin(tilt)], [1, 0, 0], [0, -np.sin(tilt), np.cos(tilt)]])
    pose = Pose(rotation, np.array([120.0, 0, 0]))
    camera = Camera(1280, 1024, 2300.0, 2300.0, 639.5, 511.5, pose, distortion)
    return Sensor(Sheet(fan_rad=np.deg2rad(44.0)), camera)


def tilted_plane(rng: np.random.Generator) -> Pose:
    """A panel somewhere in the field of view, tilted up to 25 degrees."""
    return Pose.from_fixed_xyz_deg(rng.uniform(-25, 25, 3), [0, 0, rng.uniform(270, 330)])


def stripe_error(sensor: Sensor, plane: Pose, config: EmulatorConfig) -> np.ndarray:
    """Centroid of the stripe less the exact line, by column [px]."""
    image = mean_electrons(Scene(sensor, solids=(panel(500, 500, plane),)), config)
    normal, y = plane.R[:, 2], np.linspace(-75, 75, 6001)
    z = plane.t[2] - (normal[1] * (y - plane.t[1]) - normal[0] * plane.t[0]) / normal[2]
    inverse = sensor.camera.T_sensor_camera.inverse()
    points = np.column_stack([np.zeros_like(y), y, z])
    line, _ = cv2.projectPoints(
        points, cv2.Rodrigues(inverse.R)[0], inverse.t, sensor.camera.matrix, sensor.camera.distortion14
    )
    return centroids(image) - np.interp(COLUMNS, line[:, 0, 0], line[:, 0, 1])


def centroids(image: np.ndarray) -> np.ndarray:
    """Centroid of every column's light [px]."""
    part = image[:, COLUMNS].astype(float)
    return (np.arange(len(part))[:, None] * part).sum(0) / part.sum(0)


def gl_electrons(scene: Scene, config: EmulatorConfig) -> np.ndarray:
    """Mean electrons of a scene whose light pyrender has found."""
    out = np.zeros((scene.sensor.camera.height_px, scene.sensor.camera.width_px), np.float32)
    draw(out, light_scene_gl(scene, config).samples, scene.sensor, config, 0)
    return out


def strings_apart(sensor: Sensor, rng: np.random.Generator, config: EmulatorConfig) -> float:
    """Largest distance of a string's centroid between the two renderers at a random pose [px]."""
    turn = Pose.from_fixed_xyz_deg(rng.uniform([-12, -25, -25], [12, 25, 25]), np.zeros(3)).R
    scene = Scene(sensor, Jig.nominal(), Pose(turn, np.array([0, 0, 325.0]) - turn @ [50.0, 0, 40]))
    own, gl = render(scene, config).truth.strings, render(scene, config, renderer="pyrender").truth.strings
    pairs = zip(own, gl, strict=True)
    return max(float(np.linalg.norm(a.image_px - b.image_px)) for a, b in pairs if a.visible_fraction > 0.99)


if __name__ == "__main__":
    main()
