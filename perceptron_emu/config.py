"""The emulator's configuration: the emulation keys of sensor.toml, in physical units, each with its default."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Literal

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from geometry import InputError


class Section(BaseModel):
    """A table of sensor.toml: unknown keys, NaN and infinities are errors."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)


class LaserConfig(Section):
    """[laser] beside origin_mm and fan_deg: the light of the sheet."""

    wavelength_nm: float = Field(660.0, ge=200, le=2000)
    bandwidth_nm: float = Field(0.5, gt=0, le=200, description="spectral full width at half maximum")
    power_mw: float = Field(3.5, gt=0, description="optical power in the whole fan")
    waist_um: float = Field(200.0, gt=0, description="1/e² half-width across the sheet at the waist")
    waist_distance_mm: float | None = Field(
        None, gt=0, description="from the emitter along a ray; default: where the camera looks"
    )
    m2: float = Field(1.2, ge=1, description="beam quality M²")
    divergence: bool = Field(True, description="false: the sheet has its waist's width everywhere")
    profile: Literal["powell", "gaussian", "uniform"] = "powell"
    edge_fraction: float = Field(0.8, gt=0, le=1, description="angular power density at the fan's edge over its middle")


class OpticsConfig(Section):
    """[optics]: lens, stop, filter and what they do to the image."""

    pixel_um: float = Field(5.3, gt=0, le=100, description="pixel pitch")
    f_number: float = Field(4.0, ge=0.5, le=64)
    blur_px: float = Field(0.75, gt=0.2, le=20, description="σ of the lens's own Gaussian blur in focus")
    diffraction: bool = True
    defocus: bool = Field(False, description="thin-lens blur; a tilted chip (τx, τy) is taken into account")
    focus_distance_mm: float | None = Field(
        None, gt=0, description="in focus on the optical axis, from the camera's centre; default: the sheet on the axis"
    )
    vignetting: bool = True
    transmission: float = Field(0.85, gt=0, le=1, description="of the lens")
    filter_peak: float = Field(0.9, gt=0, le=1, description="peak transmission of the interference filter")
    filter_centre_nm: float | None = Field(
        None, gt=0, description="at normal incidence; default: the laser's wavelength"
    )
    filter_fwhm_nm: float = Field(25.0, gt=0, description="pass band; widen to 1000 for no filter")
    filter_index: float = Field(2.0, gt=1, description="effective index that rules the shift with angle")


class SurfaceConfig(Section):
    """[surface]: the strings' thread, unless the scene says otherwise."""

    diffuse: float = Field(0.6, ge=0, le=1, description="albedo of the matte part")
    specular: float = Field(
        0.05, ge=0, le=1, description="reflectance of the glossy part at normal incidence; 0: matte"
    )
    roughness: float = Field(0.35, ge=0.02, le=1, description="GGX α of the glossy part")


class SpeckleConfig(Section):
    """[speckle]: interference of the laser's light on a rough surface."""

    enabled: bool = True
    contrast: float | None = Field(
        None, ge=0, le=1, description="before the pixel averages; default: from polarisation, bandwidth and depth"
    )
    polarised: bool = Field(False, description="surface keeps polarisation (metal); otherwise two independent patterns")
    roughness_um: float = Field(
        30.0, ge=0, description="rms depth that the light is scattered from; with the bandwidth"
    )


class AmbientConfig(Section):
    """[ambient]: room light that shows the scene dimly."""

    enabled: bool = True
    irradiance_mw_m2_nm: float = Field(2.0, ge=0, description="spectral irradiance on a surface facing the light")
    direction: tuple[float, float, float] = Field((0.5, -0.2, 0.8), description="light travels along, in {P}")
    fill: float = Field(0.25, ge=0, le=1, description="part of it that comes from everywhere")


class NoiseConfig(Section):
    """[noise]: the camera by EMVA 1288's linear model."""

    enabled: bool = True
    quantum_efficiency: float = Field(0.45, gt=0, le=1)
    full_well_e: float = Field(10_000.0, gt=10)
    gain_dn_per_e: float | None = Field(
        None, gt=0, description="default: the full well fills the grey levels above black"
    )
    read_noise_e: float = Field(14.0, ge=0)
    dark_current_e_s: float = Field(50.0, ge=0)
    dsnu_e: float = Field(2.0, ge=0, description="σ of the pixels' own offsets")
    prnu: float = Field(0.008, ge=0, le=0.5, description="σ of the pixels' own gains")
    pattern_seed: int = Field(1, ge=0, description="which camera: its fixed pattern")
    shot: bool = True


class ExposureConfig(Section):
    """[exposure]: time, and how often."""

    time_ms: float = Field(2.0, gt=0, le=60_000)
    hdr_ratios: tuple[float, ...] = Field(
        (), description="further exposures as factors of time_ms, merged into one image"
    )
    laser_on: bool = Field(True, description="false: the ambient-only partner frame")


class MotionConfig(Section):
    """[motion]: the hand's velocity during the exposure, in the sensor's own axes."""

    velocity_mm_s: tuple[float, float, float] = (0.0, 0.0, 0.0)
    angular_deg_s: tuple[float, float, float] = (0.0, 0.0, 0.0)
    samples: int = Field(9, ge=1, le=200)


class EmulatorConfig(Section):
    """Everything that the emulator reads of sensor.toml; each section is a table of the file."""

    laser: LaserConfig = LaserConfig()
    optics: OpticsConfig = OpticsConfig()
    surface: SurfaceConfig = SurfaceConfig()
    speckle: SpeckleConfig = SpeckleConfig()
    ambient: AmbientConfig = AmbientConfig()
    noise: NoiseConfig = NoiseConfig()
    exposure: ExposureConfig = ExposureConfig()
    motion: MotionConfig = MotionConfig()

    @classmethod
    def sections(cls) -> dict[str, tuple[str, ...]]:
        """The emulator's keys by table, so that a reader of sensor.toml can tell them from the geometry's and from mistakes."""
        sections = {name: field.annotation for name, field in cls.model_fields.items()}
        return {
            name: tuple(s.model_fields)
            for name, s in sections.items()
            if isinstance(s, type) and issubclass(s, Section)
        }

    @classmethod
    def from_tables(cls, tables: Mapping[str, Any]) -> EmulatorConfig:
        """The configuration in the tables of a sensor.toml; keys and tables that are not the emulator's are passed over.

        Raises InputError naming table and key where a value can not be.
        """
        known = cls.sections()
        own = {
            name: {key: value for key, value in tables[name].items() if key in keys}
            for name, keys in known.items()
            if isinstance(tables.get(name), Mapping)
        }
        try:
            return cls.model_validate(own)
        except ValidationError as error:
            first = error.errors()[0]
            table, *key = (str(part) for part in first["loc"])
            raise InputError(f"[{table}] {'.'.join(key)} = {first['input']!r}: {first['msg']}") from error

    def off(self, *effects: str) -> EmulatorConfig:
        """The same configuration with the named effects switched off: any of "noise", "speckle", "ambient"."""
        changes = {name: getattr(self, name).model_copy(update={"enabled": False}) for name in effects}
        return self.model_copy(update=changes)
