"""The keys that a twin fits: their place in sensor.toml, the coordinates that images tell apart, their limits."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from geometry import Sensor
from perceptron_emu import EmulatorConfig, gain_dn_per_e, speckle_contrast

Array = NDArray[np.float64]

LARGEST_STEP, LARGEST_LINEAR = 0.7, 20.0  # at once, of a key's logarithm, of a linear key
DECIMALS = 9  # of the fit's own coordinates: far below any σ of a key


@dataclass(frozen=True)
class Key:
    """A key of sensor.toml that is fitted: its table and name, the σ of its logarithm before (of itself, where linear),
    its limits, and whether another value lays speckle of another pattern.
    """

    table: str
    name: str
    prior: float
    low: float
    high: float
    linear: bool = False
    pattern: bool = False


# the fit's own coordinates are what images show: light in grey levels, power · gain / F#², noise in grey levels, and
# contrast · grain, to which fluctuations are proportional where pixels average many grains
KEYS = (
    Key("laser", "power_mw", 3.0, 1e-3, 1e4),
    Key("laser", "waist_um", 0.4, 20.0, 2000.0),
    Key("laser", "edge_fraction", 0.5, 0.05, 1.0),
    Key("optics", "blur_px", 0.5, 0.21, 8.0),
    Key("optics", "f_number", 0.7, 1.0, 32.0, pattern=True),
    Key("speckle", "contrast", 0.7, 0.01, 1.0),
    Key("noise", "gain_dn_per_e", 1.0, 1e-4, 10.0),
    Key("noise", "read_noise_e", 1.0, 0.3, 500.0),
    Key("ambient", "irradiance_mw_m2_nm", 3.0, 1e-3, 1e5),
    Key("image", "black_level", 30.0, 0.0, 1e4, linear=True),
)


@dataclass(frozen=True)
class Fitted:
    """A key as fitted: its value, σ, and how much the images say of it (0: the file's value stands, 1: they decide)."""

    table: str
    name: str
    value: float
    sigma: float
    told: float


def _to_keys() -> Array:
    """The keys' (logarithmic) values are this times the fit's own coordinates."""
    at = {k.name: i for i, k in enumerate(KEYS)}
    matrix = np.eye(len(KEYS))
    for name in ("power_mw", "irradiance_mw_m2_nm"):
        matrix[at[name], at["gain_dn_per_e"]], matrix[at[name], at["f_number"]] = -1.0, 2.0
    matrix[at["read_noise_e"], at["gain_dn_per_e"]] = -1.0
    matrix[at["contrast"], at["f_number"]] = -1.0
    return matrix


TO_KEYS = _to_keys()
LARGEST = np.array([LARGEST_LINEAR if k.linear else LARGEST_STEP for k in KEYS])


def start_values(sensor: Sensor, config: EmulatorConfig) -> list[float]:
    """The keys' values as the sensor's file has them."""
    camera = sensor.require_camera()
    special = {
        "gain_dn_per_e": gain_dn_per_e(config.noise, sensor),
        "contrast": max(speckle_contrast(config), 0.05),
        "black_level": camera.black_level,
    }
    return [float(special[k.name] if k.name in special else getattr(getattr(config, k.table), k.name)) for k in KEYS]


def sensor_with(theta: Array, sensor: Sensor, config: EmulatorConfig) -> tuple[Sensor, EmulatorConfig]:
    """Sensor and configuration at a place of the fit's own coordinates."""
    tables: dict[str, dict[str, float]] = {}
    for value, key in zip(TO_KEYS @ theta, KEYS, strict=True):
        known = significant(value if key.linear else np.exp(value))
        tables.setdefault(key.table, {})[key.name] = min(max(known, key.low), key.high)
    black = tables.pop("image")["black_level"]
    gain = tables["noise"]["gain_dn_per_e"]
    camera = sensor.require_camera()
    tables["noise"]["full_well_e"] = significant(max(1.03 * (camera.saturation_dn - black) / gain, 11.0))
    updates = {
        name: type(getattr(config, name)).model_validate(getattr(config, name).model_dump(exclude_unset=True) | keys)
        for name, keys in tables.items()
    }
    return sensor.with_camera(black_level=black), config.model_copy(update=updates)


def significant(value: float) -> float:
    """Without a library function's last bits, which processors have otherwise."""
    return float(f"{value:.{DECIMALS}g}")


def within(theta: Array) -> Array:
    """The nearest place whose keys lie within their limits."""
    low = np.array([k.low if k.linear else np.log(k.low) for k in KEYS])
    high = np.array([k.high if k.linear else np.log(k.high) for k in KEYS])
    return rounded_keys(np.linalg.solve(TO_KEYS, np.clip(TO_KEYS @ theta, low, high)))


def rounded_keys(theta: ArrayLike) -> Array:
    """Well above the last bits of a library's function, so that every later emulation is the same on any processor."""
    return np.round(np.asarray(theta, float), DECIMALS)


def fitted(theta: Array, covariance: Array) -> tuple[Fitted, ...]:
    """The keys with their σ."""
    values, own = TO_KEYS @ theta, TO_KEYS @ covariance @ TO_KEYS.T
    told = 1 - np.clip(np.diag(own) / np.array([k.prior for k in KEYS]) ** 2, 0, 1)
    out = []
    for k, key in enumerate(KEYS):
        value, scale = (values[k], 1.0) if key.linear else (np.exp(values[k]), np.exp(values[k]))
        out.append(
            Fitted(
                key.table,
                key.name,
                significant(value),
                significant(np.sqrt(own[k, k]) * scale),
                significant(told[k]),
            )
        )
    return tuple(out)
