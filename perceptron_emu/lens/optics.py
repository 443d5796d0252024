"""The lens: how much light it gathers and how sharply it draws."""

from __future__ import annotations

import math
from functools import lru_cache
from typing import NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray

from geometry import Sensor
from geometry.compiled import kernel
from perceptron_emu.config import OpticsConfig
from perceptron_emu.lens.projection import lens, tilt_rotation

Array = NDArray[np.float64]
N = TypeVar("N", float, Array)

LN2 = math.log(2)
INFINITY_MM = 1e9  # in focus where the optical axis never meets the sheet
AIRY_SIGMA = 0.42  # σ of the Gaussian nearest to Airy's disc, in units of λN (Zhang, Zerubia & Olivo-Marin 2007)


def principal_distance_mm(optics: OpticsConfig, sensor: Sensor) -> float:
    """From the rear principal point to the chip: the camera constant of the calibrated intrinsics.

    Parameters
    ----------
    optics : OpticsConfig
        Its pixel pitch.
    sensor : Sensor
        Its focal lengths in pixels.

    Returns
    -------
    float
        [mm].
    """
    camera = sensor.require_camera()
    return (camera.fx_px + camera.fy_px) / 2 * optics.pixel_um * 1e-3


def focus_distance_mm(optics: OpticsConfig, sensor: Sensor) -> float:
    """Distance in focus along the optical axis.

    Parameters
    ----------
    optics : OpticsConfig
        Its focus_distance_mm, where given, is the answer.
    sensor : Sensor
        With a camera.

    Returns
    -------
    float
        From the camera's centre [mm]; by default to where the axis meets the sheet.
    """
    camera = sensor.require_camera()
    if optics.focus_distance_mm is not None:
        return optics.focus_distance_mm
    towards = camera.T_sensor_camera.R[0, 2]
    to_sheet = -camera.centre_mm[0] / towards if towards else np.inf
    return float(to_sheet) if 0 < to_sheet < np.inf else INFINITY_MM


def focal_length_mm(optics: OpticsConfig, sensor: Sensor) -> float:
    """Focal length of the thin lens that is in focus there: 1/f = 1/u + 1/v.

    Parameters
    ----------
    optics : OpticsConfig
        The lens.
    sensor : Sensor
        With a camera.

    Returns
    -------
    float
        [mm].
    """
    return 1 / (1 / principal_distance_mm(optics, sensor) + 1 / focus_distance_mm(optics, sensor))


@lru_cache(maxsize=32)
def pupil_points_mm(optics: OpticsConfig, sensor: Sensor) -> Array:
    """Points that fill the entrance pupil evenly: what an edge hides from some of them alone is dimmed, not dark.

    Parameters
    ----------
    optics : OpticsConfig
        The lens, and how many points.
    sensor : Sensor
        With a camera.

    Returns
    -------
    Array
        (N, 3) [mm] in {P}; the camera's centre where there is one.

    References
    ----------
    Vogel, "A better way to construct the sunflower head", Mathematical Biosciences 44, 1979.
    """
    pose, count = sensor.require_camera().T_sensor_camera, optics.aperture_points
    if count == 1:
        return np.array(pose.t, dtype=float)[None]
    radius = focal_length_mm(optics, sensor) / optics.f_number / 2
    points = np.empty((count, 3))
    for k in range(count):
        distance, turn = radius * math.sqrt((k + 0.5) / count), k * math.pi * (3 - math.sqrt(5))
        points[k] = distance * math.cos(turn), distance * math.sin(turn), 0.0
    return np.asarray(points @ pose.R.T + pose.t)


class Band(NamedTuple):
    """The interference filter before light of one wavelength: its centre and half its width [nm], the square of its
    effective index, its peak transmission.
    """

    wavelength_nm: float
    centre_nm: float
    half_nm: float
    index2: float
    peak: float


