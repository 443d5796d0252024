"""Strings under the laser: exact cylinders, shaded over the arc that is lit and seen."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from geometry import Pose, Sensor, cross_plane_x0
from jig_cad import Jig
from perceptron_emu.config import EmulatorConfig
from perceptron_emu.optics import sharp_sigma_px
from perceptron_emu.scene import Material
from perceptron_emu.sheet import SHEET_REACH, STEP, half_width_mm
from perceptron_emu.transport import Light

Array = NDArray[np.float64]

MATTE_NODES, NODES_A_LOBE, MAX_ARC_NODES = 8, 5, 120  # 8 + 5/α nodes give the centroid to 2e-5 px for α ≥ 0.05
MAX_LENGTH_NODES = 400


@dataclass(frozen=True, eq=False)
class Cylinders:
    """The jig's strings as cylinders in {P}: starts, unit directions (S, 3), lengths (S,) [mm], one radius [mm].

    crossing: where the axes meet the laser plane (S, 3), NaN for strings that do not reach it.
    """

    labels: tuple[str, ...]
    starts: Array
    directions: Array
    lengths: Array
    radius: float
    crossing: Array


@dataclass(frozen=True, eq=False)
class LitStrings:
    """Nodes (S, T, K) on the strings: T along the axis, K around the arc.

    xyz_mm: (S, T, K, 3) in {P}. electrons: (S, T, K) that each would bring to the chip were nothing in the way.
    """

    xyz_mm: Array
    electrons: Array


def cylinders(jig: Jig, T_sensor_jig: Pose) -> Cylinders:
    """The strings of a jig at a pose."""
    starts, ends = T_sensor_jig @ jig.starts, T_sensor_jig @ jig.ends
    along = ends - starts
    lengths = np.linalg.norm(along, axis=1)
    crossing, fraction = cross_plane_x0(starts, along)
    with np.errstate(invalid="ignore"):
        reached = (fraction >= 0) & (fraction <= 1)
    crossing = np.where(reached[:, None], crossing, np.nan)
    return Cylinders(jig.strings, starts, along / lengths[:, None], lengths, jig.string_diameter_mm / 2, crossing)


def light_strings(
    strings: Cylinders, material: Material, sensor: Sensor, config: EmulatorConfig, light: Light
) -> LitStrings:
    """Nodes over the lit and seen arc of every string, with the light that each sends to the camera.

    The power on a surface element is P f(φ)/s · g(x) · cos θᵢ dA; a pixel's share of it ∝ f_r cos θₒ Ω. Along the
    axis the nodes are
    equally spaced (the sheet is Gaussian there), around it Gauss-Legendre over exactly the arc that emitter and
    camera both reach.
    """
    middle = np.where(
        np.isnan(strings.crossing), strings.starts + strings.directions * strings.lengths[:, None] / 2, strings.crossing
    )
    normal, arc_weight = _arc(strings, middle, sensor, _arc_nodes(material))
    t, step = _axis_nodes(strings, middle, normal, sensor, config)
    inside = (t >= 0) & (t <= strings.lengths[:, None, None])
    xyz = (
        strings.starts[:, None, None]
        + t[..., None] * strings.directions[:, None, None]
        + strings.radius * normal[:, None]
    )
    area = strings.radius * arc_weight[:, None, :] * step[:, None, None] * inside
    return LitStrings(xyz, light.electrons(xyz, np.broadcast_to(normal[:, None], xyz.shape), material) * area)


@lru_cache(maxsize=64)
def _gauss(count: int) -> tuple[Array, Array]:
    nodes, weights = np.polynomial.legendre.leggauss(count)
    return np.asarray(nodes), np.asarray(weights)


def _arc_nodes(material: Material) -> int:
    """Gauss nodes around the arc: the matte part is nearly a polynomial, a glossy lobe of width α is not."""
    if material.specular == 0:
        return MATTE_NODES
    return min(MAX_ARC_NODES, MATTE_NODES + round(NODES_A_LOBE / material.roughness))


def _arc(strings: Cylinders, middle: Array, sensor: Sensor, count: int) -> tuple[Array, Array]:
    """Outward normals (S, K, 3) over the arc that is lit and seen, and weights (S, K) [rad]; weight 0 where there is
    none.
    """
    d = strings.directions
    first = np.cross(d, np.where(np.abs(d[:, 2:]) < 0.9, [[0, 0, 1.0]], [[0, 1.0, 0]]))
    first /= np.linalg.norm(first, axis=1, keepdims=True)
    second = np.cross(d, first)
    centre, half = [], []
    for source in (sensor.sheet.origin_mm, sensor.require_camera().centre_mm):
        a, b = np.sum((source - middle) * first, 1), np.sum((source - middle) * second, 1)
        centre.append(np.arctan2(b, a))
        half.append(np.arccos(np.minimum(strings.radius / np.hypot(a, b), 1)))
    gap = (centre[1] - centre[0] + np.pi) % (2 * np.pi) - np.pi
    low = np.maximum(-half[0], gap - half[1])
    high = np.minimum(half[0], gap + half[1])
    nodes, weights = _gauss(count)
    span = np.maximum(high - low, 0)[:, None]
    psi = centre[0][:, None] + (low + high)[:, None] / 2 + span / 2 * nodes
    normal = np.cos(psi)[..., None] * first[:, None] + np.sin(psi)[..., None] * second[:, None]
    return normal, span / 2 * weights


def _axis_nodes(
    strings: Cylinders, middle: Array, normal: Array, sensor: Sensor, config: EmulatorConfig
) -> tuple[Array, Array]:
    """Parameters t (S, T, K) [mm] along the axes, centred where each line of the arc crosses x = 0, and steps (S,)
    [mm].
    """
    camera = sensor.require_camera()
    slope = np.maximum(np.abs(strings.directions[:, 0]), 1e-9)
    sigma = half_width_mm(config.laser, sensor, np.linalg.norm(middle - sensor.sheet.origin_mm, axis=1)) / 2 / slope
    reach = np.minimum(SHEET_REACH * sigma, strings.lengths)
    depth = np.linalg.norm(middle - camera.centre_mm, axis=1)
    pixel = sharp_sigma_px(config.optics, sensor, config.laser.wavelength_nm) * depth / max(camera.fx_px, camera.fy_px)
    count = np.ceil(2 * reach / (STEP * np.minimum(sigma, pixel)))
    n = int(np.clip(np.max(count, initial=1), 9, MAX_LENGTH_NODES))
    along = np.sum((middle - strings.starts) * strings.directions, 1)
    signed = np.where(strings.directions[:, 0] < 0, -slope, slope)
    offset = np.where(slope[:, None] > 1e-6, -strings.radius * normal[..., 0] / signed[:, None], 0.0)
    nodes = np.linspace(-1, 1, n)
    t = along[:, None, None] + offset[:, None, :] + reach[:, None, None] * nodes[:, None]
    return t, 2 * reach / (n - 1)
