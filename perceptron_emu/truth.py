"""What is known exactly about a rendered frame."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from geometry import Pose, Sensor
from geometry.compiled import kernel
from perceptron_emu.config import EmulatorConfig
from perceptron_emu.image import draw, ghost_electrons
from perceptron_emu.lens import project
from perceptron_emu.light import (
    OFF_SURFACE_MM,
    LightNodes,
    LitScene,
    faces_in_sheet,
    hidden_by_strings,
    lit_pieces,
    thread_of,
)
from perceptron_emu.scene import Scene
from perceptron_emu.solids import hidden_by_solids

Array = NDArray[np.float64]

# sums over a string's nodes: light [e⁻], and light times the coordinates
SUMS = np.dtype([(name, float) for name in ("electrons", "y", "z", "u", "v")])
GHOST = "ghost"  # the label of light that two surfaces have scattered one after the other
MIN_ELECTRONS = 1.0  # a pixel with less mean laser light than this belongs to nothing


@dataclass(frozen=True, eq=False)
class StringTruth:
    """What is known of one string of a frame.

    Parameters
    ----------
    label : str
        The string's name.
    axis_mm : Array
        (y, z) (2,) where the string's axis crosses the laser plane [mm].
    surface_mm : Array
        (y, z) (2,) of the centroid of its lit and seen surface, weighted by the light that reaches the camera [mm]; NaN
        where nothing is seen.
    image_px : Array
        (u, v) (2,) of the noise-free spot's centroid [px]; NaN where nothing is seen.
    visible_fraction : float
        The part of the spot's light, in [0, 1], that shadows, occluders and the image's border leave.
    electrons : float
        The spot's mean signal before noise [e⁻].
    """

    label: str
    axis_mm: Array
    surface_mm: Array
    image_px: Array
    visible_fraction: float
    electrons: float = 0.0


@dataclass(frozen=True, eq=False)
class SheetCurve:
    """Where the sheet's middle plane first meets the solids, in straight pieces.

    Parameters
    ----------
    yz_mm : Array
        Ends (n, 2, 2) in the laser plane [mm].
    uv_px : Array
        Their images (n, 2, 2) [px].
    solid : NDArray
        Number of the solid in the scene (n,).
    seen : NDArray
        Whether the camera sees the piece's middle (n,).
    """

    yz_mm: Array
    uv_px: Array
    solid: NDArray[np.int64]
    seen: NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class RenderedTruth:
    """What a rendered frame shows.

    Parameters
    ----------
    T_sensor_jig : Pose or None
        The jig's pose in {P} at mid-exposure; None without a jig.
    strings : tuple of StringTruth
        One for each string of the jig, in its order.
    labels : NDArray, optional
        (H, W) uint8, which surface gives a pixel most of its laser light, an index into label_names (0: none); only
        where `render` was asked for it.
    label_names : tuple of str
        "" for none, the strings, the solids, "ghost" where [light] bounces is on.
    curve : SheetCurve, optional
        Where the sheet meets the solids; only where `render` was asked for it.
    """

    T_sensor_jig: Pose | None
    strings: tuple[StringTruth, ...] = ()
    labels: NDArray[np.uint8] | None = None
    label_names: tuple[str, ...] = ()
    curve: SheetCurve | None = None


@dataclass(frozen=True, eq=False)
class RenderedFrame:
    """An image of the emulated sensor.

    Parameters
    ----------
    image : NDArray
        (H, W) uint8, or uint16 above 8 bits [DN].
    truth : RenderedTruth
        What is known of it.
    """

    image: NDArray[np.uint8] | NDArray[np.uint16]
    truth: RenderedTruth


def string_truths(parts: list[LitScene], shares: list[Array], now: LitScene, sensor: Sensor) -> tuple[StringTruth, ...]:
    """Truth of every string: sums over the parts of an exposure, axis points at its middle (``now``).

    shares: for each part the share of it that the chip's rows take (H,).
    """
    camera = sensor.require_camera()
    if now.strings is None:
        return ()
    axes, truths = now.strings.crossing[:, 1:], []
    for i, label in enumerate(now.strings.labels):
        sums, unhidden = np.zeros(1, SUMS), 0.0
        for part, share in zip(parts, shares, strict=True):
            nodes = part.string_samples[i]
            seen = StringNodes(project(sensor, nodes.xyz_mm), nodes.xyz_mm, nodes.electrons)
            taken = _add(sums, seen, share, camera.width_px)
            unhidden += taken * float(part.unhidden[i])
        truths.append(_string_truth(label, axes[i], sums[0], unhidden))
    return tuple(truths)


class StringNodes(NamedTuple):
    """Nodes of a string for compiled code: places in the image (N, 2) [px] and in {P} (N, 3) [mm], electrons (N,)."""

    uv_px: Array
    xyz_mm: Array
    electrons: Array


@kernel
def _add(sums: NDArray[np.void], nodes: StringNodes, share: Array, width: int) -> float:
    """Add the nodes inside the image to the sums (1,); returns the mean share (H,) of the rows of all nodes."""
    uv, xyz, electrons = nodes
    height, total = len(share), sums[0]
    taken = 0.0
    for k in range(len(electrons)):
        u, v = uv[k, 0], uv[k, 1]
        row = 0 if not v > 0 else int(min(round(v), height - 1))
        taken += share[row]
        if -0.5 < u < width - 0.5 and -0.5 < v < height - 0.5:
            light = electrons[k] * share[row]
            total["electrons"] += light
            total["y"] += light * xyz[k, 1]
            total["z"] += light * xyz[k, 2]
            total["u"] += light * u
            total["v"] += light * v
    return taken / max(len(electrons), 1)


def _string_truth(label: str, axis: Array, sums: np.void, unhidden: float) -> StringTruth:
    total = float(sums["electrons"])
    if total == 0:
        return StringTruth(label, axis, np.full(2, np.nan), np.full(2, np.nan), 0.0)
    # a sum of parts over the sum of all: rounding alone could carry the fraction past 1
    fraction = min(1.0, total / unhidden)
    surface, image = (np.array([sums[a], sums[b]]) / total for a, b in ("yz", "uv"))
    return StringTruth(label, axis, surface, image, fraction, total)


def label_names(scene: Scene, config: EmulatorConfig) -> tuple[str, ...]:
    """Names of the labels: "" for none, the strings, the solids, and where light bounces the ghosts."""
    strings = scene.jig.strings if scene.jig else ()
    ghost = (GHOST,) if config.light.bounces else ()
    return ("", *strings, *(s.name or f"solid {i}" for i, s in enumerate(scene.solids)), *ghost)


def pixel_labels(scene: Scene, lit: LitScene, config: EmulatorConfig) -> NDArray[np.uint8]:
    """The label (H, W) of the surface that brings most laser light to each pixel, speckle apart; of ghosts, whatever
    surface shows them, where light scattered twice is more than that of any surface scattered once.
    """
    samples, plain = lit.samples, config.off("speckle")
    owner = samples.surface(len(scene.jig.strings) if scene.jig else 0) + 1
    shape = scene.camera.shape
    labels, most = np.zeros(shape, np.uint8), np.full(shape, MIN_ELECTRONS, np.float32)
    for label in np.unique(owner):
        mine, own = owner == label, np.zeros(shape, np.float32)
        part = LightNodes(samples.xyz_mm[mine], samples.electrons[mine], samples.group[mine])
        draw(own, part, scene.sensor, plain, 0)
        larger = own > most
        labels[larger], most[larger] = label, own[larger]
    if config.light.bounces and config.exposure.laser_on:
        ghosts = ghost_electrons(scene, lit.strings, thread_of(scene, config), config)
        if ghosts is not None:
            labels[ghosts > most] = len(label_names(scene, config)) - 1
    return labels


def sheet_curve(scene: Scene, lit: LitScene, config: EmulatorConfig) -> SheetCurve:
    """Where the sheet's middle plane x = 0 first meets the solids."""
    faces = faces_in_sheet(scene, config)
    pieces = lit_pieces(faces, lit.strings, np.zeros(1), scene.sensor)
    middle = pieces.ends.mean(1)
    towards = scene.camera.centre_mm - middle
    start = middle + OFF_SURFACE_MM * towards / np.linalg.norm(towards, axis=1, keepdims=True)
    hidden = hidden_by_solids(scene.solids, start, scene.camera.centre_mm)
    if lit.strings is not None:
        hidden |= hidden_by_strings(lit.strings, start, scene.camera.centre_mm)
    return SheetCurve(pieces.ends[..., 1:], project(scene.sensor, pieces.ends), faces.solid[pieces.face], ~hidden)
