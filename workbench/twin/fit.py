"""The fit: emulation keys whose emulated images show extraction the figures that the recorded ones show.

The method of simulated moments (McFadden 1989; Gourieroux, Monfort & Renault 1993): the figures s of the recorded
images are compared with those of images emulated under the same rng; Gauss-Newton steps on the keys θ, each key under a
wide prior about its value in the sensor's file. Cov θ = G Σ Gᵀ, Σ the covariance of the figures over parts of stripes,
recorded and emulated, G the step's own gain.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from extraction import StripeConfig
from geometry import InputError, Pose, Sensor
from perceptron_emu import (
    EmulatorConfig,
    Material,
    Scene,
    Solid,
    gain_dn_per_e,
    profile_strip,
    render,
    speckle_contrast,
)
from workbench.twin.seen import NAMES, Image, ImageSeen, see, smooth

Array = NDArray[np.float64]
Progress = Callable[[int, int], None]

REFLECTANCE = 0.6  # of the matte surface that stands for the recorded ones: power and reflectance can not be told apart
HALF_LENGTH_MM = 25.0  # of that surface to either side of the sheet: room light shows it beside the stripe
EVERY = 6  # sections between corners of the emulated surface
JUMP_MM = 1.0  # between neighbours: the surface ends there
ITERATIONS = 8
DAMPING = (0.0, 0.1, 1.0, 10.0)  # of a step, of the normal matrix's diagonal, until the figures come nearer
SETTLED = 0.2  # of σ: a step below ends the fit
STEP, LINEAR_STEP = 0.2, 0.5  # of a key's logarithm, of a linear key, for its derivative
LARGEST_STEP, LARGEST_LINEAR = 0.7, 20.0  # at once, of a key's logarithm, of a linear key
FLOOR = 0.01  # σ that no figure is taken to be better than: the surface that stands for the recorded one is not it
SHARES = (1.0, 0.5, 0.25)  # of the first step
POWERS = (1.0, 0.5, 2.0, 0.25, 4.0, 0.1, 10.0, 0.03, 30.0)  # of the file's, tried in turn
MIN_PARTS = 0.7  # of the recorded stripes: so many must be found in the emulated images
MIN_INSIDE = 0.5  # part of the points that must lie in the laser's fan
MAX_IMAGES = 12


@dataclass(frozen=True)
class Key:
    """A key of sensor.toml that is fitted: its table and name, the σ of its logarithm before (of itself, where linear),
    and its limits.
    """

    table: str
    name: str
    prior: float
    low: float
    high: float
    linear: bool = False


# the fit's own coordinates are what images show: light in grey levels, power · gain / F#², noise in grey levels, and
# contrast · grain, to which fluctuations are proportional where pixels average many grains
KEYS = (
    Key("laser", "power_mw", 3.0, 1e-3, 1e4),
    Key("laser", "waist_um", 0.4, 20.0, 2000.0),
    Key("laser", "edge_fraction", 0.5, 0.05, 1.0),
    Key("optics", "blur_px", 0.5, 0.21, 8.0),
    Key("optics", "f_number", 0.5, 1.0, 32.0),
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


@dataclass(frozen=True, eq=False)
class Twin:
    """A sensor as its images show it.

    sensor, config: with the fitted keys. keys: the same with σ. recorded, emulated: what extraction sees, image by
    image. chi2_per_dof: of the figures.
    """

    sensor: Sensor
    config: EmulatorConfig
    keys: tuple[Fitted, ...]
    recorded: tuple[ImageSeen, ...]
    emulated: tuple[ImageSeen, ...]
    chi2_per_dof: float
    converged: bool


def fit_twin(
    images: Sequence[tuple[str, Image]], sensor: Sensor, config: EmulatorConfig, seed: int, progress: Progress
) -> Twin:
    """Fit the emulation keys to stripe images.

    Parameters
    ----------
    images
        Names and grey levels (H, W) of the recorded images.
    sensor
        With a camera; its geometry is taken as it is.
    config
        Where the fit starts.
    seed
        Of the emulated images.
    progress
        Told the emulations done and in all.

    Returns
    -------
    Twin
        Keys with σ, recorded and emulated images as extraction sees them.

    Raises
    ------
    InputError
        Where no image shows a stripe, or the stripes do not lie in the laser's fan.
    """
    stripe = StripeConfig()
    recorded = tuple(s for s in (see(image, sensor, stripe) for _, image in images) if len(s.parts))[:MAX_IMAGES]
    if not recorded:
        raise InputError(
            f"none of the {len(images)} images shows a laser stripe of some length: a twin wants stripe images taken "
            f"with the laser on, of a smooth surface"
        )
    _check_fan(recorded, sensor)
    scenes = [_scene(s, sensor) for s in recorded]
    start = _start(sensor, config)
    total, done = ITERATIONS * (len(KEYS) + 1) + 1, 0

    def seen_with(at: NDArray[np.floating[Any]]) -> tuple[ImageSeen, ...]:
        nonlocal done
        twin_sensor, twin_config = _with(np.asarray(at, float), sensor, config)
        out = tuple(
            see(
                render(Scene(twin_sensor, solids=s), twin_config, np.random.default_rng([seed, k])).image,
                twin_sensor,
                stripe,
            )
            for k, s in enumerate(scenes)
        )
        done += 1
        progress(min(done, total), total)
        return out

    start_keys = np.array([v if k.linear else np.log(v) for k, v in zip(KEYS, start, strict=True)])
    precision = TO_KEYS.T @ np.diag([k.prior**-2 for k in KEYS]) @ TO_KEYS
    before = np.linalg.solve(TO_KEYS, start_keys)
    target, spread = _means(recorded)
    theta = np.linalg.solve(TO_KEYS, _first(start_keys, target))
    parts = MIN_PARTS * sum(len(s.parts) for s in recorded)
    theta, emulated = _seen_at_all(np.asarray(theta, float), seen_with, parts)
    step = _first_step(target, _means(emulated)[0])
    for share in SHARES:  # what is read off the figures may lead to where too few stripes are found
        trial = _within(theta + share * step)
        seen = seen_with(trial)
        if _count(seen) >= parts:
            theta, emulated = trial, seen
            break
    figures, noise = _means(emulated)

    def cost_of(figures: Array, noise: Array, theta: Array) -> float:
        off = np.nan_to_num(target - figures)
        prior = float((theta - before) @ precision @ (theta - before))
        return float(np.sum(off**2 / (np.diag(spread + noise) + FLOOR**2))) + prior

    covariance, converged = np.linalg.inv(precision), False
    for _ in range(ITERATIONS):
        weight = np.where(np.isfinite(target - figures), 1 / (np.diag(spread + noise) + FLOOR**2), 0.0)
        slope = np.zeros((len(NAMES), len(KEYS)))
        for k, key in enumerate(KEYS):
            moved = theta.copy()
            moved[k] += LINEAR_STEP if key.linear else STEP
            if not np.allclose(_within(moved), moved):
                moved[k] -= 2 * (LINEAR_STEP if key.linear else STEP)
            slope[:, k] = np.nan_to_num((_means(seen_with(moved))[0] - figures) / (moved[k] - theta[k]))
        normal = slope.T @ (weight[:, None] * slope) + precision
        right = slope.T @ (weight * np.nan_to_num(target - figures)) + precision @ (before - theta)
        gain = np.linalg.solve(normal, slope.T * weight)
        rest = np.linalg.solve(normal, precision)
        covariance = gain @ (spread + noise + FLOOR**2 * np.eye(len(NAMES))) @ gain.T
        covariance += rest @ np.linalg.inv(precision) @ rest.T
        cost = cost_of(figures, noise, theta)
        for damping in DAMPING:
            step = np.linalg.solve(normal + damping * np.diag(np.diag(normal)), right)
            trial = _within(theta + np.clip(step, -LARGEST, LARGEST))
            seen = seen_with(trial)
            if _count(seen) >= parts and cost_of(*_means(seen), trial) < cost:
                theta, emulated, (figures, noise) = trial, seen, _means(seen)
                break
        else:
            converged = True
        converged = converged or bool(np.all(np.abs(step) < SETTLED * np.sqrt(np.diag(covariance))))
        if converged:
            break
    good = np.isfinite(target - figures)
    chi2 = float(np.sum((target - figures)[good] ** 2 / (np.diag(spread + noise)[good] + FLOOR**2)))
    twin_sensor, twin_config = _with(theta, sensor, config)
    values, own_covariance = TO_KEYS @ theta, TO_KEYS @ covariance @ TO_KEYS.T
    told = 1 - np.clip(np.diag(own_covariance) / np.array([k.prior for k in KEYS]) ** 2, 0, 1)
    fitted = []
    for k, key in enumerate(KEYS):
        value, own = (values[k], 1.0) if key.linear else (np.exp(values[k]), np.exp(values[k]))
        fitted.append(
            Fitted(key.table, key.name, float(value), float(np.sqrt(own_covariance[k, k]) * own), float(told[k]))
        )
    return Twin(
        twin_sensor, twin_config, tuple(fitted), recorded, emulated, chi2 / max(good.sum() - len(KEYS), 1), converged
    )


def _check_fan(recorded: Sequence[ImageSeen], sensor: Sensor) -> None:
    yz = np.concatenate([s.profile.yz_mm for s in recorded]) - sensor.sheet.origin_mm[1:]
    inside = np.mean(np.abs(np.arctan2(yz[:, 0], yz[:, 1])) <= sensor.sheet.fan_rad / 2)
    if inside < MIN_INSIDE:
        raise InputError(
            f"only {100 * inside:.0f} % of the stripes' points lie in the laser's fan as the sensor's file has it: "
            f"these are another sensor's images, or [laser] fan_deg and origin_mm are not this one's"
        )


def _scene(seen: ImageSeen, sensor: Sensor) -> tuple[Solid, ...]:
    """The recorded profile as a surface that the sheet meets square: smooth, in pieces where it jumps."""
    section, yz = seen.profile.peaks.section, seen.profile.yz_mm
    line = np.column_stack([smooth(section, yz[:, k]) for k in range(2)])
    good = np.isfinite(line).all(1)
    line, section = line[good], section[good]
    ends = np.flatnonzero((np.linalg.norm(np.diff(line, axis=0), axis=1) > JUMP_MM) | (np.diff(section) > EVERY)) + 1
    out: list[Solid] = []
    for piece in np.split(line, ends):
        corners = piece[::EVERY] if len(piece) % EVERY == 1 else np.vstack([piece[::EVERY], piece[-1:]])
        if len(corners) > 1:
            out.append(
                Solid(
                    profile_strip(corners, HALF_LENGTH_MM),
                    Material(REFLECTANCE),
                    Pose.identity(),
                    f"surface {len(out)}",
                )
            )
    return tuple(out)


def _start(sensor: Sensor, config: EmulatorConfig) -> list[float]:
    camera = sensor.require_camera()
    special = {
        "gain_dn_per_e": gain_dn_per_e(config.noise, sensor),
        "contrast": max(speckle_contrast(config), 0.05),
        "black_level": camera.black_level,
    }
    return [float(special[k.name] if k.name in special else getattr(getattr(config, k.table), k.name)) for k in KEYS]


def _first(keys: Array, figures: Array) -> Array:
    """The start with the black level as the images show it."""
    out = keys.copy()
    black = figures[NAMES.index("black")]
    index = [k.name for k in KEYS].index("black_level")
    if np.isfinite(black):
        out[index] = max(black, 0.0)
    return out


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


def _count(seen: Sequence[ImageSeen]) -> int:
    """Parts of stripes that extraction finds."""
    return sum(len(s.parts) for s in seen)


def _seen_at_all(
    theta: Array, seen_with: Callable[[Array], tuple[ImageSeen, ...]], parts: float
) -> tuple[Array, tuple[ImageSeen, ...]]:
    """The start with power by which extraction finds most of the emulated stripes, neither lost nor clipped, and what
    it sees there.
    """
    power = [k.name for k in KEYS].index("power_mw")
    for factor in POWERS:
        trial = theta.copy()
        trial[power] += np.log(factor)
        seen = seen_with(trial)
        if _count(seen) >= parts:
            return trial, seen
    raise InputError(
        f"extraction finds no stripe in the emulated images of this sensor, at {POWERS[-2]:g} to {POWERS[-1]:g} times "
        f"its power: [laser], [optics] and [noise] of the sensor's file are far from the recorded images"
    )


def _first_step(target: Array, figures: Array) -> Array:
    """What the first emulation's figures say outright: light, room light, fluctuations, width, noise in the dark."""
    step, at, figure = np.zeros(len(KEYS)), {k.name: i for i, k in enumerate(KEYS)}, {n: i for i, n in enumerate(NAMES)}
    off = np.nan_to_num(target - figures)
    step[at["power_mw"]] = off[figure["height"]]
    step[at["contrast"]] = off[figure["line_rms"]]
    step[at["blur_px"]] = off[figure["width"]]
    step[at["read_noise_e"]] = off[figure["dark_noise"]] / 2
    room, own = (f[figure["room"]] - f[figure["black"]] for f in (target, figures))
    if room > 0 and own > 0:
        step[at["irradiance_mw_m2_nm"]] = np.log(room / own)
    return step


