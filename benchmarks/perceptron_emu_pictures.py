"""The pictures of docs/emulator.md: every effect off and on, same frame, zoomed in.

Run: python benchmarks/perceptron_emu_pictures.py [FOLDER], by default docs/pictures.
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from geometry import Camera, Pose, Sensor, Sheet, nearest_rotation
from jig_cad import Jig
from jig_cad.solids import jig_solids
from perceptron_emu import ALUMINIUM, BLACK_PLATE, MATTE, EmulatorConfig, Material, Scene, Solid, panel, render

TILT = np.deg2rad(22.5)
ROTATION = nearest_rotation([[0, -np.cos(TILT), -np.sin(TILT)], [1, 0, 0], [0, -np.sin(TILT), np.cos(TILT)]])
BENT = (-0.25, 0.1, 2e-3, -1e-3, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.08, -0.04)
SCHEIMPFLUG = (*(0.0,) * 12, 0.0937, 0.0)  # tan τ = v/u · tan 67.5°
QUIET: dict[str, Any] = {
    "speckle": {"enabled": False},
    "noise": {"enabled": False},
    "ambient": {"enabled": False},
}
Turn = tuple[float, float, float]
OBLIQUE = (8.0, 14.0, -5.0)
STREAK = (0.0, -9.0, 0.0)  # the posts stand so that they mirror the sheet into the camera
Picture = np.ndarray


def main() -> None:
    """Draw and write every pair."""
    folder = Path(sys.argv[1] if len(sys.argv) > 1 else "docs/pictures")
    folder.mkdir(parents=True, exist_ok=True)
    for name, make in PAIRS.items():
        off, on = make()
        bar = np.full((off.shape[0], 6), 255, np.uint8)
        cv2.imwrite(str(folder / f"emulator_{name}.png"), np.hstack([off, bar, on]), [cv2.IMWRITE_PNG_COMPRESSION, 9])


def sensor(distortion: tuple[float, ...] = (), **more: Any) -> Sensor:
    """The nominal sensor of these pictures."""
    pose = Pose(ROTATION, np.array([120.0, 0, 0]))
    values = {"black_level": 8.0} | more
    sheet = Sheet(fan_rad=values.pop("fan_rad", np.deg2rad(44.0)))
    return Sensor(sheet, Camera(1280, 1024, 2300.0, 2300.0, 639.5, 511.5, pose, distortion, **values))


def jig_scene(
    s: Sensor | None = None,
    solids: bool = True,
    wall: bool = False,
    post: Material = ALUMINIUM,
    turn_deg: Turn = OBLIQUE,
) -> Scene:
    """A jig in view, with its plates and posts and a wall behind it."""
    turn = Pose.from_fixed_xyz_deg(turn_deg, [0, 0, 0]).R
    place, jig = Pose(turn, np.array([0, 0, 300.0]) - turn @ [50.0, 0, 0]), Jig.nominal()
    bodies = []
    if solids:
        for name, mesh in jig_solids(jig, strings=False).items():
            bodies.append(Solid(mesh, post if name.startswith("post") else BLACK_PLATE, place, name))
    if wall:
        bodies.append(panel(700, 700, Pose(np.eye(3), np.array([0.0, 0, 430])), name="wall"))
    return Scene(s or sensor(), jig, place, tuple(bodies))


def config(**tables: dict[str, Any]) -> EmulatorConfig:
    """The default configuration without noise, speckle and room light, but for the given tables."""
    return EmulatorConfig.model_validate({k: QUIET.get(k, {}) | tables.get(k, {}) for k in {*QUIET, *tables}})


def shot(scene: Scene, c: EmulatorConfig) -> Picture:
    """One frame as floats."""
    return render(scene, c, np.random.default_rng(4)).image.astype(float)


def zoom(image: Picture, centre: tuple[float, float], half: int, gain: float = 1.0, black: float = 8.0) -> Picture:
    """A square about the centre, enlarged, with the square root of brightness so that faint light shows."""
    u, v = (round(c) for c in centre)
    part = image[max(v - half, 0) : v + half, max(u - half, 0) : u + half]
    shown = np.sqrt(np.clip((part - black + 0.5) * gain / 247, 0, 1)) * 255
    size = (320, 320 * part.shape[0] // part.shape[1])
    return cv2.resize(shown.astype(np.uint8), size, interpolation=cv2.INTER_NEAREST if half < 60 else cv2.INTER_AREA)


def at_string(
    label: str, half: int, off: EmulatorConfig, on: EmulatorConfig, gain: float = 1.0, turn_deg: Turn = OBLIQUE
) -> tuple[Picture, Picture]:
    """The spot of a string in both configurations."""
    scene = jig_scene(solids=False, turn_deg=turn_deg)
    spots = {s.label: s.image_px for s in render(scene, off).truth.strings}
    images = (zoom(shot(scene, c), tuple(spots[label]), half, gain) for c in (off, on))
    first, second = images
    return first, second


def whole(scenes: list[Scene], configs: list[EmulatorConfig], gain: float = 1.0) -> tuple[Picture, Picture]:
    """The whole frame of both."""
    first, second = (zoom(shot(s, c), (640, 512), 640, gain) for s, c in zip(scenes, configs, strict=True))
    return first, second


def post_stripe(off: tuple[Scene, EmulatorConfig], on: tuple[Scene, EmulatorConfig]) -> tuple[Picture, Picture]:
    """The right post's stripe in both."""
    truth = render(on[0], EmulatorConfig(), full_truth=True).truth
    v, u = np.nonzero(
        truth.labels == truth.label_names.index(next(n for n in truth.label_names if n.startswith("post")))
    )
    first, second = (zoom(shot(*case), (float(u.mean()), float(v.mean())), 30) for case in (off, on))
    return first, second


