"""A scene to an image with its truth."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from perceptron_emu.ambient import ambient_electrons
from perceptron_emu.bodies import hidden_by_solid
from perceptron_emu.camera import expose
from perceptron_emu.config import EmulatorConfig
from perceptron_emu.image import draw
from perceptron_emu.occlusion import hidden_by_strings
from perceptron_emu.projection import project
from perceptron_emu.samples import Samples, join
from perceptron_emu.scene import Material, Scene
from perceptron_emu.strings import Cylinders, LitStrings, cylinders, light_strings
from perceptron_emu.stripes import light_solids
from perceptron_emu.transport import Light
from perceptron_emu.truth import Frame, FrameTruth, StringTruth

Array = NDArray[np.float64]


def render(scene: Scene, config: EmulatorConfig | None = None, rng: np.random.Generator | None = None) -> Frame:
    """The image that the sensor delivers of the scene, and what is known of it.

    rng draws two keys, for speckle and for the chip's noise; the same state gives the same bytes. Without config: its
    defaults; without rng: seed 0.
    """
    config = config or EmulatorConfig()
    rng = np.random.default_rng(0) if rng is None else rng
    speckle_key, noise_key = (int(k) for k in rng.integers(0, 2**63, 2))
    sensor, light = scene.sensor, Light(scene.sensor, config)
    strings = cylinders(scene.jig, scene.T_sensor_jig) if scene.jig else None
    surface = config.surface
    thread = scene.string_material or Material(surface.diffuse, surface.specular, surface.roughness)
    if config.ambient.enabled:
        electrons = ambient_electrons(scene, strings, thread, config, light)
    else:
        electrons = np.zeros((sensor.height_px, sensor.width_px), np.float32)
    samples, truths = _strings(scene, strings, thread, config, light)
    stripes = light_solids(scene, strings, config, light)
    draw(electrons, join([samples, stripes]), sensor, config, speckle_key)
    image = expose(electrons, config.noise, sensor, config.exposure.time_ms * 1e-3, noise_key)
    return Frame(image, FrameTruth(scene.T_sensor_jig if scene.jig else None, truths))


def _strings(
    scene: Scene, strings: Cylinders | None, material: Material, config: EmulatorConfig, light: Light
) -> tuple[Samples, tuple[StringTruth, ...]]:
    """Lit nodes of all strings and the truth of each."""
    if strings is None:
        return Samples.none(), ()
    lit = light_strings(strings, material, scene.sensor, config, light)
    seen = lit.electrons * _unhidden(strings, lit, scene)
    truths, parts = [], []
    for i, label in enumerate(strings.labels):
        keep = seen[i] > 0
        truths.append(
            _truth(label, strings.crossing[i, 1:], lit.xyz_mm[i][keep], seen[i][keep], lit.electrons[i].sum(), scene)
        )
        parts.append(Samples(lit.xyz_mm[i][keep], seen[i][keep], np.full(int(keep.sum()), i)))
    return join(parts), tuple(truths)


def _unhidden(strings: Cylinders, lit: LitStrings, scene: Scene) -> Array:
    """1 where a node (S, T, K) is reached by the laser and seen by the camera past other strings and solids, else 0."""
    points = lit.xyz_mm.reshape(-1, 3)
    own = np.repeat(np.arange(len(strings.labels)), lit.electrons[0].size)
    todo = np.flatnonzero(lit.electrons)
    emitter = points.copy()
    emitter[:, 1:] = scene.sensor.laser_origin_mm[1:]
    for source in (emitter, np.broadcast_to(scene.sensor.camera_centre_mm, points.shape)):
        todo = todo[~hidden_by_strings(strings, points[todo], source[todo], own[todo])]
        for solid in scene.solids:
            todo = todo[~hidden_by_solid(solid, points[todo], source[todo])]
    clear = np.zeros(len(points))
    clear[todo] = 1
    return clear.reshape(lit.electrons.shape)


def _truth(label: str, axis: Array, xyz: Array, electrons: Array, unhidden: float, scene: Scene) -> StringTruth:
    """Truth of one string from its seen nodes (N, 3) and their light (N,)."""
    nothing = np.full(2, np.nan)
    uv = project(scene.sensor, xyz) if len(xyz) else np.zeros((0, 2))
    size = np.array([scene.sensor.width_px, scene.sensor.height_px])
    inside = np.all((uv > -0.5) & (uv < size - 0.5), axis=1)
    xyz, uv, electrons = xyz[inside], uv[inside], electrons[inside]
    total = float(electrons.sum())
    if total == 0:
        return StringTruth(label, axis, nothing, nothing, 0.0)
    surface, image = electrons @ xyz[:, 1:] / total, electrons @ uv / total
    return StringTruth(label, axis, surface, image, float(total / unhidden), total)
