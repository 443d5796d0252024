"""Strings under the laser: exact cylinders, shaded over the arc that is lit and seen."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from geometry import Pose, Sensor, cross_plane_x0
from geometry.compiled import kernel
from jig_cad import Jig
from perceptron_emu.config import EmulatorConfig
from perceptron_emu.lens import sharp_sigma_px
from perceptron_emu.light.sheet import SHEET_REACH, STEP, half_width_mm
from perceptron_emu.light.transport import Light
from perceptron_emu.scene import Material

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

MATTE_NODES, NODES_A_LOBE, MAX_ARC_NODES = 8, 5, 120  # 8 + 5/α nodes give the centroid to 2e-5 px for α ≥ 0.05
MAX_LENGTH_NODES = 400  # along a string: met where it lies almost in the sheet, a blur's σ apart over some 400 px
ALONG_SHEET = 1e-9  # the least slope of a string across the sheet that is divided by


@dataclass(frozen=True, eq=False)
class Cylinders:
    """The jig's strings as cylinders in {P}.

    Parameters
    ----------
    labels : tuple of str
        Names (S).
    starts, directions : Array
        (S, 3) [mm], unit.
    lengths : Array
        (S,) [mm].
    radius : float
        [mm].
    crossing : Array
        Where the axes meet the laser plane (S, 3) [mm], NaN for strings that do not reach it.
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
    """The strings of a jig at a pose.

    Parameters
    ----------
    jig : Jig
        The strings in the jig's axes.
    T_sensor_jig : Pose
        Its place in {P}.

    Returns
    -------
    Cylinders
        In the jig's order.
    """
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

    The power on a surface element is P f(φ)/s · g(x) · cos θᵢ dA; a pixel's share of it ∝ f_r cos θₒ Ω. Along the axis
    the nodes are equally spaced (the sheet is Gaussian there), around it Gauss-Legendre over exactly the arc that
    emitter and camera both reach.

    Parameters
    ----------
    strings : Cylinders
        In {P}.
    material : Material
        The thread.
    sensor : Sensor
        With a camera.
    config : EmulatorConfig
        Laser and lens.
    light : Light
        Of the same sensor and configuration.

    Returns
    -------
    LitStrings
        Shadows and occluders are left out of account.
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
    slope = np.maximum(np.abs(strings.directions[:, 0]), ALONG_SHEET)
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


def hidden_by_strings(strings: Cylinders, points: Array, sources: Array, own: NDArray[np.int64] | None = None) -> Mask:
    """Whether a string stands between points and sources; exact, ends not capped.

    Parameters
    ----------
    strings : Cylinders
        In {P}.
    points : Array
        (N, 3) [mm].
    sources : Array
        (N, 3) or (3,) [mm].
    own : NDArray, optional
        For points on strings, which one each lies on (N,); it does not hide them.

    Returns
    -------
    NDArray
        (N,) of bool.
    """
    points = np.array(points, dtype=float, order="C")
    sources = np.array(np.broadcast_to(sources, points.shape), dtype=float, order="C")
    own = np.full(len(points), -1) if own is None else np.array(own, dtype=np.int64)
    tubes = Tubes(np.array(strings.starts), np.array(strings.directions), np.array(strings.lengths), strings.radius)
    return np.asarray(_hidden(tubes, points, sources, own))


class Tubes(NamedTuple):
    """Cylinders for compiled code: starts, unit directions (S, 3), lengths (S,) and the radius [mm]."""

    starts: Array
    directions: Array
    lengths: Array
    radius: float


@kernel(fastmath=True)
def _hidden(tubes: Tubes, points: Array, sources: Array, own: NDArray[np.int64]) -> Mask:
    starts, directions, lengths, radius = tubes
    out = np.zeros(len(points), np.bool_)
    for i in range(len(points)):
        rx, ry, rz = sources[i, 0] - points[i, 0], sources[i, 1] - points[i, 1], sources[i, 2] - points[i, 2]
        for j in range(len(starts)):
            if j == own[i]:
                continue
            dx, dy, dz = directions[j, 0], directions[j, 1], directions[j, 2]
            ox, oy, oz = points[i, 0] - starts[j, 0], points[i, 1] - starts[j, 1], points[i, 2] - starts[j, 2]
            # the shortest distance of the two lines decides almost always
            cx, cy, cz = ry * dz - rz * dy, rz * dx - rx * dz, rx * dy - ry * dx
            across = cx * cx + cy * cy + cz * cz
            apart = ox * cx + oy * cy + oz * cz
            if apart * apart >= radius * radius * across:
                continue
            ray_along, off_along = rx * dx + ry * dy + rz * dz, ox * dx + oy * dy + oz * dz
            b = rx * ox + ry * oy + rz * oz - ray_along * off_along
            c = ox * ox + oy * oy + oz * oz - off_along * off_along - radius * radius
            root = math.sqrt(max(b * b - across * c, 0.0))
            for s in ((-b - root) / across, (-b + root) / across):
                height = off_along + s * ray_along
                if 0 < s < 1 and 0 <= height <= lengths[j]:
                    out[i] = True
            if out[i]:
                break
    return out
