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
from perceptron_emu.light.sheet import SHEET_REACH, STEP, Beam, beam, width_at
from perceptron_emu.light.transport import Light
from perceptron_emu.scene import Material

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

MATTE_NODES, NODES_A_LOBE, MAX_ARC_NODES = 8, 5, 120  # 8 + 5/α nodes give the centroid to 2e-5 px for α ≥ 0.05
MAX_LENGTH_NODES = 400  # along a string: met where it lies almost in the sheet, a blur's σ apart over some 400 px
ALONG_SHEET = 1e-9  # the least slope of a string across the sheet that is divided by
LEAST_SLOPE = 1e-6  # below, the lines of the arc are not told apart in where they cross the sheet


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


class Tubes(NamedTuple):
    """Cylinders for compiled code: starts, unit directions (S, 3), lengths (S,) and the radius [mm]."""

    starts: Array
    directions: Array
    lengths: Array
    radius: float


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
    camera = sensor.require_camera()
    origin, centre = np.array(sensor.sheet.origin_mm, dtype=float), np.array(camera.centre_mm, dtype=float)
    middle = np.where(
        np.isnan(strings.crossing), strings.starts + strings.directions * strings.lengths[:, None] / 2, strings.crossing
    )
    nodes, weights = _gauss(_arc_nodes(material))
    normal, psi_weight = _arcs(strings.directions, middle, strings.radius, (origin, centre), (nodes, weights))
    sharp = sharp_sigma_px(config.optics, sensor, config.laser.wavelength_nm) / max(camera.fx_px, camera.fy_px)
    tubes = Tubes(strings.starts, strings.directions, strings.lengths, strings.radius)
    reach, count = _reaches(tubes, middle, (origin, centre), sharp, beam(config.laser, sensor))
    xyz, facing, area = _nodes(tubes, middle, normal, psi_weight, (reach, np.linspace(-1, 1, count)))
    return LitStrings(xyz, light.electrons(xyz, facing, material) * area)


@lru_cache(maxsize=64)
def _gauss(count: int) -> tuple[Array, Array]:
    nodes, weights = np.polynomial.legendre.leggauss(count)
    return np.asarray(nodes), np.asarray(weights)


def _arc_nodes(material: Material) -> int:
    """Gauss nodes around the arc: the matte part is nearly a polynomial, a glossy lobe of width α is not."""
    if material.specular == 0:
        return MATTE_NODES
    return min(MAX_ARC_NODES, MATTE_NODES + round(NODES_A_LOBE / material.roughness))


@kernel
def _arcs(
    directions: Array, middle: Array, radius: float, eyes: tuple[Array, Array], gauss: tuple[Array, Array]
) -> tuple[Array, Array]:
    """Outward normals (S, K, 3) over the arc that emitter and camera (the eyes) both reach, and weights (S, K) [rad],
    0 where there is none.
    """
    nodes, weights = gauss
    normal, weight = np.empty((len(directions), len(nodes), 3)), np.empty((len(directions), len(nodes)))
    first, second, centre, half = np.empty(3), np.empty(3), np.empty(2), np.empty(2)
    for s in range(len(directions)):
        d = directions[s]
        if abs(d[2]) < 0.9:
            first[0], first[1], first[2] = d[1], -d[0], 0.0
        else:
            first[0], first[1], first[2] = -d[2], 0.0, d[0]
        size = math.sqrt(first[0] * first[0] + first[1] * first[1] + first[2] * first[2])
        for a in range(3):
            first[a] /= size
        for a in range(3):
            b, c = (a + 1) % 3, (a + 2) % 3
            second[a] = d[b] * first[c] - d[c] * first[b]
        for e in range(2):
            x, y = 0.0, 0.0
            for a in range(3):
                x += (eyes[e][a] - middle[s, a]) * first[a]
                y += (eyes[e][a] - middle[s, a]) * second[a]
            centre[e] = math.atan2(y, x)
            half[e] = math.acos(min(radius / math.sqrt(x * x + y * y), 1.0))
        gap = (centre[1] - centre[0] + math.pi) % (2 * math.pi) - math.pi
        low, high = max(-half[0], gap - half[1]), min(half[0], gap + half[1])
        span = max(high - low, 0.0)
        for k in range(len(nodes)):
            psi = centre[0] + (low + high) / 2 + span / 2 * nodes[k]
            weight[s, k] = span / 2 * weights[k]
            for a in range(3):
                normal[s, k, a] = math.cos(psi) * first[a] + math.sin(psi) * second[a]
    return normal, weight


@kernel
def _reaches(tubes: Tubes, middle: Array, eyes: tuple[Array, Array], sharp_rad: float, beam: Beam) -> tuple[Array, int]:
    """How far along each axis nodes are needed to either side (S,) [mm], and how many nodes serve all strings.

    sharp_rad: the image's blur as seen from the camera.
    """
    reach, most = np.empty(len(middle)), 1.0
    for s in range(len(middle)):
        distance, depth = 0.0, 0.0
        for a in range(3):
            distance += (middle[s, a] - eyes[0][a]) ** 2
            depth += (middle[s, a] - eyes[1][a]) ** 2
        sigma = width_at(math.sqrt(distance), beam) / 2 / max(abs(tubes.directions[s, 0]), ALONG_SHEET)
        reach[s] = min(SHEET_REACH * sigma, tubes.lengths[s])
        most = max(most, math.ceil(2 * reach[s] / (STEP * min(sigma, sharp_rad * math.sqrt(depth)))))
    return reach, int(min(max(most, 9), MAX_LENGTH_NODES))


@kernel
def _nodes(
    tubes: Tubes, middle: Array, normal: Array, arc_weight: Array, axis: tuple[Array, Array]
) -> tuple[Array, Array, Array]:
    """Points and normals (S, T, K, 3) [mm] in {P}, and the area (S, T, K) [mm²] that each stands for: along the axes
    centred where each line of the arc crosses x = 0. axis: reach (S,), and the nodes (T,) in −1 … 1.
    """
    (starts, directions, lengths, radius), (reach, nodes) = tubes, axis
    shape = len(starts), len(nodes), normal.shape[1]
    xyz, facing, area = np.empty((*shape, 3)), np.empty((*shape, 3)), np.empty(shape)
    for s in range(shape[0]):
        d, along = directions[s], 0.0
        for a in range(3):
            along += (middle[s, a] - starts[s, a]) * d[a]
        slope = max(abs(d[0]), ALONG_SHEET)
        step = 2 * reach[s] / (len(nodes) - 1)
        for j in range(shape[1]):
            for k in range(shape[2]):
                offset = 0.0
                if slope > LEAST_SLOPE:
                    offset = -radius * normal[s, k, 0] / (-slope if d[0] < 0 else slope)
                t = along + offset + reach[s] * nodes[j]
                area[s, j, k] = radius * arc_weight[s, k] * step if 0 <= t <= lengths[s] else 0.0
                for a in range(3):
                    facing[s, j, k, a] = normal[s, k, a]
                    xyz[s, j, k, a] = starts[s, a] + t * d[a] + radius * normal[s, k, a]
    return xyz, facing, area


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
