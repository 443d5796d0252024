"""The emulator's configuration: the emulation keys of sensor.toml, in physical units, each with its default."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import BaseModel, ConfigDict, Field


class Section(BaseModel):
    """A table of sensor.toml: unknown keys, NaN and infinities are errors."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False, defer_build=True)


class LaserConfig(Section):
    """[laser] beside origin_mm and fan_deg: the light of the sheet."""

    wavelength_nm: Annotated[float, Field(ge=200, le=2000)] = 660.0
    bandwidth_nm: Annotated[float, Field(gt=0, le=200, description="spectral full width at half maximum")] = 0.5
    power_mw: Annotated[float, Field(gt=0, description="optical power in the whole fan")] = 3.5
    waist_um: Annotated[float, Field(gt=0, description="1/e² half-width across the sheet at the waist")] = 230.0
    waist_distance_mm: Annotated[
        float | None, Field(gt=0, description="from the emitter along a ray; default: where the camera looks")
    ] = None
    m2: Annotated[float, Field(ge=1, description="beam quality M²")] = 1.2
    divergence: Annotated[bool, Field(description="false: the sheet has its waist's width everywhere")] = True
    profile: Literal["powell", "gaussian", "uniform"] = "powell"
    edge_fraction: Annotated[
        float, Field(gt=0, le=1, description="angular power density at the fan's edge over its middle")
    ] = 0.8


class OpticsConfig(Section):
    """[optics]: lens, stop, filter and what they do to the image."""

    pixel_um: Annotated[float, Field(gt=0, le=100, description="pixel pitch")] = 5.3
    f_number: Annotated[float, Field(ge=0.5, le=64)] = 4.0
    blur_px: Annotated[float, Field(gt=0.2, le=20, description="σ of the lens's own Gaussian blur in focus")] = 0.9
    blur_corner_px: Annotated[
        float | None,
        Field(gt=0.2, le=20, description="the same in the image's farthest corner; default: blur_px everywhere"),
    ] = None
    veiling_glare: Annotated[
        float, Field(ge=0, le=0.5, description="part of the light that the lens scatters evenly over the image")
    ] = 0.0
    diffraction: bool = True
    defocus: Annotated[bool, Field(description="thin-lens blur; a tilted chip (τx, τy) is taken into account")] = False
    aperture_points: Annotated[
        int,
        Field(
            ge=1,
            le=200,
            description="points of the entrance pupil that an edge before the lens hides one by one; 1: a pinhole's",
        ),
    ] = 1
    focus_distance_mm: Annotated[
        float | None,
        Field(
            gt=0, description="in focus on the optical axis, from the camera's centre; default: the sheet on the axis"
        ),
    ] = None
    vignetting: bool = True
    transmission: Annotated[float, Field(gt=0, le=1, description="of the lens")] = 0.85
    filter_peak: Annotated[float, Field(gt=0, le=1, description="peak transmission of the interference filter")] = 0.9
    filter_centre_nm: Annotated[
        float | None, Field(gt=0, description="at normal incidence; default: the laser's wavelength")
    ] = None
    filter_fwhm_nm: Annotated[float, Field(gt=0, description="pass band; widen to 1000 for no filter")] = 25.0
    filter_index: Annotated[float, Field(gt=1, description="effective index that rules the shift with angle")] = 2.0


class ThreadConfig(Section):
    """[surface]: the strings' thread, unless the scene says otherwise."""

    diffuse: Annotated[float, Field(ge=0, le=1, description="albedo of the matte part")] = 0.6
    specular: Annotated[
        float, Field(ge=0, le=1, description="reflectance of the glossy part at normal incidence; 0: matte")
    ] = 0.05
    roughness: Annotated[float, Field(ge=0.02, le=1, description="GGX α of the glossy part")] = 0.35


class SpeckleConfig(Section):
    """[speckle]: interference of the laser's light on a rough surface."""

    enabled: bool = True
    contrast: Annotated[
        float | None,
        Field(ge=0, le=1, description="before the pixel averages; default: from polarisation, bandwidth and depth"),
    ] = None
    polarised: Annotated[
        bool, Field(description="surface keeps polarisation (metal); otherwise two independent patterns")
    ] = False
    roughness_um: Annotated[
        float, Field(ge=0, description="rms depth that the light is scattered from; with the bandwidth")
    ] = 20.0


class LightConfig(Section):
    """[light]: what the laser's light does after it was scattered once."""

    bounces: Annotated[
        bool, Field(description="light that a lit surface sends to another: mirrored lines, mirror images, glow")
    ] = False


