"""The laser on the whole scene at one moment: every lit and seen node, by what it belongs to."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from perceptron_emu.config import EmulatorConfig
from perceptron_emu.lens import pupil_points_mm
from perceptron_emu.light.nodes import LightNodes, join, string_group
from perceptron_emu.light.strings import Cylinders, LitStrings, cylinders, hidden_by_strings, light_strings
from perceptron_emu.light.stripes import light_solids
from perceptron_emu.light.transport import Light
from perceptron_emu.scene import Material, Scene
from perceptron_emu.solids import hidden_by_solids

Array = NDArray[np.float64]
Index = NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class LitScene:
    """Every lit and seen node of a scene at one moment, by what it belongs to.

    Parameters
    ----------
    strings : Cylinders or None
        The strings; None without a jig.
    string_samples : tuple of LightNodes
        The seen nodes of each string.
    unhidden : Array
        (S,) electrons that each string would bring were nothing in the way.
    stripes : LightNodes
        The seen nodes of the solids.
    """

    strings: Cylinders | None
    string_samples: tuple[LightNodes, ...]
    unhidden: Array
    stripes: LightNodes

    @property
    def samples(self) -> LightNodes:
        """All nodes."""
        return join([*self.string_samples, self.stripes])


def thread_of(scene: Scene, config: EmulatorConfig) -> Material:
    """The strings' surface.

    Parameters
    ----------
    scene : Scene
        Its string_material, where given, is the answer.
    config : EmulatorConfig
        Its [surface] otherwise.

    Returns
    -------
    Material
        The thread.
    """
    surface = config.surface
    return scene.string_material or Material(surface.diffuse, surface.specular, surface.roughness)


def light_scene(scene: Scene, config: EmulatorConfig) -> LitScene:
    """Everything that the laser lights and the camera sees.

    Parameters
    ----------
    scene : Scene
        A sensor with a camera, and what stands before it.
    config : EmulatorConfig
        Laser, lens, exposure and quantum yield.

    Returns
    -------
    LitScene
        Nodes with the mean electrons that each brings to the chip.
    """
    light = Light(scene.sensor, config)
    if scene.jig is None:
        return LitScene(None, (), np.zeros(0), light_solids(scene, None, config, light))
    strings = cylinders(scene.jig, scene.T_sensor_jig)
    lit = light_strings(strings, thread_of(scene, config), scene.sensor, config, light)
    seen = lit.electrons * _unhidden(strings, lit, scene, config)
    parts = []
    for i in range(len(strings.labels)):
        keep = seen[i] > 0
        parts.append(LightNodes(lit.xyz_mm[i][keep], seen[i][keep], np.full(int(keep.sum()), string_group(i))))
    return LitScene(strings, tuple(parts), lit.electrons.sum((1, 2)), light_solids(scene, strings, config, light))


def _unhidden(strings: Cylinders, lit: LitStrings, scene: Scene, config: EmulatorConfig) -> Array:
    """Part of the lens that sees a node (S, T, K) past other strings and solids; 0 where no laser reaches it."""
    todo = np.flatnonzero(lit.electrons)
    points, own = lit.xyz_mm.reshape(-1, 3)[todo], todo // lit.electrons[0].size
    emitter = points.copy()
    emitter[:, 1:] = scene.sensor.sheet.origin_mm[1:]
    dark = _hidden(strings, scene, points, emitter, own, np.zeros(len(todo), dtype=bool))
    seen, eyes = np.zeros(len(todo)), pupil_points_mm(config.optics, scene.sensor)
    for eye in eyes:
        seen += ~_hidden(strings, scene, points, eye, own, dark)
    clear = np.zeros(lit.electrons.size)
    clear[todo] = seen / len(eyes)
    return clear.reshape(lit.electrons.shape)


def _hidden(
    strings: Cylinders, scene: Scene, points: Array, sources: Array, own: Index, dark: NDArray[np.bool_]
) -> NDArray[np.bool_]:
    """Which points (N, 3) on strings anything stands before, or are dark already."""
    return hidden_by_solids(scene.solids, points, sources, dark | hidden_by_strings(strings, points, sources, own))
