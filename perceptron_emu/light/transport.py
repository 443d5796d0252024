"""From the laser over a surface element to the chip: mean photo-electrons."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from geometry import Sensor
from geometry.compiled import kernel
from perceptron_emu.config import EmulatorConfig
from perceptron_emu.lens import Gather, gather, gathered
from perceptron_emu.light.sheet import Beam, Fan, across, beam, density_at, fan, width_at
from perceptron_emu.scene import Material

Array = NDArray[np.float64]
Index = NDArray[np.int64]
Surfaces = NDArray[np.void]

SURFACE = np.dtype([("diffuse", float), ("specular", float), ("roughness", float)])  # materials as a table

PLANCK_C_J_NM = 1.98644586e-16  # h·c in J·nm: a photon's energy is this over its wavelength


class LightPath(NamedTuple):
    """Laser, lens and chip in numbers, for compiled code. scale: electrons per exposure of the whole fan's light on the
    chip; origin of the laser, camera's centre and unit optical axis in {P} (3,) [mm].
    """

    scale: float
    origin: Array
    camera: Array
    axis: Array
    beam: Beam
    fan: Fan
    lens: Gather


class Cosines(NamedTuple):
    """Of the angles between a surface's normal and light, normal and camera, normal and halfway vector, light and
    halfway vector.
    """

    light: float
    camera: float
    halfway: float
    difference: float


@dataclass(frozen=True, eq=False)
class Light:
    """The laser, the lens and the chip's quantum yield of one exposure.

    Parameters
    ----------
    sensor : Sensor
        With a camera.
    config : EmulatorConfig
        Laser, lens, exposure and quantum yield.
    """

    sensor: Sensor
    config: EmulatorConfig

    def electrons(self, xyz_mm: Array, normal: Array, material: Material) -> Array:
        """Mean electrons per mm² of surface (...) at points (..., 3) [mm] with unit normals, nothing being in the way.

        E cos θᵢ · f_r · cos θₒ · Ω T · t · η λ/(hc), E = P f(φ)/s · g(x; w(s)) the sheet's irradiance [mW/mm²].
        """
        points, normals = (np.reshape(a, (-1, 3)) for a in (xyz_mm, normal))
        out = self.electrons_on(points, normals, [material], np.zeros(len(points), np.int64))
        return out.reshape(xyz_mm.shape[:-1])

    def electrons_on(self, xyz_mm: Array, normal: Array, materials: Sequence[Material], which: Index) -> Array:
        """The same at points (N, 3) of several materials, which[n] of them at point n."""
        out = np.empty(len(xyz_mm))
        points, normals = (np.ascontiguousarray(a, dtype=float) for a in (xyz_mm, normal))
        _electrons(points, normals, surfaces_of(materials), which, self.path, out)
        return out

    @cached_property
    def path(self) -> LightPath:
        """All of it in numbers, for compiled code."""
        laser, sensor = self.config.laser, self.sensor
        scale = laser.power_mw * self.electrons_per_mw(laser.wavelength_nm)
        T_sensor_camera = sensor.require_camera().T_sensor_camera
        origin, camera = np.array(sensor.sheet.origin_mm, dtype=float), np.array(T_sensor_camera.t, dtype=float)
        axis = np.array(T_sensor_camera.R[:, 2], dtype=float)
        lens = gather(self.config.optics, sensor, laser.wavelength_nm)
        return LightPath(scale, origin, camera, axis, beam(laser, sensor), fan(laser, sensor.sheet.fan_rad), lens)

    def electrons_per_mw(self, wavelength_nm: float) -> float:
        """Photo-electrons of one exposure per mW on the chip: t · η · λ/(hc)."""
        photons_per_mj = 1e-3 * wavelength_nm / PLANCK_C_J_NM
        return self.config.exposure.time_ms * 1e-3 * photons_per_mj * self.config.noise.quantum_efficiency


def surfaces_of(materials: Sequence[Material]) -> Surfaces:
    """Materials as a table, for compiled code."""
    return np.array([(m.diffuse, m.specular, m.roughness) for m in materials], SURFACE)


@kernel
def _electrons(xyz: Array, normal: Array, surfaces: Surfaces, which: Index, path: LightPath, out: Array) -> None:
    """Fill out (N,) for points xyz and unit normals (N, 3), which[n] of the surfaces (M,) at point n."""
    origin, camera, axis = path.origin, path.camera, path.axis
    for i in range(len(out)):
        ly, lz = origin[1] - xyz[i, 1], origin[2] - xyz[i, 2]  # the sheet's rays keep their distance from its middle
        s = math.sqrt(ly * ly + lz * lz)
        angle = math.atan2(-ly, -lz)
        ly, lz = ly / s, lz / s
        cx, cy, cz = camera[0] - xyz[i, 0], camera[1] - xyz[i, 1], camera[2] - xyz[i, 2]
        distance = math.sqrt(cx * cx + cy * cy + cz * cz)
        cx, cy, cz = cx / distance, cy / distance, cz / distance
        cos_i = normal[i, 1] * ly + normal[i, 2] * lz
        cos_o = normal[i, 0] * cx + normal[i, 1] * cy + normal[i, 2] * cz
        cosine = -(axis[0] * cx + axis[1] * cy + axis[2] * cz)
        if cos_i <= 0 or cos_o <= 0 or cosine <= 0:
            out[i] = 0
            continue
        hy, hz = ly + cy, lz + cz
        size = max(math.sqrt(cx * cx + hy * hy + hz * hz), 1e-12)
        cos_h = (normal[i, 0] * cx + normal[i, 1] * hy + normal[i, 2] * hz) / size
        scatter = brdf(surfaces[which[i]], Cosines(cos_i, cos_o, cos_h, (ly * hy + lz * hz) / size))
        irradiance = density_at(angle, path.fan) / s * across(xyz[i, 0], width_at(s, path.beam))
        out[i] = path.scale * irradiance * cos_i * cos_o * scatter * gathered(path.lens, cosine, distance)


@kernel(inline=True)
def brdf(surface: np.void, cosines: Cosines) -> float:
    """Bidirectional reflectance [1/sr] of one surface element.

    Lambert's ρ/π and a microfacet lobe D·G·F/(4 cos θᵢ cos θₒ): GGX distribution, Smith's separable shadowing,
    Schlick's Fresnel.
    Source: Walter, Marschner, Li & Torrance, "Microfacet Models for Refraction through Rough Surfaces", 2007.
    """
    diffuse: float = surface["diffuse"]
    specular: float = surface["specular"]
    if specular == 0:
        return diffuse / math.pi
    if cosines.light <= 0 or cosines.camera <= 0:
        return 0.0
    alpha2 = surface["roughness"] * surface["roughness"]
    cos_h, cos_d = max(cosines.halfway, 0.0), min(max(cosines.difference, 0.0), 1.0)
    spread = cos_h * cos_h * (alpha2 - 1) + 1
    distribution = alpha2 / (math.pi * spread * spread)
    fresnel = specular + (1 - specular) * (1 - cos_d) ** 5
    # D·F·G1(i)·G1(o)/(4 cos cos) with G1(c) = 2c/(c + √(α² + (1 − α²)c²)): the cosines cancel
    glossy: float = distribution * fresnel / (_smith(cosines.light, alpha2) * _smith(cosines.camera, alpha2))
    return diffuse / math.pi + glossy


@kernel(inline=True)
def _smith(cosine: float, alpha2: float) -> float:
    return cosine + math.sqrt(alpha2 + (1 - alpha2) * cosine * cosine)
