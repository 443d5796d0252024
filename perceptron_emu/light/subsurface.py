"""Light that goes below a surface before it comes back: the stripe grows wider and moves along the laser's way.

What leaves at a distance r from where it went in follows Christensen and Burley's fit of Monte Carlo walks,
R(r) ∝ (exp(−r/d) + exp(−r/3d)) / (8πdr), d = ℓ/s with the mean free path ℓ and s = 1.9 − A + 3.5 (A − 0.8)² of the
albedo A. Across a long stripe that is the line spread L(x) = (K₀(|x|/d) + K₀(|x|/3d)) / (4πd) of variance 7d². The
light starts a mean free path below, along the laser's refracted way: all of it is moved by ℓ tan θₜ,
sin θₜ = sin θᵢ/n.

Source: Christensen & Burley, "Approximate reflectance profiles for efficient subsurface scattering", Pixar Technical
Memo 15-04, 2015; the start below the surface: Jensen, Marschner, Levoy & Hanrahan, "A practical model for subsurface
light transport", 2001.
"""

from __future__ import annotations

import math
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from geometry.compiled import kernel
from geometry.special import iti0k0
from perceptron_emu.scene import Material

Array = NDArray[np.float64]

INDEX = 1.5  # of refraction: marble, plastic, wax
CELLS, FINEST, REACH = 18, 0.05, 40.0  # of the line spread to either side, growing outwards; in units of d


def spread_mm(material: Material) -> float:
    """Length d of a material's line spread [mm]; 0 where light comes back from where it falls."""
    albedo = material.diffuse
    return material.scatter_mm / (1.9 - albedo + 3.5 * (albedo - 0.8) ** 2)


@lru_cache(maxsize=1)
def line_spread() -> tuple[Array, Array]:
    """Places (n,) across a stripe in units of d and the share (n,) of the light that leaves there.

    Cells grow outwards by a constant factor; each is put where the mean of its light is. The shares add up to 1.
    """
    edge = np.concatenate([[0.0], np.geomspace(FINEST, REACH, CELLS)])
    below = _below(edge)
    share = np.diff(below)
    # ∫ x K₀(x/a) dx = −a x K₁(x/a): the mean place, by fine sums that need no Bessel function of another order
    place = np.empty(CELLS)
    for k in range(CELLS):
        x = edge[k] + (np.arange(400) + 0.5) / 400 * (edge[k + 1] - edge[k])
        weight = np.diff(_below(np.linspace(edge[k], edge[k + 1], 401)))
        place[k] = np.sum(weight * x) / np.sum(weight)
    share = share / share.sum() / 2
    return np.concatenate([-place[::-1], place]), np.concatenate([share[::-1], share])


def _below(x: Array) -> Array:
    """Share of one side's light that leaves nearer than x, in units of d."""
    return np.asarray((iti0k0(x)[1] + 3 * iti0k0(x / 3)[1]) / (2 * math.pi))


@kernel
def moved_below(
    xyz: Array, normal: Array, origin: Array, lengths: tuple[float, float], spread: tuple[Array, Array]
) -> tuple[Array, Array]:
    """Where the light of surface nodes (N, 3) leaves (N · n, 3), and the share (n,) of each place.

    normal: towards the laser. lengths: mean free path and d [mm]. spread: `line_spread`.
    """
    places, shares = spread
    out, across, down = np.empty((len(xyz) * len(places), 3)), np.empty(3), np.empty(3)
    free, d = lengths
    for i in range(len(xyz)):
        ly, lz = xyz[i, 1] - origin[1], xyz[i, 2] - origin[2]
        size = math.sqrt(ly * ly + lz * lz)
        ly, lz = ly / size, lz / size
        inwards = ly * normal[i, 1] + lz * normal[i, 2]
        down[0], down[1], down[2] = -inwards * normal[i, 0], ly - inwards * normal[i, 1], lz - inwards * normal[i, 2]
        sine = math.sqrt(down[0] * down[0] + down[1] * down[1] + down[2] * down[2])
        refracted = min(sine, 1.0) / INDEX
        shift = free * refracted / math.sqrt(1 - refracted * refracted) / max(sine, 1e-12)
        flat = max(math.sqrt(max(1 - normal[i, 0] * normal[i, 0], 0.0)), 1e-6)
        across[0] = (1 - normal[i, 0] * normal[i, 0]) / flat
        across[1], across[2] = -normal[i, 0] * normal[i, 1] / flat, -normal[i, 0] * normal[i, 2] / flat
        for k in range(len(places)):
            for a in range(3):
                out[i * len(places) + k, a] = xyz[i, a] + shift * down[a] + d * places[k] * across[a]
    return out, shares
