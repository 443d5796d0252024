"""From the laser over a surface element to the chip: mean photo-electrons."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from geometry import SensorModel
from perceptron_emu.brdf import brdf
from perceptron_emu.config import EmulatorConfig
from perceptron_emu.optics import gather_sr
from perceptron_emu.projection import to_camera
from perceptron_emu.scene import Material
from perceptron_emu.sheet import across, along, half_width_mm

Array = NDArray[np.float64]

PLANCK_C_J_NM = 1.98644586e-16  # h·c in J·nm: a photon's energy is this over its wavelength


@dataclass(frozen=True, eq=False)
class Light:
    """The laser, the lens and the chip's quantum yield of one exposure."""

    sensor: SensorModel
    config: EmulatorConfig

    def electrons(self, xyz_mm: Array, normal: Array, material: Material) -> Array:
        """Mean electrons per mm² of surface (...) at points (..., 3) [mm] with unit normals, nothing being in the way.

        E cos θᵢ · f_r · cos θₒ · Ω T · t · η λ/(hc), E = P f(φ)/s · g(x; w(s)) the sheet's irradiance [mW/mm²].
        """
        laser, sensor = self.config.laser, self.sensor
        to_light = sensor.laser_origin_mm - xyz_mm
        to_light[..., 0] = 0  # the sheet's rays keep their distance from its middle plane
        s = np.linalg.norm(to_light, axis=-1)
        angle = np.arctan2(-to_light[..., 1], -to_light[..., 2])
        irradiance = laser.power_mw * along(laser, sensor.fan_rad, angle) / s
        irradiance *= across(xyz_mm[..., 0], half_width_mm(laser, sensor, s))
        to_light /= s[..., None]
        to_camera_ = sensor.camera_centre_mm - xyz_mm
        to_camera_ /= np.linalg.norm(to_camera_, axis=-1, keepdims=True)
        cosines = np.maximum(np.einsum("...i,...i->...", normal, to_light), 0)
        cosines *= np.maximum(np.einsum("...i,...i->...", normal, to_camera_), 0)
        gather = gather_sr(self.config.optics, sensor, to_camera(sensor, xyz_mm), laser.wavelength_nm)
        scatter = brdf(material, normal, to_light, to_camera_)
        return np.asarray(irradiance * cosines * scatter * gather * self.electrons_per_mw(laser.wavelength_nm))

    def electrons_per_mw(self, wavelength_nm: float) -> float:
        """Photo-electrons of one exposure per mW on the chip: t · η · λ/(hc)."""
        photons_per_mj = 1e-3 * wavelength_nm / PLANCK_C_J_NM
        return self.config.exposure.time_ms * 1e-3 * photons_per_mj * self.config.noise.quantum_efficiency
