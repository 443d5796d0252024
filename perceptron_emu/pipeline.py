"""A scene to an image with its truth."""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from geometry import InputError, Sensor
from perceptron_emu.check import check_optics
from perceptron_emu.chip import expose, expose_hdr
from perceptron_emu.config import EmulatorConfig
from perceptron_emu.image import ambient_electrons, draw, ghost_electrons
from perceptron_emu.light import LitScene, Moment, light_scene, moments, moved, thread_of
from perceptron_emu.scene import Scene
from perceptron_emu.truth import RenderedFrame, RenderedTruth, label_names, pixel_labels, sheet_curve, string_truths

Float32 = NDArray[np.float32]


def render(
    scene: Scene,
    config: EmulatorConfig | None = None,
    rng: np.random.Generator | None = None,
    *,
    full_truth: bool = False,
    renderer: Literal["own", "pyrender"] = "own",
) -> RenderedFrame:
    """The image that the sensor delivers of the scene, and what is known of it.

    Parameters
    ----------
    scene : Scene
        A sensor with a camera, and what stands before it.
    config : EmulatorConfig, optional
        Laser, lens, surface, chip and exposure; its defaults where None.
    rng : numpy.random.Generator, optional
        Two keys are drawn from it, for speckle and for the chip's noise: the same state gives the same bytes. Seed 0
        where None.
    full_truth : bool
        Pixel labels and the sheet's curve too; about twice the time.
    renderer : {"own", "pyrender"}
        Who finds what is lit and seen, our own geometry or OpenGL's depth buffers; optics and chip are the same.

    Returns
    -------
    RenderedFrame
        The image (H, W) [DN] with its truth.

    Raises
    ------
    InputError
        Where the optics can not give an image, or the sensor has no camera.
    MissingDependencyError
        Where pyrender is asked for and finds no OpenGL.

    Examples
    --------
    >>> frame = render(Scene(sensor, jig, T_sensor_jig), rng=np.random.default_rng(1))  # doctest: +SKIP
    >>> frame.truth.strings[0].image_px  # doctest: +SKIP
    array([612.4, 488.1])
    """
    config = config or EmulatorConfig()
    _checked(scene.sensor, config)
    rng = np.random.default_rng(0) if rng is None else rng
    speckle_key, noise_key = (int(k) for k in rng.integers(0, 2**63, 2))
    path = moments(config, scene.camera.height_px)
    scenes = [moved(scene, m.drift) for m in path]
    find_light = _finder(renderer)
    lit = [find_light(s, config) for s in scenes]
    electrons = _mean_electrons(scenes, lit, path, config, speckle_key)
    exposure = config.exposure
    if exposure.hdr_ratios:
        image = expose_hdr(electrons, exposure, config.noise, scene.sensor, noise_key)
    else:
        image = expose(electrons, config.noise, scene.sensor, exposure.time_ms * 1e-3, noise_key)
    now = lit[0] if len(path) == 1 else find_light(scene, config)
    return RenderedFrame(image, _truth(scene, lit, path, now, config, full_truth))


@lru_cache(maxsize=64)
def _checked(sensor: Sensor, config: EmulatorConfig) -> None:
    """InputError, once for each sensor, where its optics can not give an image."""
    check_optics(sensor, config)


def mean_electrons(scene: Scene, config: EmulatorConfig | None = None, speckle_key: int = 0) -> Float32:
    """Mean photo-electrons of one exposure: the frame before the chip, free of its noise and rounding.

    Parameters
    ----------
    scene : Scene
        A sensor with a camera, and what stands before it.
    config : EmulatorConfig, optional
        Its defaults where None.
    speckle_key : int
        64 random bits, of which the speckle is made.

    Returns
    -------
    Float32
        (H, W) [e⁻].
    """
    config = config or EmulatorConfig()
    path = moments(config, scene.camera.height_px)
    scenes = [moved(scene, m.drift) for m in path]
    return _mean_electrons(scenes, [light_scene(s, config) for s in scenes], path, config, speckle_key)


def _finder(renderer: str) -> Callable[[Scene, EmulatorConfig], LitScene]:
    if renderer == "own":
        return light_scene
    if renderer == "pyrender":
        from perceptron_emu.gl import light_scene_gl

        return light_scene_gl
    raise InputError(f'renderer "{renderer}": must be "own" or "pyrender"')


def _mean_electrons(
    scenes: list[Scene], lit: list[LitScene], path: list[Moment], config: EmulatorConfig, speckle_key: int
) -> Float32:
    """Mean photo-electrons (H, W) of one exposure, room light and laser, over the parts of the sensor's way."""
    if len(path) == 1:
        return _electrons_at(scenes[0], lit[0], path[0], config, speckle_key)
    parts = zip(scenes, lit, path, strict=True)
    total = np.zeros(scenes[0].camera.shape, np.float32)
    for scene, part, moment in parts:
        total += moment.rows.astype(np.float32)[:, None] * _electrons_at(scene, part, moment, config, speckle_key)
    return total


def _electrons_at(scene: Scene, lit: LitScene, moment: Moment, config: EmulatorConfig, speckle_key: int) -> Float32:
    if config.ambient.enabled:
        electrons = ambient_electrons(scene, lit.strings, thread_of(scene, config), config)
    else:
        electrons = np.zeros(scene.camera.shape, np.float32)
    if config.exposure.laser_on:
        draw(electrons, lit.samples, scene.sensor, config, speckle_key, moment.drift)
        ghosts = ghost_electrons(scene, lit.strings, thread_of(scene, config), config) if config.light.bounces else None
        if ghosts is not None:
            electrons += ghosts
    if config.optics.veiling_glare:
        _veil(electrons, config.optics.veiling_glare)
    return electrons


def _veil(electrons: Float32, part: float) -> None:
    """Spread part of the light evenly over the image: the veiling glare index of ISO 9358 (in a bright field's small
    black middle, the light over that beside it).
    """
    rows = electrons.sum(1, dtype=np.float64)  # a row at a time: one order on every machine
    mean = float(np.add.accumulate(rows)[-1]) / electrons.size
    electrons *= np.float32(1 - part)
    electrons += np.float32(part * mean)


def _truth(
    scene: Scene, lit: list[LitScene], path: list[Moment], now: LitScene, config: EmulatorConfig, full: bool
) -> RenderedTruth:
    pose = scene.T_sensor_jig if scene.jig else None
    strings = string_truths(lit, [m.rows for m in path], now, scene.sensor)
    if not full:
        return RenderedTruth(pose, strings)
    labels, curve = pixel_labels(scene, now, config), sheet_curve(scene, now, config)
    return RenderedTruth(pose, strings, labels, label_names(scene, config), curve)