def shadows() -> tuple[Picture, Picture]:
    """The wall's stripe without and with the jig before it."""
    alone, with_jig = replace(jig_scene(wall=True), jig=None), jig_scene(wall=True)
    alone = replace(alone, solids=alone.solids[-1:])
    return whole([alone, with_jig], [config(), config()], 3.0)


def scheimpflug() -> tuple[Picture, Picture]:
    """A wall's stripe far from the plane of focus, chip straight and tilted."""
    c = config(optics={"defocus": True, "f_number": 1.4}, exposure={"time_ms": 0.05})
    wall = panel(700, 700, Pose(np.eye(3), np.array([0.0, 0, 370])))
    pictures = []
    for terms in ((), SCHEIMPFLUG):
        image = shot(Scene(sensor(terms), solids=(wall,)), c)
        pictures.append(zoom(image, (640, float(np.argmax(image[:, 640]))), 30))
    return pictures[0], pictures[1]


def plate_stripe(off: Material, on: Material) -> tuple[Picture, Picture]:
    """The stripe on a slanted plate of both materials."""
    place = Pose.from_fixed_xyz_deg([0, 35, 0], [0, 0, 300.0])
    first, second = (brightest(Scene(sensor(), solids=(panel(30, 60, place, m),)), config(), 640) for m in (off, on))
    return first, second


def corner() -> tuple[Picture, Picture]:
    """A stripe at the image's edge, through a lens as sharp there as in the middle and one that is not."""
    plate = panel(60, 220, Pose(np.eye(3), np.array([0.0, 0, 345])), Material(0.6))
    first, second = (
        brightest(Scene(sensor(fan_rad=0.9), solids=(plate,)), config(optics={"blur_corner_px": b}), 1250)
        for b in (0.9, 5.0)
    )
    return first, second


def brightest(scene: Scene, c: EmulatorConfig, column: int) -> Picture:
    """The stripe where it crosses a column."""
    image = shot(scene, c)
    return zoom(image, (column, int(np.argmax(image[:, column]))), 24)


def glare() -> tuple[Picture, Picture]:
    """A bright wall behind the jig, its dark plate seen by a clear lens and by one that veils."""
    room = {"enabled": True, "irradiance_mw_m2_nm": 300.0}
    configs = [config(ambient=room, optics={"veiling_glare": g}) for g in (0.0, 0.1)]
    return whole([jig_scene(wall=True)] * 2, configs)


def bright_plate() -> Scene:
    """A white plate under the stripe."""
    return Scene(sensor(), solids=(panel(90, 60, Pose(np.eye(3), np.array([0.0, 0, 300])), Material(0.9)),))


def aperture() -> tuple[Picture, Picture]:
    """A plate's stripe behind an edge 60 mm before the lens, seen by a pinhole and by a lens of F/2."""
    s = sensor()
    place = s.require_camera().T_sensor_camera @ Pose(np.eye(3), np.array([200.0, 0, 60.0]))
    scene = Scene(s, solids=(*bright_plate().solids, panel(400, 40, place, Material(0.0))))
    shots = (
        shot(scene, config(optics={"f_number": 2.0, "aperture_points": n}, exposure={"time_ms": 0.3})) for n in (1, 100)
    )
    first, second = (zoom(image, (600, 540), 100) for image in shots)
    return first, second