def _with(theta: Array, sensor: Sensor, config: EmulatorConfig) -> tuple[Sensor, EmulatorConfig]:
    """Sensor and configuration at a place of the fit's own coordinates."""
    tables: dict[str, dict[str, float]] = {}
    for value, key in zip(TO_KEYS @ theta, KEYS, strict=True):
        known = float(value) if key.linear else float(np.exp(value))
        tables.setdefault(key.table, {})[key.name] = min(max(known, key.low), key.high)
    black = tables.pop("image")["black_level"]
    gain = tables["noise"]["gain_dn_per_e"]
    camera = sensor.require_camera()
    tables["noise"]["full_well_e"] = max(1.03 * (camera.saturation_dn - black) / gain, 11.0)
    updates = {
        name: type(getattr(config, name)).model_validate(getattr(config, name).model_dump(exclude_unset=True) | keys)
        for name, keys in tables.items()
    }
    return sensor.with_camera(black_level=black), config.model_copy(update=updates)


def _within(theta: Array) -> Array:
    low = np.array([k.low if k.linear else np.log(k.low) for k in KEYS])
    high = np.array([k.high if k.linear else np.log(k.high) for k in KEYS])
    return np.asarray(np.linalg.solve(TO_KEYS, np.clip(TO_KEYS @ theta, low, high)), float)


def _means(seen: Sequence[ImageSeen]) -> tuple[Array, Array]:
    """Means of the figures over all parts, NaN where none tells, and their covariance by the images' scatter."""
    rows = np.concatenate([s.parts for s in seen])
    count = np.isfinite(rows).sum(0)
    mean = _mean(rows)
    # parts of one image share its surface: what they have in common is in the recorded and the emulated alike
    own = [s.parts - _mean(s.parts) for s in seen if len(s.parts) > 1]
    if not own:
        return mean, np.diag(np.full(len(NAMES), 0.05**2))
    left = np.nan_to_num(np.concatenate(own))
    freedom = max(len(left) - len(own), 1)
    return mean, (left.T @ left) / freedom / np.maximum(np.sqrt(np.outer(count, count)), 1)


def _mean(rows: Array) -> Array:
    """Means of columns (N, K), NaN left out; NaN where there is nothing else."""
    count = np.isfinite(rows).sum(0)
    return np.asarray(np.where(count > 0, np.nansum(rows, 0) / np.maximum(count, 1), np.nan))
