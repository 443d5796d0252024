"""One image of a scene.toml before a sensor, with its truth."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np

from geometry import InputError, Sensor, rounded
from perceptron_emu import EmulatorConfig, Scene, mean_electrons, read_scene
from workbench.emulate.extras import Extras, Renderer, truth_points
from workbench.files import write_png, write_text

DARKEST_E = 5.0  # mean electrons of the brightest pixel below which an image shows nothing


def render_scene_file(
    path: Path,
    sensor: Sensor,
    emulator: EmulatorConfig,
    out: Path,
    seed: int,
    renderer: Renderer,
    extras: Extras,
) -> Path:
    """Write images/000.png and truth/000.json; InputError, and no file, where the image would show no laser light."""
    scene = read_scene(path, sensor)
    _refuse_darkness(path, scene, emulator)
    frame = extras.render(out, 0, scene, emulator, seed, renderer)
    pose = frame.truth.T_sensor_jig
    truth = {
        "T_sensor_jig": None if pose is None else pose.matrix.tolist(),
        "points": [p.model_dump(exclude={"name"}) for p in truth_points(frame)],
    }
    write_text(out / "truth" / "000.json", json.dumps(rounded(truth), indent=1, allow_nan=False) + "\n")
    image = out / "images" / "000.png"
    write_png(image, frame.image)
    return image


def _refuse_darkness(path: Path, scene: Scene, emulator: EmulatorConfig) -> None:
    if not emulator.exposure.laser_on:
        return
    brightest = float(np.max(mean_electrons(scene, emulator.off("ambient", "speckle"))))
    if brightest < DARKEST_E:
        raise InputError(
            f"{path}: no laser light of the scene reaches the image (brightest pixel {brightest:.2g} electrons): what "
            "the sheet meets is out of the camera's view, turned away or hidden, or [laser] and [exposure] are too weak"
        )