class AmbientConfig(Section):
    """[ambient]: room light that shows the scene dimly."""

    enabled: bool = True
    irradiance_mw_m2_nm: Annotated[
        float, Field(ge=0, description="spectral irradiance on a surface facing the light")
    ] = 10.0
    direction: Annotated[tuple[float, float, float], Field(description="light travels along, in {P}")] = (
        0.5,
        -0.2,
        0.8,
    )
    fill: Annotated[float, Field(ge=0, le=1, description="part of it that comes from everywhere")] = 0.25
    shadows: Annotated[
        bool, Field(description="solids shade one another from the rest of it; the part from everywhere has no shadows")
    ] = False
    samples: Annotated[
        int, Field(ge=1, le=16, description="of a pixel along each side: with one, edges may lie 0.05 px aside")
    ] = 1


class NoiseConfig(Section):
    """[noise]: the camera by EMVA 1288's linear model."""

    enabled: bool = True
    quantum_efficiency: Annotated[float, Field(gt=0, le=1)] = 0.45
    full_well_e: Annotated[float, Field(gt=10)] = 10_000.0
    gain_dn_per_e: Annotated[
        float | None, Field(gt=0, description="default: the full well fills the grey levels above black")
    ] = None
    read_noise_e: Annotated[float, Field(ge=0)] = 14.0
    dark_current_e_s: Annotated[float, Field(ge=0)] = 50.0
    dsnu_e: Annotated[float, Field(ge=0, description="σ of the pixels' own offsets")] = 6.0
    adc_bits: Annotated[
        Literal[8, 10, 12, 14, 16] | None, Field(description="of one exposure of an HDR image; default: the image's")
    ] = None
    prnu: Annotated[float, Field(ge=0, le=0.5, description="σ of the pixels' own gains")] = 0.008
    pattern_seed: Annotated[int, Field(ge=0, description="which camera: its fixed pattern")] = 1
    shot: bool = True


class ExposureConfig(Section):
    """[exposure]: time, shutter, and how often."""

    time_ms: Annotated[float, Field(gt=0, le=60_000)] = 1.2
    laser_on: Annotated[bool, Field(description="false: the ambient-only partner of a frame")] = True
    hdr_ratios: Annotated[
        tuple[Annotated[float, Field(gt=0, le=1)], ...],
        Field(max_length=8, description="further, shorter exposures as parts of time_ms, merged into one image"),
    ] = ()
    shutter: Literal["global", "rolling"] = "global"
    row_time_us: Annotated[float, Field(ge=0, description="a rolling shutter's delay from row to row")] = 20.0


class MotionConfig(Section):
    """[motion]: the sensor's velocity during the exposure, along and about its own axes; the pose is that at
    mid-exposure.
    """

    velocity_mm_s: tuple[float, float, float] = (0.0, 0.0, 0.0)
    angular_deg_s: tuple[float, float, float] = (0.0, 0.0, 0.0)
    samples: Annotated[int, Field(ge=1, le=200)] = 9


class EmulatorConfig(Section):
    """Everything that the emulator reads of sensor.toml; each section is a table of the file.

    Parameters
    ----------
    laser : LaserConfig
        The light of the sheet.
    optics : OpticsConfig
        Lens, stop, filter.
    surface : ThreadConfig
        The strings' thread.
    speckle : SpeckleConfig
        Interference on a rough surface.
    light : LightConfig
        What is scattered twice.
    ambient : AmbientConfig
        Room light.
    noise : NoiseConfig
        The chip.
    exposure : ExposureConfig
        Time, shutter, HDR.
    motion : MotionConfig
        The sensor's velocity.

    Raises
    ------
    pydantic.ValidationError
        For unknown keys, values out of range, NaN and infinities.
    """

    laser: LaserConfig = Field(default_factory=LaserConfig)
    optics: OpticsConfig = Field(default_factory=OpticsConfig)
    surface: ThreadConfig = Field(default_factory=ThreadConfig)
    speckle: SpeckleConfig = Field(default_factory=SpeckleConfig)
    light: LightConfig = Field(default_factory=LightConfig)
    ambient: AmbientConfig = Field(default_factory=AmbientConfig)
    noise: NoiseConfig = Field(default_factory=NoiseConfig)
    exposure: ExposureConfig = Field(default_factory=ExposureConfig)
    motion: MotionConfig = Field(default_factory=MotionConfig)

    def off(self, *effects: str) -> EmulatorConfig:
        """The same configuration with the named effects switched off: any of "noise", "speckle", "ambient"."""
        changes = {name: getattr(self, name).model_copy(update={"enabled": False}) for name in effects}
        return self.model_copy(update=changes)
