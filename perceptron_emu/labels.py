"""Truth by the pixel: which surface each belongs to, and the curve in which the sheet meets the scene."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from perceptron_emu.bodies import hidden_by_solid
from perceptron_emu.config import EmulatorConfig
from perceptron_emu.image import draw
from perceptron_emu.lighting import LitScene
from perceptron_emu.occlusion import hidden_by_strings
from perceptron_emu.projection import project
from perceptron_emu.samples import Samples
from perceptron_emu.scene import Scene
from perceptron_emu.sheet_faces import faces_in_sheet
from perceptron_emu.stripes import FIRST_STRIPE_GROUP, GROUPS_A_SOLID, OFF_SURFACE_MM, lit_pieces
from perceptron_emu.truth import SheetCurve

MIN_ELECTRONS = 1.0  # a pixel with less mean laser light than this belongs to nothing


def label_names(scene: Scene) -> tuple[str, ...]:
    """Names of the labels: "" for none, the strings, the solids."""
    strings = scene.jig.strings if scene.jig else ()
    return ("", *strings, *(s.name or f"solid {i}" for i, s in enumerate(scene.solids)))


def pixel_labels(scene: Scene, lit: LitScene, config: EmulatorConfig) -> NDArray[np.uint8]:
    """The label (H, W) of the surface that brings most laser light to each pixel, speckle apart."""
    camera = scene.camera
    samples, plain = lit.samples, config.off("speckle")
    n_strings = len(scene.jig.strings) if scene.jig else 0
    solid = (samples.group - FIRST_STRIPE_GROUP) // GROUPS_A_SOLID
    owner = np.where(samples.group < FIRST_STRIPE_GROUP, samples.group + 1, solid + 1 + n_strings)
    shape = camera.shape
    labels, most = np.zeros(shape, np.uint8), np.full(shape, MIN_ELECTRONS, np.float32)
    for label in np.unique(owner):
        mine, own = owner == label, np.zeros(shape, np.float32)
        part = Samples(samples.xyz_mm[mine], samples.electrons[mine], samples.group[mine])
        draw(own, part, scene.sensor, plain, 0)
        larger = own > most
        labels[larger], most[larger] = label, own[larger]
    return labels


def sheet_curve(scene: Scene, lit: LitScene, config: EmulatorConfig) -> SheetCurve:
    """Where the sheet's middle plane x = 0 first meets the solids."""
    camera = scene.camera
    faces = faces_in_sheet(scene, config)
    pieces = lit_pieces(faces, lit.strings, np.zeros(1), scene.sensor)
    middle = pieces.ends.mean(1)
    towards = camera.centre_mm - middle
    start = middle + OFF_SURFACE_MM * towards / np.linalg.norm(towards, axis=1, keepdims=True)
    hidden = np.zeros(len(middle), dtype=bool)
    for solid in scene.solids:
        hidden |= hidden_by_solid(solid, start, camera.centre_mm)
    if lit.strings is not None:
        hidden |= hidden_by_strings(lit.strings, start, camera.centre_mm)
    return SheetCurve(pieces.ends[..., 1:], project(scene.sensor, pieces.ends), faces.solid[pieces.face], ~hidden)
