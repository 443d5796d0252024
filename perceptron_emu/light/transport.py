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
from perceptron_emu.light.sheet import across, beam, density_at, fan, width_at
from perceptron_emu.scene import Material

Array = NDArray[np.float64]
Index = NDArray[np.int64]

PLANCK_C_J_NM = 1.98644586e-16  # h·c in J·nm: a photon's energy is this over its wavelength


class Source(NamedTuple):
    """Laser, lens and chip in numbers, for compiled code. scale: electrons per exposure of the whole fan's light on the
    chip; origin of the laser, camera's centre and unit optical axis in {P} (3,) [mm]; beam, fan, lens: as made by the
    functions of these names.
    """

    scale: float
    origin: Array
    camera: Array
    axis: Array
    beam: tuple[float, float, float]
    fan: tuple[int, float, float, float]
    lens: Gather


@dataclass(frozen=True, eq=False)
class Light:
    """The laser, the lens and the chip's quantum yield of one exposure."""

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
        surfaces = np.array([[m.diffuse, m.specular, m.roughness] for m in materials])
        _electrons(points, normals, self._source, surfaces, which, out)
        return out

    @cached_property
    def _source(self) -> Source:
        laser, sensor = self.config.laser, self.sensor
        scale = laser.power_mw * self.electrons_per_mw(laser.wavelength_nm)
        T_sensor_camera = sensor.require_camera().T_sensor_camera
        origin, camera = np.array(sensor.sheet.origin_mm, dtype=float), np.array(T_sensor_camera.t, dtype=float)
        axis = np.array(T_sensor_camera.R[:, 2], dtype=float)
        lens = gather(self.config.optics, sensor, laser.wavelength_nm)
        return Source(scale, origin, camera, axis, beam(laser, sensor), fan(laser, sensor.sheet.fan_rad), lens)

    def electrons_per_mw(self, wavelength_nm: float) -> float:
        """Photo-electrons of one exposure per mW on the chip: t · η · λ/(hc)."""
        photons_per_mj = 1e-3 * wavelength_nm / PLANCK_C_J_NM
        return self.config.exposure.time_ms * 1e-3 * photons_per_mj * self.config.noise.quantum_efficiency


@kernel
def _electrons(xyz, normal, source, surfaces, which, out):  # type: ignore[no-untyped-def]
    """Fill out (N,) for points xyz and unit normals (N, 3) of the surfaces (M, 3)."""
    origin, camera, axis = source.origin, source.camera, source.axis
    waist, waist_at, rayleigh = source.beam
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
        diffuse, specular, roughness = surfaces[which[i]]
        scatter = brdf(diffuse, specular, roughness, cos_i, cos_o, cos_h, (ly * hy + lz * hz) / size)
        irradiance = density_at(angle, source.fan) / s * across(xyz[i, 0], width_at(s, waist, waist_at, rayleigh))
        out[i] = source.scale * irradiance * cos_i * cos_o * scatter * gathered(source.lens, cosine, distance)


@kernel(inline=True)
def brdf(diffuse, specular, roughness, cos_i, cos_o, cos_h, cos_d):  # type: ignore[no-untyped-def]
    """Bidirectional reflectance [1/sr] of one surface element.

    cos_i, cos_o: of the angles between its normal and light, and camera; cos_h: normal and halfway vector; cos_d: light
    and halfway vector.
    Lambert's ρ/π and a microfacet lobe D·G·F/(4 cos θᵢ cos θₒ): GGX distribution, Smith's separable shadowing,
    Schlick's Fresnel.
    Source: Walter, Marschner, Li & Torrance, "Microfacet Models for Refraction through Rough Surfaces", 2007.
    """
    if specular == 0:
        return diffuse / math.pi
    if cos_i <= 0 or cos_o <= 0:
        return 0.0
    alpha2 = roughness * roughness
    cos_h, cos_d = max(cos_h, 0.0), min(max(cos_d, 0.0), 1.0)
    spread = cos_h * cos_h * (alpha2 - 1) + 1
    distribution = alpha2 / (math.pi * spread * spread)
    fresnel = specular + (1 - specular) * (1 - cos_d) ** 5
    # D·F·G1(i)·G1(o)/(4 cos cos) with G1(c) = 2c/(c + √(α² + (1 − α²)c²)): the cosines cancel
    return diffuse / math.pi + distribution * fresnel / (_smith(cos_i, alpha2) * _smith(cos_o, alpha2))


@kernel(inline=True)
def _smith(cosine, alpha2):  # type: ignore[no-untyped-def]
    return cosine + math.sqrt(alpha2 + (1 - alpha2) * cosine * cosine)