class Gather(NamedTuple):
    """What `gathered` needs to know of lens and filter.

    Parameters
    ----------
    pupil_sr_mm2 : float
        Area of the entrance pupil times the lens's transmission [mm²].
    vignetting : bool
        Whether the image darkens by cos⁴.
    band : Band
        The filter before the light's wavelength.
    """

    pupil_sr_mm2: float
    vignetting: bool
    band: Band


def gather(optics: OpticsConfig, sensor: Sensor, wavelength_nm: float) -> Gather:
    """Lens and filter for light of one wavelength.

    Parameters
    ----------
    optics : OpticsConfig
        The lens.
    sensor : Sensor
        With a camera.
    wavelength_nm : float
        Of the light, and of the filter's centre where none is given.

    Returns
    -------
    Gather
        For `gathered`.
    """
    pupil = focal_length_mm(optics, sensor) / optics.f_number
    return Gather(
        float(np.pi / 4 * pupil**2 * optics.transmission),
        optics.vignetting,
        _band(optics, wavelength_nm, wavelength_nm),
    )


@kernel(inline=True)
def gathered(lens: Gather, cosine: float, distance: float) -> float:
    """Solid angle of the entrance pupil seen from a point, times the lens's and filter's transmission.

    Ω = (π D²/4) cos α / r². With the foreshortened area of a pixel's footprint this gives the cos⁴ law, which is
    divided out where vignetting is off. Compiled, for one point.

    Parameters
    ----------
    lens : Gather
        As made by `gather`.
    cosine : float
        Of the angle between the optical axis and the way to the point.
    distance : float
        From the camera's centre [mm].

    Returns
    -------
    float
        [sr].
    """
    solid = lens.pupil_sr_mm2 * cosine / (distance * distance)
    if not lens.vignetting:
        solid /= cosine**4
    return solid * passed(lens.band, cosine)


def filter_transmission(optics: OpticsConfig, wavelength_nm: float, cosine: Array, laser_nm: float) -> Array:
    """Transmission of the interference filter, whose centre moves to shorter waves for slanted light.

    Parameters
    ----------
    optics : OpticsConfig
        The filter.
    wavelength_nm : float
        Of the light.
    cosine : Array
        (...) of the angle to the filter's normal.
    laser_nm : float
        The filter's centre where none is given.

    Returns
    -------
    Array
        (...) in [0, 1].

    References
    ----------
    Macleod, Thin-Film Optical Filters.
    """
    return np.asarray(passed(_band(optics, wavelength_nm, laser_nm), np.asarray(cosine, dtype=float)))


def _band(optics: OpticsConfig, wavelength_nm: float, laser_nm: float) -> Band:
    centre = float(optics.filter_centre_nm or laser_nm)
    return Band(float(wavelength_nm), centre, optics.filter_fwhm_nm / 2, optics.filter_index**2, optics.filter_peak)


@kernel(inline=True)
def passed(band: Band, cosine: N) -> N:
    """Transmission of the filter: its centre moves to λ₀ √(1 − (sin θ/n)²) (Macleod, Thin-Film Optical Filters); the
    pass band is a Gaussian of order 4 (flat top).
    """
    off = (band.wavelength_nm - band.centre_nm * np.sqrt(1 - (1 - cosine * cosine) / band.index2)) / band.half_nm
    transmission: N = band.peak * np.exp(-LN2 * off * off * off * off)
    return transmission


def sharp_sigma_px(optics: OpticsConfig, sensor: Sensor, wavelength_nm: float) -> float:
    """Blur in focus: the lens's own and diffraction's, added in variance.

    Parameters
    ----------
    optics : OpticsConfig
        The lens.
    sensor : Sensor
        With a camera.
    wavelength_nm : float
        Of the light.

    Returns
    -------
    float
        σ [px].

    References
    ----------
    Zhang, Zerubia & Olivo-Marin, "Gaussian approximations of fluorescence microscope point-spread functions", 2007.
    """
    airy = AIRY_SIGMA * wavelength_nm * 1e-3 * working_f_number(optics, sensor) / optics.pixel_um
    return float(np.hypot(optics.blur_px, airy if optics.diffraction else 0.0))


