"""Light on the chip: nodes drawn in pieces, each multiplied by its speckle, summed to mean electrons."""

from __future__ import annotations

import math
from functools import lru_cache
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from geometry import Pose, Sensor
from perceptron_emu.config import EmulatorConfig
from perceptron_emu.image.deposit import GaussianSpots, deposit, spline_taps
from perceptron_emu.image.pieces import SpotPieces, draw_pieces
from perceptron_emu.image.speckle import contrast, grain_px, oversampling, speckle_of
from perceptron_emu.lens import defocus_radius_px, field_sigma_px, project, to_camera
from perceptron_emu.light import LightNodes

Array = NDArray[np.float64]
Float32 = NDArray[np.float32]

MAX_RINGS = 16  # of nodes on a disc of defocus: 817 nodes a spot
SMALL_DISC = 0.5  # σ of the blur: a smaller disc of defocus changes the spot by 5e-4 of its peak
ALIKE = 0.01  # of σ, by which spots drawn in one convolution may differ: ±0.5 % of their width
SPLINE_SIGMA = 2.5  # sub-pixels: sharper spots would alias on the splines that they are spread by


def draw(
    electrons: Float32,
    samples: LightNodes,
    sensor: Sensor,
    config: EmulatorConfig,
    key: int,
    drift: Pose | None = None,
) -> None:
    """Add the light of nodes to an image of mean electrons: drawn in pieces, each multiplied by its speckle.

    Parameters
    ----------
    electrons : Float32
        The image (H, W) [e⁻], added to in place.
    samples : LightNodes
        The nodes.
    sensor : Sensor
        With a camera.
    config : EmulatorConfig
        Its lens, laser and speckle.
    key : int
        64 random bits of this frame's speckle.
    drift : Pose, optional
        How far the scene has moved in {P} since the speckle's own moment; the pattern moves with the surface.
    """
    if len(samples.electrons) == 0:
        return
    spots, group = _defocused(samples, sensor, config)
    if not config.speckle.enabled:
        deposit(electrons, spots)
        return
    order = np.argsort(group, kind="stable")
    spots, group = spots.part(order), group[order]
    bounds = np.array([0, *(np.flatnonzero(np.diff(group)) + 1), len(group)])
    q = oversampling(config, sensor)
    pattern = speckle_of(grain_px(config, sensor) * q, contrast(config), key)
    moved = np.zeros((len(bounds) - 1, 2), np.int64)
    if drift is not None:
        at = (samples.xyz_mm[samples.group == group[begin]] for begin in bounds[:-1])
        moved[:] = [np.round(_speckle_shift(xyz, sensor, drift) * q) for xyz in at]
    low, high = float(np.min(spots.sigma)) * q, float(np.max(spots.sigma)) * q
    if low >= SPLINE_SIGMA and high - low < ALIKE * low:
        draw_pieces(electrons, spots, SpotPieces(bounds, moved, q), spline_taps((low + high) / 2), pattern)
        return
    for n, (begin, end) in enumerate(pairwise(bounds)):  # each with its own blur
        part = spots.part(slice(begin, end))
        low, high = float(np.min(part.sigma)) * q, float(np.max(part.sigma)) * q
        alike = low >= SPLINE_SIGMA and high - low < ALIKE * low
        taps = spline_taps((low + high) / 2) if alike else np.zeros(0, np.float32)
        draw_pieces(electrons, part, SpotPieces(np.array([0, end - begin]), moved[n : n + 1], q), taps, pattern)


def _speckle_shift(xyz_mm: Array, sensor: Sensor, drift: Pose) -> Array:
    """How far (2,) [px] the image of the surface at the nodes' middle has moved."""
    there = xyz_mm.mean(0)
    shift = project(sensor, there) - project(sensor, drift.inverse() @ there)
    return np.asarray(np.nan_to_num(shift))


def _defocused(samples: LightNodes, sensor: Sensor, config: EmulatorConfig) -> tuple[GaussianSpots, NDArray[np.int64]]:
    """The nodes' spots and groups, spread over the disc of defocus; a disc much smaller than the blur is folded into σ
    (σ² + R²/4).
    """
    uv, weight, group = project(sensor, samples.xyz_mm), samples.electrons, samples.group
    sigma = field_sigma_px(config.optics, sensor, uv, config.laser.wavelength_nm)
    if not config.optics.defocus:
        return GaussianSpots(uv[:, 0], uv[:, 1], weight, sigma), group
    radius = defocus_radius_px(config.optics, sensor, to_camera(sensor, samples.xyz_mm))
    if np.max(radius) < SMALL_DISC * np.min(sigma):
        return GaussianSpots(uv[:, 0], uv[:, 1], weight, np.sqrt(sigma**2 + radius**2 / 4)), group
    disc = _disc(min(MAX_RINGS, math.ceil(float(np.max(radius) / np.min(sigma)))))
    n = len(disc)
    u, v = (uv[:, i, None] + radius[:, None] * disc[:, i] for i in range(2))
    return GaussianSpots(u.ravel(), v.ravel(), np.repeat(weight / n, n), np.repeat(sigma, n)), np.repeat(group, n)


@lru_cache(maxsize=MAX_RINGS)
def _disc(rings: int) -> Array:
    """Points (N, 2) of equal weight that fill the unit disc: 6k on ring k, with the disc's own variance of 1/4."""
    points = [np.zeros((1, 2))]
    for k in range(1, rings + 1):
        angle = (np.arange(6 * k) + 0.5 * (k % 2)) * (2 * np.pi / (6 * k))
        points.append(k / rings * np.column_stack([np.cos(angle), np.sin(angle)]))
    disc = np.concatenate(points)
    return np.asarray(disc / np.sqrt(2 * np.mean(np.sum(disc**2, 1))))
