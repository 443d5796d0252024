"""The laser's light: a Gaussian sheet across, a fan along."""

from __future__ import annotations

import math
from functools import lru_cache
from typing import NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray

from geometry import Sensor, field_of_view
from geometry.compiled import kernel
from perceptron_emu.config import LaserConfig

Array = NDArray[np.float64]
N = TypeVar("N", float, Array)

SHEET_REACH = 3.6  # standard deviations of the sheet's thickness to either side: 3e-4 of the light lies beyond
STEP = 1.0  # trapezoid step over a Gaussian's σ: relative error 2 exp(−2π²) = 5e-9
PROFILES = ("powell", "gaussian", "uniform")
POWELL, GAUSSIAN = 0, 1  # places among the profiles
SHOULDER = 0.02  # σ of the Powell fan's edge, of half the fan; an assumption
MAX_DISTANCE_MM = 5000.0  # an optical axis that meets the sheet farther off says nothing about where to focus


class Beam(NamedTuple):
    """The sheet across: its waist, the waist's distance from the emitter, and the distance from there over which it
    widens by √2 (infinite without divergence) [mm].
    """

    waist_mm: float
    at_mm: float
    rayleigh_mm: float


class Fan(NamedTuple):
    """The sheet along: which profile, half the fan's angle [rad], the edge's fraction of the middle, and 1 over the
    profile's integral [1/rad].
    """

    profile: int
    half_rad: float
    edge_fraction: float
    scale: float


def half_width_mm(laser: LaserConfig, sensor: Sensor, distance_mm: Array) -> Array:
    """1/e² half-width w of the sheet: w(s) = w₀ √(1 + (M² λ (s − s₀) / (π w₀²))²).

    Parameters
    ----------
    laser : LaserConfig
        The beam.
    sensor : Sensor
        Where the waist lies, if the laser does not say.
    distance_mm : Array
        (...) from the emitter [mm].

    Returns
    -------
    Array
        (...) [mm].

    References
    ----------
    ISO 11146-1; Siegman, Lasers, 1986, chapter 17.
    """
    return np.asarray(width_at(np.asarray(distance_mm, dtype=float), beam(laser, sensor)))


def beam(laser: LaserConfig, sensor: Sensor) -> Beam:
    """The laser's beam before the sensor."""
    waist = laser.waist_um * 1e-3
    rayleigh = np.pi * waist**2 / (laser.m2 * laser.wavelength_nm * 1e-6) if laser.divergence else np.inf
    return Beam(waist, waist_distance_mm(laser, sensor), float(rayleigh))


@kernel(inline=True)
def width_at(distance: N, beam: Beam) -> N:
    """`half_width_mm` of one beam."""
    off = (distance - beam.at_mm) / beam.rayleigh_mm
    width: N = beam.waist_mm * np.sqrt(1 + off * off)
    return width


def waist_distance_mm(laser: LaserConfig, sensor: Sensor) -> float:
    """Distance of the waist from the emitter [mm]: as configured, or where the camera's axis meets the sheet."""
    return laser.waist_distance_mm or axis_meets_sheet_mm(sensor)


@lru_cache(maxsize=32)
def axis_meets_sheet_mm(sensor: Sensor) -> float:
    """Distance from the emitter of the point where the optical axis meets the sheet.

    Parameters
    ----------
    sensor : Sensor
        With a camera.

    Returns
    -------
    float
        [mm]; the near end of the view where the axis does not meet the sheet, or kilometres away.
    """
    camera = sensor.require_camera()
    centre, axis = camera.centre_mm, camera.T_sensor_camera.R[:, 2]
    reach = -centre[0] / axis[0] if axis[0] else -1.0
    distance = float(np.linalg.norm(centre + reach * axis - sensor.sheet.origin_mm))
    if reach > 0 and distance < MAX_DISTANCE_MM:
        return distance
    return float(np.min(np.linalg.norm(field_of_view(sensor) - sensor.sheet.origin_mm[1:], axis=1)))


@kernel(inline=True)
def across(x_mm: N, half_width: N) -> N:
    """Density across the sheet, ∫ dx = 1: √(2/π)/w · exp(−2x²/w²).

    Parameters
    ----------
    x_mm : float or Array
        From the sheet's middle [mm].
    half_width : float or Array
        1/e² half-width w there [mm].

    Returns
    -------
    float or Array
        [1/mm].
    """
    t = x_mm / half_width
    density: N = math.sqrt(2 / math.pi) / half_width * np.exp(-2 * t * t)
    return density


def along(laser: LaserConfig, fan_rad: float, angle: Array) -> Array:
    """Density of power over the fan's angle, ∫ dφ = 1 over the fan.

    gaussian: exp(−2φ²/φ₀²) cut at the fan's edge, where it has fallen to edge_fraction of its middle.
    powell: flat with a quadratic fall to edge_fraction at the edge, closed by a Gaussian shoulder of 2 % of the fan
    (a Powell lens's data sheet gives the edge intensity; "uniform" is cut at ≥ 80 %). uniform: flat, cut sharply.

    Parameters
    ----------
    laser : LaserConfig
        Its profile and edge_fraction.
    fan_rad : float
        Full angle of the fan.
    angle : Array
        (N,) from the fan's middle [rad].

    Returns
    -------
    Array
        (N,) [1/rad].
    """
    out = np.empty(np.shape(angle))
    _densities(np.asarray(angle, dtype=float).ravel(), fan(laser, fan_rad), out.ravel())
    return out


def fan(laser: LaserConfig, fan_rad: float) -> Fan:
    """The laser's fan, opened by so much."""
    norm = 1.0 if laser.profile == "uniform" else _fan_norm(laser.profile, laser.edge_fraction)
    return Fan(PROFILES.index(laser.profile), fan_rad / 2, laser.edge_fraction, 1 / (fan_rad * norm))


@kernel(inline=True)
def density_at(angle: float, fan: Fan) -> float:
    """`along` of one fan."""
    edge, scale = fan.edge_fraction, fan.scale
    t = abs(angle) / fan.half_rad
    if fan.profile == POWELL:
        inside, shoulder = min(t, 1.0), 1.0
        if t > 1:
            beyond = (t - 1) / SHOULDER
            shoulder = np.exp(-0.5 * beyond * beyond)
        return float(scale * (1 - (1 - edge) * inside * inside) * shoulder)
    if t > 1:
        return 0.0
    return float(scale * edge ** (t * t)) if fan.profile == GAUSSIAN else scale


@kernel
def _densities(angle: Array, fan: Fan, out: Array) -> None:
    for i in range(len(angle)):
        out[i] = density_at(angle[i], fan)


@lru_cache(maxsize=64)
def _fan_norm(profile: str, edge: float) -> float:
    """Mean of the profile's shape over the fan, its shoulders included."""
    if profile == "gaussian":
        t = (np.arange(4096) + 0.5) / 4096
        return float(np.mean(edge ** (t * t)))
    return 1 - (1 - edge) / 3 + edge * SHOULDER * float(np.sqrt(np.pi / 2))