def field_sigma_px(optics: OpticsConfig, sensor: Sensor, uv: Array, wavelength_nm: float) -> Array:
    """Blur in focus at places of the image.

    A curved field of focus leaves a disc that grows like the square of the distance from the principal point: its
    variance, like the fourth power, is added to that of the middle, up to blur_corner_px in the farthest corner.

    Parameters
    ----------
    optics : OpticsConfig
        The lens.
    sensor : Sensor
        With a camera.
    uv : Array
        (N, 2) [px].
    wavelength_nm : float
        Of the light.

    Returns
    -------
    Array
        σ (N,) [px].

    References
    ----------
    Born & Wolf, Principles of Optics, section 5.3 (field curvature; Petzval).
    """
    middle = sharp_sigma_px(optics, sensor, wavelength_nm)
    if optics.blur_corner_px is None:
        return np.full(len(uv), middle)
    camera = sensor.require_camera()
    half = (
        max(camera.cx_px, camera.width_px - 1 - camera.cx_px),
        max(camera.cy_px, camera.height_px - 1 - camera.cy_px),
    )
    square = ((uv[:, 0] - camera.cx_px) ** 2 + (uv[:, 1] - camera.cy_px) ** 2) / (half[0] ** 2 + half[1] ** 2)
    more = optics.blur_corner_px**2 - optics.blur_px**2
    return np.asarray(np.sqrt(middle**2 + more * np.minimum(square, 1) ** 2))


def working_f_number(optics: OpticsConfig, sensor: Sensor) -> float:
    """The f-number at work, F#·(1 + m), m the magnification at the distance in focus: v/D of the thin lens.

    Parameters
    ----------
    optics : OpticsConfig
        The lens.
    sensor : Sensor
        With a camera.

    Returns
    -------
    float
        Dimensionless.
    """
    v = principal_distance_mm(optics, sensor)
    return optics.f_number * v / focal_length_mm(optics, sensor)


def defocus_radius_px(optics: OpticsConfig, sensor: Sensor, camera_mm: Array) -> Array:
    """Radius of the blur disc.

    Thin lens: the point at depth u is sharp at v' = f u/(u − f), the chip lies at v along the axis, on a tilted chip
    different in every pixel; the disc's diameter is D |v − v'|/v'. A Scheimpflug tilt that fits the sheet makes it
    vanish.

    Parameters
    ----------
    optics : OpticsConfig
        The lens; without defocus the radius is 0.
    sensor : Sensor
        With a camera.
    camera_mm : Array
        Points (..., 3) [mm] of the camera frame.

    Returns
    -------
    Array
        (...) [px].
    """
    if not optics.defocus:
        return np.zeros(camera_mm.shape[:-1])
    f, depth = focal_length_mm(optics, sensor), camera_mm[..., 2]
    sharp = f * depth / (depth - f)
    chip = principal_distance_mm(optics, sensor) * _chip_depth(sensor, camera_mm)
    diameter_mm = f / optics.f_number * np.abs(chip - sharp) / sharp
    return np.asarray(diameter_mm / 2 / (optics.pixel_um * 1e-3))


def _chip_depth(sensor: Sensor, camera_mm: Array) -> Array:
    """Axial distance of the chip where the points' chief rays meet it, in units of the principal distance."""
    tau_x, tau_y = sensor.require_camera().distortion14[12:]
    x, y = lens(sensor, camera_mm[..., 0] / camera_mm[..., 2], camera_mm[..., 1] / camera_mm[..., 2])
    normal = tilt_rotation(float(tau_x), float(tau_y))[2]  # the chip's normal in camera axes; the chip holds (0, 0, 1)
    return np.asarray(normal[2] / (normal[0] * x + normal[1] * y + normal[2]))
