"""Light on the chip: nodes drawn in pieces, each multiplied by its speckle, summed to mean electrons."""

from __future__ import annotations

import math
from functools import lru_cache
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from geometry import Pose, Sensor
from geometry.compiled import kernel
from perceptron_emu.config import EmulatorConfig
from perceptron_emu.image.deposit import REACH, GaussianSpots, deposit, deposit_fine
from perceptron_emu.image.speckle import contrast, grain_px, oversampling, speckle_field
from perceptron_emu.lens import defocus_radius_px, project, sharp_sigma_px, to_camera
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
    bounds = [0, *(np.flatnonzero(np.diff(group)) + 1), len(group)]
    for begin, end in pairwise(bounds):
        shift = np.zeros(2)
        if drift is not None:
            shift = _speckle_shift(samples.xyz_mm[samples.group == group[begin]], sensor, drift)
        _draw_piece(electrons, spots.part(slice(begin, end)), sensor, config, key, shift)


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
    sigma = np.full(len(uv), sharp_sigma_px(config.optics, sensor, config.laser.wavelength_nm))
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


def _draw_piece(
    electrons: Float32, spots: GaussianSpots, sensor: Sensor, config: EmulatorConfig, key: int, shift_px: Array
) -> None:
    """One group of nodes: drawn on sub-pixels, multiplied by speckle, summed over each pixel."""
    height, width = electrons.shape
    reach = REACH * float(spots.sigma.max()) + 1
    # the piece's own box; it may stand out over the image's border
    (u0, u1), (v0, v1) = ((math.floor(c.min() - reach), math.ceil(c.max() + reach)) for c in (spots.u, spots.v))
    first_u, last_u, first_v, last_v = max(0, u0), min(width - 1, u1), max(0, v0), min(height - 1, v1)
    if first_u > last_u or first_v > last_v:
        return
    target = electrons[first_v : last_v + 1, first_u : last_u + 1]
    q = oversampling(config, sensor)
    fine = _on_grid(((v1 - v0 + 1) * q, (u1 - u0 + 1) * q), spots.seen_from(u0, v0).on_sub_pixels(q))
    moved = np.round(shift_px * q).astype(int)
    origin = (v0 * q - int(moved[1]), u0 * q - int(moved[0]))
    grains = speckle_field(origin, fine.shape, grain_px(config, sensor) * q, contrast(config), key)
    inner = np.s_[(first_v - v0) * q : (last_v + 1 - v0) * q, (first_u - u0) * q : (last_u + 1 - u0) * q]
    _add_product(target, fine[inner], grains[inner], q)


@kernel(fastmath=True)
def _add_product(electrons: Float32, light: Float32, grains: Float32, q: int) -> None:
    """Add light · grains (H q, W q), summed over the q × q sub-pixels of every pixel, to the electrons (H, W)."""
    row = np.empty(light.shape[1], np.float32)
    for j in range(electrons.shape[0]):
        row[:] = 0
        for k in range(j * q, (j + 1) * q):
            for i in range(len(row)):
                row[i] += light[k, i] * grains[k, i]
        for i in range(electrons.shape[1]):
            total = np.float32(0)
            for k in range(i * q, (i + 1) * q):
                total += row[k]
            electrons[j, i] += total


def _on_grid(shape: tuple[int, int], spots: GaussianSpots) -> Float32:
    """GaussianSpots drawn on a grid: all in one convolution where they are alike and clear of the border."""
    u, v, _, sigma = spots
    low, high = float(np.min(sigma)), float(np.max(sigma))
    clear = min(u.min(), v.min(), shape[1] - 1 - u.max(), shape[0] - 1 - v.max()) > REACH * high - 0.5
    if clear and low >= SPLINE_SIGMA and high - low < ALIKE * low:
        return deposit_fine(shape, spots, (low + high) / 2)
    fine = np.zeros(shape, np.float32)
    deposit(fine, spots)
    return fine
