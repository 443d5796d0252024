"""Light scattered twice against a path tracer: ten scenes, ours and Mitsuba 3's at depth 3 less depth 2.

    python benchmarks/perceptron_emu_bounces.py [--particles 2e7] [--scenes 1 4] [--mitsuba-python PYTHON]
        [--pictures DIR] [--traced DIR]

Mitsuba (pip install mitsuba) is an oracle of this script alone; PYTHON is an interpreter that has it, by default this
one. It traces particles from a projector through the same triangles, with the same normals at their corners and the
same BRDFs. One factor between its light and ours is found from a plain matte plate lit once and used for all scenes.
Its mirror reflects alike at any angle, where ours follows Schlick's approximation: glossy surfaces that are met at
grazing angles send on more light here. Ghosts are compared where no light comes straight. "place" is the difference of
their centroids, over all and, where a ghost is a line, across.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

HALF_FAN = 0.16  # tangent of half the fan
ALONG, ACROSS = 2048, 33  # the projector's bitmap
WAIST_MM, AT_MM = 0.23, 300.0
WIDTH, HEIGHT, FOCAL = 640, 512, 1150.0
BLOCK = 32  # px, of the squares whose light is compared
BLUR_PX = 0.9  # σ of the lens: the emulator's default
RESULT = "traced: "


def main() -> None:
    """Compare, or trace as the worker of a comparison."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--particles", type=float, default=2e7)
    parser.add_argument("--scenes", type=int, nargs="*")
    parser.add_argument("--mitsuba-python", default=sys.executable)
    parser.add_argument("--pictures", type=Path)
    parser.add_argument("--traced", type=Path, help="folder that keeps the tracer's images, and has them the next time")
    parser.add_argument("--worker", action="store_true", help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.worker:
        return trace_all(options.particles)
    return compare(options)


def compare(options: argparse.Namespace) -> None:
    """Print each scene's differences."""
    from perceptron_emu import EmulatorConfig, mean_electrons

    dark = {"laser": {"profile": "uniform", "divergence": False, "waist_um": 1e3 * WAIST_MM, "power_mw": 400.0}}
    optics = {"optics": {"blur_px": BLUR_PX, "vignetting": False, "filter_fwhm_nm": 1000.0, "diffraction": False}}
    once = EmulatorConfig.model_validate(dark | optics).off("noise", "speckle", "ambient")
    twice = once.model_copy(update={"light": once.light.model_copy(update={"bounces": True})})
    names = ["plain plate", *SCENES]
    chosen = [0, *(options.scenes or range(1, len(names)))]
    scenes = {names[k]: make_scene(names[k]) for k in chosen}
    with tempfile.TemporaryDirectory() as folder:
        theirs = ask(scenes, options.traced or Path(folder), options)
    factor = 0.0
    for name, scene in scenes.items():
        direct, both = (mean_electrons(scene, c).astype(float) for c in (once, twice))
        times = [cpu_s(partial(mean_electrons, scene, c)) for c in (once, twice)]
        first, second = theirs[name]["direct"], theirs[name]["ghost"]
        if name == "plain plate":
            factor = direct.sum() / first.sum()
            print(f"one factor for all, from the plain plate: {factor:.4g}")
            continue
        report(name, direct, both - direct, first * factor, [g * factor for g in second], times)
        if options.pictures:
            picture(options.pictures, name, both - direct, np.mean(second, 0) * factor)


def report(
    name: str, direct: np.ndarray, ghost: np.ndarray, first: np.ndarray, second: list[np.ndarray], times: list[float]
) -> None:
    """Print one scene's differences and Mitsuba's own noise."""
    # theirs is blurred as ours is: light beside the line that the sheet draws leaks over the border of what is compared
    first, second = blurred(first), [blurred(g) for g in second]
    # where no light comes straight: there the tracer's own noise of that light is not in the difference
    clear = direct == 0
    total = (direct.sum() + ghost.sum()) / (first.sum() + np.mean(second, 0).sum()) - 1
    ghost, second = ghost * clear, [g * clear for g in second]
    them = np.mean(second, 0)
    # from block to block: a single difference of two sums may be small by chance, and rare bright paths make it small
    noise = np.sqrt(np.sum(block_sums(second[0] - second[1]) ** 2)) / 2 / them.sum()
    places = [centroid(g) for g in (ghost, them, *second)]
    off, own = places[0] - places[1], (places[2] - places[3]) / 2
    blocks = [block_sums(g) for g in (ghost, them)]
    bright = blocks[1] > 0.05 * blocks[1].max()
    spread = np.sqrt(np.mean((blocks[0][bright] / blocks[1][bright] - 1) ** 2))
    line = line_shift(ghost, them)
    print(
        f"{name:28s} ghost/direct {ghost.sum() / direct.sum():.4f} (theirs {them.sum() / first.sum():.4f}, its own "
        f"noise {noise:.4f})"
        f"  light {ghost.sum() / them.sum() - 1:+.3f}  total {total:+.4f}  place {off[0]:+.3f} {off[1]:+.3f} px "
        f"(± {np.abs(own).max():.3f})  line {line:.3f} px  blocks {spread:.3f}  CPU {1e3 * times[0]:.1f} -> "
        f"{1e3 * times[1]:.1f} ms"
    )


def blurred(image: np.ndarray) -> np.ndarray:
    """The lens's Gaussian, which the tracer has not."""
    import cv2

    return cv2.GaussianBlur(image, (0, 0), BLUR_PX)


def centroid(image: np.ndarray) -> np.ndarray:
    """(u, v) of all light."""
    rows, columns = np.mgrid[: image.shape[0], : image.shape[1]]
    return np.array([(image * columns).sum(), (image * rows).sum()]) / image.sum()


def line_shift(ours: np.ndarray, theirs: np.ndarray, half: int = 6) -> float:
    """Median shift across the ghost's own ridge [px], in rows and columns where it is a line; NaN where it is none."""
    import cv2

    smooth = cv2.GaussianBlur(theirs, (0, 0), 1.5)
    shifts = []
    for axis in (0, 1):
        a, b, s = (np.moveaxis(i, axis, 0) for i in (ours, theirs, smooth))
        at = s.argmax(0)
        for c in range(8, s.shape[1] - 8, 8):
            k = int(at[c])
            if s[k, c] < 0.2 * smooth.max() or not half < k < len(s) - half - 1:
                continue
            window = slice(k - half, k + half + 1)
            if max(s[k - half, c], s[k + half, c]) > 0.3 * s[k, c]:
                continue  # no line across here
            weight = np.arange(-half, half + 1)[:, None]
            parts = [i[window, c - 4 : c + 4] for i in (a, b)]
            shifts.append(float(np.subtract(*((p * weight).sum() / p.sum() for p in parts))))
    return float(np.median(np.abs(shifts))) if len(shifts) > 2 else float("nan")


def block_sums(image: np.ndarray) -> np.ndarray:
    """Light of squares of BLOCK px."""
    return image.reshape(HEIGHT // BLOCK, BLOCK, WIDTH // BLOCK, BLOCK).sum((1, 3))


def cpu_s(run: Callable[[], object]) -> float:
    """The least process time of several runs."""
    best = np.inf
    for _ in range(5):
        start = time.process_time()
        run()
        best = min(best, time.process_time() - start)
    return float(best)


def picture(folder: Path, name: str, ours: np.ndarray, theirs: np.ndarray) -> None:
    """Ours beside theirs, by the square root."""
    import cv2

    both = np.hstack([ours, cv2.GaussianBlur(theirs, (0, 0), 0.94)])
    grey = np.sqrt(np.clip(both / np.percentile(ours, 99.9), 0, 1)) * 255
    folder.mkdir(parents=True, exist_ok=True)
    cv2.imwrite(str(folder / f"{name.replace(' ', '_').replace(',', '')}.png"), grey.astype(np.uint8))


def make_scene(name: str) -> Any:
    """One of the scenes before a small sensor."""
    from geometry import Camera, Pose, Sensor, Sheet, nearest_rotation
    from perceptron_emu import Scene

    tilt = np.deg2rad(22.5)
    rotation = nearest_rotation([[0, -np.cos(tilt), -np.sin(tilt)], [1, 0, 0], [0, -np.sin(tilt), np.cos(tilt)]])
    pose = Pose(rotation, np.array([120.0, 0, 0]))
    camera = Camera(WIDTH, HEIGHT, FOCAL, FOCAL, (WIDTH - 1) / 2, (HEIGHT - 1) / 2, pose)
    sensor = Sensor(Sheet(fan_rad=2 * float(np.arctan(HALF_FAN))), camera)
    if name == "jig":
        from dataclasses import replace

        from jig_cad import Jig
        from jig_cad.solids import jig_solids
        from perceptron_emu import ALUMINIUM, BLACK_PLATE, Solid

        jig, turn = Jig.nominal(), Pose.from_fixed_xyz_deg([8, 14, -5], [0, 0, 0]).R
        place = Pose(turn, np.array([0, 0, 300.0]) - turn @ [50.0, 0, 0])
        solids = [
            Solid(mesh, ALUMINIUM if part.startswith("post") else replace(BLACK_PLATE, diffuse=0.3), place, part)
            for part, mesh in jig_solids(jig, strings=False).items()
        ]
        return Scene(sensor, solids=tuple(solids))
    return Scene(sensor, solids=tuple(SCENES[name]() if name in SCENES else plate(("matte", 0.6))))


def material(kind: tuple[Any, ...]) -> Any:
    """("matte", albedo) or (diffuse, specular, roughness)."""
    from perceptron_emu import Material

    return Material(kind[1]) if kind[0] == "matte" else Material(*kind)


def plate(kind: tuple[Any, ...], z: float = 310.0, turn: tuple[float, float, float] = (0, 0, 0)) -> list[Any]:
    """A panel across the sheet."""
    from geometry import Pose
    from perceptron_emu import panel

    return [panel(160, 80, Pose.from_fixed_xyz_deg([turn[0], turn[1], 90 + turn[2]], [0, 0, z]), material(kind))]


def groove(kind: tuple[Any, ...], half_angle: float = 45.0) -> list[Any]:
    """Two panels that meet in a valley along x."""
    from geometry import Pose
    from perceptron_emu import panel

    out = []
    for sign in (-1, 1):
        pose = Pose.from_fixed_xyz_deg([sign * (90 - half_angle), 0, 0], [0, 0, 0])
        out.append(panel(60, 25, Pose(pose.R, np.array([0, 0, 310.0]) - pose.R @ [0, sign * 12.5, 0]), material(kind)))
    return out


def post(kind: tuple[Any, ...], wall: tuple[Any, ...], y: float = 8.0) -> list[Any]:
    """A round post along x before a plate."""
    import trimesh

    from geometry import Pose
    from perceptron_emu import Solid

    mesh = trimesh.creation.cylinder(4.0, 60.0, sections=96)
    return [
        Solid(mesh, material(kind), Pose.from_fixed_xyz_deg([0, 90, 0], [0, y, 297.0]), "post"),
        *plate(wall, 312.0, (0, 4, 0)),
    ]


def sphere(kind: tuple[Any, ...], wall: tuple[Any, ...]) -> list[Any]:
    """A ball on a plate."""
    import trimesh

    from geometry import Pose
    from perceptron_emu import Solid

    mesh = trimesh.creation.icosphere(subdivisions=5, radius=12.0)
    return [Solid(mesh, material(kind), Pose(np.eye(3), np.array([2.0, -3.0, 298.0])), "ball"), *plate(wall, 310.0)]


def gap(kind: tuple[Any, ...]) -> list[Any]:
    """Two panels with rounded edges."""
    from geometry import Pose
    from perceptron_emu.solids import PanelPair

    pair = PanelPair(5.0, 1.0, (2.0, 1.5))
    return list(pair.solids(Pose(np.eye(3), np.array([0, 1.0, 300.0])), material(kind)))


METAL, POLISHED, PAINT, MATTE = (0.1, 0.85, 0.2), (0.05, 0.9, 0.06), (0.5, 0.05, 0.2), ("matte", 0.6)
SCENES: dict[str, Callable[[], list[Any]]] = {
    "V-groove, aluminium": lambda: groove(METAL),
    "V-groove, matte": lambda: groove(MATTE),
    "V-groove, polished": lambda: groove(POLISHED, 52.0),
    "post, aluminium, plate": lambda: post(METAL, MATTE),
    "post, matte, metal plate": lambda: post(MATTE, METAL),
    "post, polished, plate": lambda: post(POLISHED, MATTE),
    "sphere, matte, metal plate": lambda: sphere(MATTE, (0.1, 0.85, 0.1)),
    "sphere, metal, plate": lambda: sphere(METAL, MATTE),
    "panels of a gap, paint": lambda: gap(PAINT),
    "jig": list,
}


def ask(scenes: dict[str, Any], folder: Path, options: argparse.Namespace) -> dict[str, Any]:
    """Mitsuba's images of the scenes: once scattered, and two of what was scattered twice."""
    from perceptron_emu.solids import body_of

    request, files = {}, {name: folder / f"{name.replace(' ', '_').replace(',', '')}_traced.npz" for name in scenes}
    folder.mkdir(parents=True, exist_ok=True)
    for number, (name, scene) in enumerate(scenes.items()):
        if files[name].exists():
            continue
        parts = []
        for k, solid in enumerate(scene.solids):
            file, body, pose = folder / f"{number}_{k}.npz", body_of(solid), solid.T_sensor_mesh
            vertices, normals = pose @ body.triangles.reshape(-1, 3), body.normals.reshape(-1, 3) @ pose.R.T
            np.savez(file, vertices=vertices, normals=normals)
            m = solid.material
            parts.append({"file": str(file), "material": [m.diffuse, m.specular, m.roughness]})
        camera = scene.camera.T_sensor_camera.matrix.tolist()
        request[name] = {"parts": parts, "camera": camera, "out": str(files[name])}
    if not request:
        return {name: dict(np.load(files[name])) for name in scenes}
    command = [options.mitsuba_python, __file__, "--worker", "--particles", str(options.particles)]
    answer = subprocess.run(command, input=json.dumps(request), capture_output=True, text=True, check=False)  # noqa: S603
    if answer.returncode:
        sys.exit(f"Mitsuba did not run (pip install mitsuba, or --mitsuba-python): {answer.stderr.strip()[-600:]}")
    return {name: dict(np.load(files[name])) for name in scenes}


def trace_all(particles: float) -> None:
    """Worker: scenes from standard input, their images to files."""
    import mitsuba

    mitsuba.set_variant(VARIANT)
    for name, scene in json.load(sys.stdin).items():
        once = name == "plain plate"
        images = trace(mitsuba, scene, particles, once)
        np.savez(scene["out"], direct=images[0], ghost=np.array(images[1:]))
    print("\n" + RESULT)


VARIANT = "scalar_rgb"


def trace(mitsuba: Any, scene: dict[str, Any], particles: float, once: bool) -> list[np.ndarray]:
    """Light scattered once, and twice in two independent halves."""
    world = mitsuba.load_dict(mitsuba_scene(mitsuba, scene))
    spp = max(1, round(particles / (WIDTH * HEIGHT)))
    images = []
    for depth, seed, share in ((2, 0, 2), (3, 1, 1), (3, 2, 1)):
        integrator = mitsuba.load_dict({"type": "ptracer", "max_depth": depth, "hide_emitters": True})
        if once and depth == 3:
            images.append(images[0] * 0)
            continue
        image = mitsuba.render(world, integrator=integrator, spp=max(1, spp // share), seed=seed)
        images.append(np.array(image)[..., 0].astype(float))
    # a blend's two halves: what is scattered once carries 1/2, twice 1/4
    return [2 * images[0], *(4 * (i - images[0]) for i in images[1:])]


def mitsuba_scene(mitsuba: Any, scene: dict[str, Any]) -> dict[str, Any]:
    """Solids, the projector's sheet, the camera."""

    def look_at(origin: Any, target: Any, up: Any) -> Any:
        vectors = (np.asarray(v, dtype=float).tolist() for v in (origin, target, up))
        return mitsuba.ScalarTransform4f().look_at(**dict(zip(("origin", "target", "up"), vectors, strict=True)))

    step = 2 * HALF_FAN / ALONG
    y = (np.arange(ALONG) + 0.5) * step - HALF_FAN
    x = (np.arange(ACROSS) - ACROSS // 2) * step
    cosine = 1 / np.sqrt(1 + y * y)
    waist = WAIST_MM / AT_MM / cosine
    sheet = cosine**2 / waist * np.exp(-2 * (x[:, None] / waist) ** 2)
    bitmap = np.repeat(sheet[:, :, None], 3, 2).astype(np.float32)
    matrix = np.array(scene["camera"])
    eye, towards = matrix[:3, 3], matrix[:3, 2]
    out: dict[str, Any] = {
        "type": "scene",
        "laser": {
            "type": "projector",
            "to_world": look_at([0.0, 0, 0], [0.0, 0, 1], [1.0, 0, 0]),
            "fov": float(np.rad2deg(2 * np.arctan(HALF_FAN))),
            "irradiance": {"type": "bitmap", "data": mitsuba.TensorXf(bitmap), "raw": True},
            "scale": 1e4,
        },
        "sensor": {
            "type": "perspective", "fov_axis": "x", "fov": float(np.rad2deg(2 * np.arctan(WIDTH / 2 / FOCAL))),
            "to_world": look_at(eye, eye + towards, -matrix[:3, 1]),
            "sampler": {"type": "independent", "sample_count": 16},
            "film": {"type": "hdrfilm", "pixel_format": "rgb", "component_format": "float32",
                     "rfilter": {"type": "box"},
                     "width": WIDTH, "height": HEIGHT},
        },
    }  # fmt: skip
    for k, part in enumerate(scene["parts"]):
        out[f"part{k}"] = mitsuba_mesh(mitsuba, np.load(part["file"]), part["material"])
    return out


def mitsuba_mesh(mitsuba: Any, data: Any, numbers: list[float]) -> Any:
    """A mesh with the blend of a diffuse and a glossy half."""
    diffuse, specular, alpha = numbers
    matte = {"type": "diffuse", "reflectance": {"type": "rgb", "value": diffuse}}
    mirror = {"type": "roughconductor", "material": "none", "distribution": "ggx", "alpha": alpha,
              "specular_reflectance": {"type": "rgb", "value": max(specular, 1e-9)}}  # fmt: skip
    blend = {"type": "twosided", "b": {"type": "blendbsdf", "weight": 0.5, "a": matte, "c": mirror}}
    properties = mitsuba.Properties()
    properties["bsdf"] = mitsuba.load_dict(blend)
    vertices, normals = data["vertices"].astype(np.float32), data["normals"].astype(np.float32)
    mesh = mitsuba.Mesh("part", len(vertices), len(vertices) // 3, has_vertex_normals=True, props=properties)
    values = mitsuba.traverse(mesh)
    values["vertex_positions"], values["vertex_normals"] = vertices.ravel(), normals.ravel()
    values["faces"] = np.arange(len(vertices), dtype=np.uint32)
    values.update()
    return mesh


if __name__ == "__main__":
    main()
