"""String spots against a path tracer: centroid, width and CPU time, ours and Mitsuba 3's, in the same run.

    python benchmarks/perceptron_emu_mitsuba.py [--poses 20] [--spp 1024] [--mitsuba-python PYTHON]

Mitsuba (pip install mitsuba) is an oracle of this script alone; PYTHON is an interpreter that has it, by default this
one.
Each spot is traced on a crop of the image, in sub-pixels: a cylinder lit by a projector with a Gaussian bitmap, seen
by a
pinhole camera. Ours is drawn without noise and speckle. Widths are those of the light itself: pixel and lens blur are
taken out.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
import time
from typing import Any

import numpy as np

HALF_PX = 20
GOAL_PX = 0.01
BITMAP = 512
FINE = 5  # sub-pixels of Mitsuba's film: its unblurred spot would alias on whole pixels
BLUR_PX = 0.75  # ours, wide enough not to alias
RESULT = "spots: "  # Mitsuba prints its progress on the same output
POOL = np.random.default_rng(20)


def main() -> None:
    """Compare, or trace as the worker of a comparison."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--poses", type=int, default=6)
    parser.add_argument("--spp", type=int, default=1024)
    parser.add_argument("--mitsuba-python", default=sys.executable)
    parser.add_argument("--worker", action="store_true", help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.worker:
        trace_all(options.spp)
    else:
        compare(options)


def compare(options: argparse.Namespace) -> None:
    """Trace every spot of random poses with both thread surfaces and print the differences."""
    for name, specular in (("matte", 0.0), ("glossy", 0.3)):
        spots = [s for _ in range(options.poses) for s in our_spots(specular)]
        theirs = ask(spots, options.mitsuba_python, options.spp)
        report(name, spots, theirs)
        equal_error(spots, theirs, options.mitsuba_python)


def ask(spots: list[dict[str, Any]], python: str, spp: int) -> list[dict[str, Any]]:
    """Mitsuba's moments of the spots at a number of samples a pixel."""
    request = json.dumps([{k: v for k, v in s.items() if k != "ours"} for s in spots])
    command = [python, __file__, "--worker", "--spp", str(spp)]
    answer = subprocess.run(command, input=request, capture_output=True, text=True, check=False)  # noqa: S603
    if answer.returncode:
        sys.exit(f"Mitsuba did not run (pip install mitsuba, or --mitsuba-python): {answer.stderr.strip()[-400:]}")
    line = next(line for line in answer.stdout.splitlines() if line.startswith(RESULT))
    found: list[dict[str, Any]] = json.loads(line[len(RESULT) :])
    return found


def equal_error(spots: list[dict[str, Any]], fine: list[dict[str, Any]], python: str) -> None:
    """CPU time of a whole frame at a centroid error of 0.01 px: Mitsuba's from its crops, by their share of the
    frame.
    """
    for spp in (50, 100, 200, 400):
        coarse = ask(spots, python, spp)
        error = float(
            np.sqrt(np.mean([np.square(np.subtract(c["mean"], f["mean"])) for c, f in zip(coarse, fine, strict=True)]))
        )
        if error <= GOAL_PX:
            break
    share = (2 * HALF_PX + 1) ** 2 / (1280 * 1024)
    frame_s = float(np.mean([c["cpu_s"] for c in coarse])) / share
    ours_s = 5 * float(np.mean([s["ours"]["cpu_s"] for s in spots]))
    print(f"  at {GOAL_PX} px (Mitsuba: {spp} spp, error {error:.4f}), 1280 x 1024 frame of strings alone:", end=" ")
    print(f"ours {1e3 * ours_s:.1f} ms, Mitsuba {frame_s:.1f} s, {frame_s / ours_s:.0f} ×")


def report(name: str, spots: list[dict[str, Any]], theirs: list[dict[str, Any]]) -> None:
    """Print the differences of one surface."""
    centroid = np.array([np.subtract(t["mean"], s["ours"]["mean"]) for s, t in zip(spots, theirs, strict=True)])
    width = np.array([np.subtract(t["sigma"], s["ours"]["sigma"]) for s, t in zip(spots, theirs, strict=True)])
    halves = np.array([np.subtract(*t["halves"]) for t in theirs]) / 2
    ours_s, theirs_s = sum(s["ours"]["cpu_s"] for s in spots), sum(t["cpu_s"] for t in theirs)
    print(f"{name}: {len(spots)} spots")
    print(f"  centroid difference u, v [px]   rms {rms(centroid)}  max {np.abs(centroid).max(0).round(4)}")
    print(f"  width difference σu, σv [px]    rms {rms(width)}  max {np.abs(width).max(0).round(4)}")
    print(f"  Mitsuba's own noise of a centroid [px] rms {rms(halves)}")
    each = f"ours {1e3 * ours_s / len(spots):.2f} ms, Mitsuba {theirs_s / len(spots):.2f} s"
    print(f"  CPU a spot: {each}, {theirs_s / ours_s:.0f} × (Mitsuba on a crop of {2 * HALF_PX + 1} px alone)")


def rms(a: np.ndarray) -> np.ndarray:
    """Root mean square by column."""
    return np.sqrt(np.mean(a**2, 0)).round(4)


def our_spots(specular: float) -> list[dict[str, Any]]:
    """One random pose: each string's geometry, light and our own noise-free spot."""
    from geometry import Camera, Pose, Sensor, Sheet, nearest_rotation
    from jig_cad import Jig
    from perceptron_emu import EmulatorConfig, Material, Scene, mean_electrons, render
    from perceptron_emu.light import cylinders, half_width_mm

    tilt = np.deg2rad(22.5)
    rotation = nearest_rotation([[0, -np.cos(tilt), -np.sin(tilt)], [1, 0, 0], [0, -np.sin(tilt), np.cos(tilt)]])
    pose = Pose(rotation, np.array([120.0, 0, 0]))
    sensor = Sensor(Sheet(fan_rad=float(np.deg2rad(44))), Camera(1280, 1024, 2300.0, 2300.0, 639.5, 511.5, pose))
    tables = {"optics": {"blur_px": BLUR_PX, "diffraction": False, "vignetting": False}}
    config = EmulatorConfig.model_validate(tables).off("noise", "speckle", "ambient")
    material = Material(0.6, specular, 0.3)
    turn = Pose.from_fixed_xyz_deg([POOL.uniform(-12, 12), POOL.uniform(-30, 30), POOL.uniform(-25, 25)], np.zeros(3)).R
    middle = np.array([0, POOL.uniform(-10, 10), POOL.uniform(310, 340)])
    scene = Scene(sensor, Jig.nominal(), Pose(turn, middle - turn @ [50.0, 0, 40]), string_material=material)
    frame = render(scene, config)
    start = time.process_time()
    image = mean_electrons(scene, config).astype(float)
    cpu_s = (time.process_time() - start) / len(frame.truth.strings)
    strings, spots = cylinders(scene.jig, scene.T_sensor_jig), []
    for i, truth in enumerate(frame.truth.strings):
        apart = [np.linalg.norm(t.image_px - truth.image_px) for t in frame.truth.strings if t is not truth]
        if truth.visible_fraction < 1 or not min(apart) > 1.5 * HALF_PX:
            continue  # Mitsuba traces each string alone
        distance = float(np.linalg.norm(truth.axis_mm))
        corner = np.round(truth.image_px).astype(int) - HALF_PX
        patch = image[corner[1] : corner[1] + 2 * HALF_PX + 1, corner[0] : corner[0] + 2 * HALF_PX + 1]
        mean, sigma = moments(patch)
        sigma = np.sqrt(sigma**2 - BLUR_PX**2 - 1 / 12)
        camera = sensor.require_camera()
        spots.append(
            {
                "start": strings.starts[i].tolist(),
                "end": (strings.starts[i] + strings.lengths[i] * strings.directions[i]).tolist(),
                "radius": strings.radius,
                "axis": truth.axis_mm.tolist(),
                "half_width": float(half_width_mm(config.laser, sensor, np.array(distance))),
                "camera": camera.T_sensor_camera.matrix.tolist(),
                "intrinsics": [camera.fx_px, camera.cx_px, camera.cy_px, camera.width_px, camera.height_px],
                "corner": corner.tolist(),
                "material": [material.diffuse, material.specular, material.roughness],
                "ours": {"mean": (mean + corner).tolist(), "sigma": sigma.tolist(), "cpu_s": cpu_s},
            }
        )
    return spots


def moments(patch: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Centroid (u, v) and widths of a patch of image."""
    rows, columns = np.mgrid[: patch.shape[0], : patch.shape[1]]
    weight = patch / patch.sum()
    mean = np.array([(weight * columns).sum(), (weight * rows).sum()])
    second = np.array([(weight * columns**2).sum(), (weight * rows**2).sum()])
    return mean, np.sqrt(second - mean**2)


def trace_all(spp: int) -> None:
    """Worker: spots from standard input, their moments to standard output."""
    import mitsuba

    mitsuba.set_variant("scalar_rgb")
    print("\n" + RESULT + json.dumps([trace(mitsuba, spot, spp) for spot in json.load(sys.stdin)]))


def trace(mitsuba: Any, spot: dict[str, Any], spp: int) -> dict[str, Any]:
    """Moments of one spot, traced twice for its noise."""
    scene = mitsuba.load_dict(mitsuba_scene(mitsuba, spot))
    start, each = time.process_time(), max(1, spp // FINE**2 // 2)
    images = [np.array(mitsuba.render(scene, spp=each, seed=seed))[..., 0].astype(float) for seed in (0, 1)]
    cpu_s = time.process_time() - start
    mean, sigma = moments(images[0] + images[1])
    corner = np.array(spot["corner"])
    return {
        "mean": ((mean + 0.5) / FINE - 0.5 + corner).tolist(),
        "sigma": np.sqrt((sigma**2 - 1 / 12) / FINE**2).tolist(),
        "halves": [(moments(i)[0] / FINE).tolist() for i in images],
        "cpu_s": cpu_s,
    }


def mitsuba_scene(mitsuba: Any, spot: dict[str, Any]) -> dict[str, Any]:
    """One string, the laser on it, the camera's crop."""
    matrix = np.array(spot["camera"])
    focal, cx, cy, width, height = spot["intrinsics"]
    diffuse, specular, alpha = spot["material"]
    matte = {"type": "diffuse", "reflectance": {"type": "rgb", "value": diffuse}}
    mirror = {"type": "roughconductor", "material": "none", "distribution": "ggx", "alpha": alpha,
              "specular_reflectance": {"type": "rgb", "value": max(specular, 1e-9)}}  # fmt: skip
    blend = {
        "type": "blendbsdf",
        "weight": 0.5,
        "a": {"type": "twosided", "b": matte},
        "b": {"type": "twosided", "b": mirror},
    }

    def look_at(origin: Any, target: Any, up: Any) -> Any:
        vectors = (np.asarray(v, dtype=float).tolist() for v in (origin, target, up))
        return mitsuba.ScalarTransform4f().look_at(**dict(zip(("origin", "target", "up"), vectors, strict=True)))

    axis = np.array([0.0, *spot["axis"]])
    distance = float(np.linalg.norm(axis))
    slant = abs(np.subtract(spot["end"], spot["start"])[0]) / float(
        np.linalg.norm(np.subtract(spot["end"], spot["start"]))
    )
    half_angle = max(2.5 * spot["half_width"] / slant, 6 * spot["radius"]) / distance
    across = (np.arange(BITMAP) + 0.5) / BITMAP * 2 - 1
    profile = np.exp(-2 * (np.tan(half_angle) * across * distance / spot["half_width"]) ** 2)
    bitmap = np.repeat(np.tile(profile[None, :, None], (BITMAP, 1, 1)), 3, 2).astype(np.float32)
    eye, towards = matrix[:3, 3], matrix[:3, 2]
    return {
        "type": "scene",
        "integrator": {"type": "direct"},
        "string": {"type": "cylinder", "p0": spot["start"], "p1": spot["end"], "radius": spot["radius"], "bsdf": blend},
        "laser": {
            "type": "projector",
            "to_world": look_at([0.0, 0, 0], axis, np.cross(axis, [1.0, 0, 0])),
            "fov": float(np.rad2deg(2 * half_angle)),
            "irradiance": {"type": "bitmap", "data": mitsuba.TensorXf(bitmap), "raw": True, "filter_type": "bilinear"},
            "scale": 1e4,
        },
        "sensor": {
            "type": "perspective",
            "fov_axis": "x",
            "fov": float(np.rad2deg(2 * np.arctan(width / 2 / focal))),
            "principal_point_offset_x": float(((width - 1) / 2 - cx) / width),
            "principal_point_offset_y": float(((height - 1) / 2 - cy) / height),
            "to_world": look_at(eye, eye + towards, -matrix[:3, 1]),
            "sampler": {"type": "multijitter", "sample_count": 16},
            "film": film(spot["corner"], width, height),
        },
    }


def film(corner: list[int], width: int, height: int) -> dict[str, Any]:
    """The crop of the image about a spot, in sub-pixels."""
    size = (2 * HALF_PX + 1) * FINE
    place = {
        "crop_offset_x": corner[0] * FINE,
        "crop_offset_y": corner[1] * FINE,
        "crop_width": size,
        "crop_height": size,
    }
    kind = {"type": "hdrfilm", "pixel_format": "rgb", "component_format": "float32", "rfilter": {"type": "box"}}
    return kind | place | {"width": width * FINE, "height": height * FINE}


if __name__ == "__main__":
    main()