def labels() -> tuple[Picture, Picture]:
    """A frame and its labels."""
    scene = jig_scene(wall=True)
    frame = render(scene, config(), full_truth=True)
    assert frame.truth.labels is not None
    shown = (frame.truth.labels.astype(float) * 255 / frame.truth.labels.max()).astype(np.uint8)
    return zoom(frame.image.astype(float), (640, 512), 640, 4.0), cv2.resize(
        shown, (320, 256), interpolation=cv2.INTER_AREA
    )


NOISY = {"enabled": True}
PAIRS: dict[str, Callable[[], tuple[Picture, Picture]]] = {
    "sheet": lambda: at_string("B", 16, *(config(laser={"waist_um": 60.0, "divergence": d}) for d in (False, True))),
    "fan": lambda: whole(
        [Scene(sensor(), solids=(panel(700, 700, Pose(np.eye(3), np.array([0.0, 0, 330]))),))] * 2,
        [config(laser={"profile": p, "edge_fraction": e}) for p, e in (("powell", 0.9), ("gaussian", 0.1))],
        1.5,
    ),
    "thread": lambda: at_string(
        "A",
        9,
        *(config(surface={"diffuse": d, "specular": s, "roughness": 0.1}) for d, s in ((0.6, 0.0), (0.05, 0.9))),
        gain=0.25,
        turn_deg=STREAK,
    ),
    "post": lambda: post_stripe(
        (jig_scene(post=MATTE, turn_deg=STREAK), config()), (jig_scene(turn_deg=STREAK), config())
    ),
    "shadows": shadows,
    "distortion": lambda: whole([jig_scene(sensor(d), wall=True) for d in ((), BENT)], [config()] * 2, 3.0),
    "defocus": lambda: at_string(
        "C",
        16,
        *(config(optics={"defocus": d, "f_number": 2.0, "focus_distance_mm": 300.0}) for d in (False, True)),
        gain=0.5,
    ),
    "scheimpflug": scheimpflug,
    "vignetting": lambda: whole(
        [Scene(sensor(fan_rad=0.7), solids=(panel(2000, 2000, Pose(ROTATION, np.array([-30.0, 0, 400]))),))] * 2,
        [
            config(ambient={"enabled": True, "irradiance_mw_m2_nm": 300.0}, optics={"vignetting": v})
            for v in (False, True)
        ],
    ),
    "filter": lambda: whole(
        [jig_scene(wall=True)] * 2,
        [
            config(ambient={"enabled": True, "irradiance_mw_m2_nm": 12.0}, optics={"filter_fwhm_nm": f})
            for f in (400.0, 25.0)
        ],
    ),
    "speckle": lambda: at_string("C'", 14, *(config(speckle={"enabled": e}) for e in (False, True)), gain=0.7),
    "grain": lambda: at_string(
        "C'",
        14,
        *(
            config(
                speckle={"enabled": True},
                optics={"f_number": f, "diffraction": False},
                exposure={"time_ms": 1.2 * (f / 4) ** 2},
            )
            for f in (4.0, 11.0)
        ),
        gain=0.7,
    ),
    "motion": lambda: at_string("A", 20, *(config(motion={"velocity_mm_s": [0.0, v, 0.0]}) for v in (0.0, 1200.0))),
    "noise": lambda: at_string("B'", 30, *(config(noise={"enabled": e}) for e in (False, True)), gain=8.0),
    "hdr": lambda: post_stripe(
        (jig_scene(), config(noise=NOISY, exposure={"time_ms": 5.0})),
        (jig_scene(), config(noise=NOISY, exposure={"time_ms": 5.0, "hdr_ratios": [0.2, 0.04]})),
    ),
    "laser_off": lambda: whole(
        [jig_scene(wall=True)] * 2,
        [EmulatorConfig.model_validate({"exposure": {"laser_on": on}}) for on in (True, False)],
        8.0,
    ),
    "aperture": aperture,
    "corner": corner,
    "glare": glare,
    "marble": lambda: plate_stripe(Material(0.8), Material(0.8, scatter_mm=0.3)),
    "lamp": lambda: whole(
        [jig_scene(wall=True)] * 2,
        [
            config(ambient={"enabled": True, "irradiance_mw_m2_nm": 120.0, "shadows": s}, exposure={"laser_on": False})
            for s in (False, True)
        ],
    ),
    "labels": labels,
}


if __name__ == "__main__":
    main()
