"""The fit: emulation keys whose emulated images show extraction the figures that the recorded ones show.

The method of simulated moments (McFadden 1989; Gourieroux, Monfort & Renault 1993): the figures s of the recorded
images are compared with those of images emulated under the same rng; Gauss-Newton steps on the keys θ, each key under a
wide prior about its value in the sensor's file. Cov θ = G Σ Gᵀ, Σ the covariance of the figures over parts of stripes,
recorded and emulated, G the step's own gain.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from extraction import StripeConfig
from geometry import InputError, Pose, Sensor
from perceptron_emu import (
    EmulatorConfig,
    Material,
    Scene,
    Solid,
    profile_strip,
    render,
)
from workbench.twin.keys import (
    KEYS,
    LARGEST,
    TO_KEYS,
    Fitted,
    fitted,
    rounded_keys,
    sensor_with,
    start_values,
    within,
)
from workbench.twin.seen import NAMES, Image, ImageSeen, Look, see, smooth, usual_width_px

Array = NDArray[np.float64]
Progress = Callable[[int, int], None]

REFLECTANCE = 0.6  # of the matte surface that stands for the recorded ones: power and reflectance can not be told apart
HALF_LENGTH_MM = 25.0  # of that surface to either side of the sheet: room light shows it beside the stripe
EVERY = 6  # sections between corners of the emulated surface
JUMP_MM = 1.0  # between neighbours: the surface ends there
ITERATIONS = 8
DAMPING = (0.0, 0.1, 1.0, 10.0)  # of a step, of the normal matrix's diagonal, until the figures come nearer
SETTLED = 0.2  # of σ: a step below ends the fit
STEP, LINEAR_STEP = 0.4, 0.5  # of a key's logarithm, of a linear key, for its derivative
FLOOR = 0.01  # σ that no figure is taken to be better than: the surface that stands for the recorded one is not it
SHARES = (1.0, 0.5, 0.25)  # of the first step
POWERS = (1.0, 0.5, 2.0, 0.25, 4.0, 0.1, 10.0, 0.03, 30.0)  # of the file's, tried in turn
MIN_POINTS = 0.7  # of the recorded stripes': so many must be found in the emulated images
MIN_INSIDE = 0.5  # part of the points that must lie in the laser's fan
MAX_IMAGES = 12
MAX_CLIPPED = 0.5  # part of the points: beyond, what is left of the stripes is their dim ends alone


@dataclass(frozen=True, eq=False)
class Twin:
    """A sensor as its images show it.

    sensor, config: with the fitted keys. keys: the same with σ. recorded, emulated: what extraction sees, image by
    image. chi2_per_dof: of the figures. clipped: whether most points have saturated pixels, so that width and flanks
    tell the light, not height.
    """

    sensor: Sensor
    config: EmulatorConfig
    keys: tuple[Fitted, ...]
    recorded: tuple[ImageSeen, ...]
    emulated: tuple[ImageSeen, ...]
    chi2_per_dof: float
    converged: bool
    clipped: bool


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
    every = [see(image, sensor, StripeConfig(), Look()) for _, image in images]
    look = Look(clipped_too=_clipped(every))
    if look.clipped_too:
        every = [see(image, sensor, StripeConfig(), look) for _, image in images]
    own = replace(look, width_px=usual_width_px(every))
    every = [see(image, sensor, StripeConfig(), own) for _, image in images]
    recorded = tuple(s for s in every if len(s.parts))[:MAX_IMAGES]
    if not recorded:
        raise InputError(
            f"none of the {len(images)} images shows a laser stripe of some length: a twin wants stripe images taken "
            f"with the laser on, of a smooth surface"
        )
    _check_fan(recorded, sensor)
    emulate = _Emulation(sensor, config, tuple(_scene(s, sensor) for s in recorded), look, seed, progress)
    start = np.array([v if k.linear else np.log(v) for k, v in zip(KEYS, start_values(sensor, config), strict=True)])
    precision = TO_KEYS.T @ np.diag([k.prior**-2 for k in KEYS]) @ TO_KEYS
    asked = _Asked(*_means(recorded), precision, np.linalg.solve(TO_KEYS, start))
    points = MIN_POINTS * _count(recorded)
    place = _begun(np.linalg.solve(TO_KEYS, _first(start, asked.figures)), emulate, asked, points)
    converged, covariance = False, np.asarray(np.linalg.inv(precision))
    for _ in range(ITERATIONS):
        step = _Step.at(place, emulate, asked)
        covariance = step.covariance
        moved, last = _nearer(place, step, emulate, asked, points)
        converged = moved is None or bool(np.all(np.abs(last) < SETTLED * np.sqrt(np.diag(covariance))))
        place = moved or place
        if converged:
            break
    twin_sensor, twin_config = sensor_with(place.theta, sensor, config)
    chi2_per_dof = asked.misfit(place) / max(int(np.isfinite(asked.figures - place.figures).sum()) - len(KEYS), 1)
    # figures that differ by more than their scatter say how far the emulator is off: σ hold it too (Birge's ratio)
    keys = fitted(place.theta, covariance * max(1.0, chi2_per_dof))
    return Twin(twin_sensor, twin_config, keys, recorded, place.seen, chi2_per_dof, converged, look.clipped_too)


class _Emulation:
    """The recorded surfaces under the sensor of a place, as extraction sees them."""

    def __init__(
        self,
        sensor: Sensor,
        config: EmulatorConfig,
        scenes: tuple[tuple[Solid, ...], ...],
        look: Look,
        seed: int,
        progress: Progress,
    ) -> None:
        self._sensor, self._config, self._scenes, self.look = sensor, config, scenes, look
        self._seed, self._progress = seed, progress
        self._done, self._total = 0, ITERATIONS * (len(KEYS) + 2) + 1

    def __call__(self, theta: Array) -> tuple[ImageSeen, ...]:
        """One image a scene, each under its own rng, the same at every place."""
        sensor, config = sensor_with(theta, self._sensor, self._config)
        out = []
        for k, solids in enumerate(self._scenes):
            image = render(Scene(sensor, solids=solids), config, np.random.default_rng([self._seed, k])).image
            out.append(see(image, sensor, StripeConfig(), self.look))
        self._done += 1
        self._progress(min(self._done, self._total), self._total)
        return tuple(out)


@dataclass(frozen=True, eq=False)
class _Place:
    """A place of the fit's own coordinates, what extraction sees there, its figures and their covariance."""

    theta: Array
    seen: tuple[ImageSeen, ...]
    figures: Array
    noise: Array

    @classmethod
    def of(cls, theta: Array, seen: tuple[ImageSeen, ...]) -> _Place:
        return cls(theta, seen, *_means(seen))


@dataclass(frozen=True, eq=False)
class _Asked:
    """What is asked for: the recorded figures with their covariance, and the prior of the fit's own coordinates."""

    figures: Array
    spread: Array
    precision: Array
    before: Array

    def variance(self, place: _Place) -> Array:
        """Of the figures' differences, (K,)."""
        return np.asarray(np.diag(self.spread + place.noise) + FLOOR**2)

    def misfit(self, place: _Place) -> float:
        """χ² of the figures that both show."""
        return float(np.sum(np.nan_to_num(self.figures - place.figures) ** 2 / self.variance(place)))

    def cost(self, place: _Place) -> float:
        """The misfit and the prior's share."""
        off = place.theta - self.before
        return self.misfit(place) + float(off @ self.precision @ off)


@dataclass(frozen=True, eq=False)
class _Step:
    """Normal equations of a Gauss-Newton step, and the keys' covariance by its gain."""

    normal: Array
    right: Array
    covariance: Array

    @classmethod
    def at(cls, place: _Place, emulate: _Emulation, asked: _Asked) -> _Step:
        off = asked.figures - place.figures
        weight = np.where(np.isfinite(off), 1 / asked.variance(place), 0.0)
        slope = _slope(place, emulate)
        normal = slope.T @ (weight[:, None] * slope) + asked.precision
        right = slope.T @ (weight * np.nan_to_num(off)) + asked.precision @ (asked.before - place.theta)
        gain = np.linalg.solve(normal, slope.T * weight)
        rest = np.linalg.solve(normal, asked.precision)
        own = gain @ (asked.spread + place.noise + FLOOR**2 * np.eye(len(NAMES))) @ gain.T
        return cls(normal, right, own + rest @ np.linalg.inv(asked.precision) @ rest.T)

    def damped(self, damping: float) -> Array:
        """The step."""
        return np.asarray(np.linalg.solve(self.normal + damping * np.diag(np.diag(self.normal)), self.right))


def _slope(place: _Place, emulate: _Emulation) -> Array:
    """Derivative of the figures by the coordinates, (figures, keys), by an emulation each, of the grain by two.

    Another grain is another pattern of speckle: of a change what its own scatter from part to part explains is left
    out (the positive part of James & Stein's estimator), or chance would pass for what the images tell.
    """
    slope = np.zeros((len(NAMES), len(KEYS)))
    for k, key in enumerate(KEYS):
        step = np.zeros(len(KEYS))
        step[k] = LINEAR_STEP if key.linear else STEP
        if not np.allclose(within(place.theta + step), place.theta + step):
            step = -step
        both = key.pattern and bool(np.allclose(within(place.theta - step), place.theta - step))
        begin = emulate(place.theta - step) if both else place.seen
        change, variance = _change(begin, emulate(place.theta + step))
        sure = np.clip(1 - variance / np.maximum(change**2, 1e-300), 0, 1)
        slope[:, k] = sure * change / (step[k] * (2 if both else 1))
    return slope


def _change(before: Sequence[ImageSeen], after: Sequence[ImageSeen]) -> tuple[Array, Array]:
    """Mean change of the figures (K,) and its variance, by parts that both show; none and zero where none does."""
    pairs = [b.parts - a.parts for a, b in zip(before, after, strict=True) if len(a.parts) == len(b.parts)]
    rows = np.concatenate([*pairs, np.zeros((0, len(NAMES)))])
    count = np.isfinite(rows).sum(0)
    mean = np.nan_to_num(_mean(rows))
    scatter = np.nansum((rows - mean) ** 2, 0) / np.maximum(count - 1, 1)
    return np.where(count > 1, mean, 0.0), scatter / np.maximum(count, 1)


def _nearer(
    place: _Place, step: _Step, emulate: _Emulation, asked: _Asked, points: float
) -> tuple[_Place | None, Array]:
    """The first damped step that brings the figures nearer and where it leads, or none and the shortest one tried."""
    cost, last = asked.cost(place), np.zeros(len(KEYS))
    for damping in DAMPING:
        last = step.damped(damping)
        theta = within(place.theta + np.clip(last, -LARGEST, LARGEST))
        seen = emulate(theta)
        if _count(seen) >= points and asked.cost(trial := _Place.of(theta, seen)) < cost:
            return trial, last
    return None, last


def _begun(start: ArrayLike, emulate: _Emulation, asked: _Asked, points: float) -> _Place:
    """Where the fit starts: with light that extraction sees, and what the first figures say outright."""
    place = _Place.of(*_seen_at_all(rounded_keys(start), emulate, points))
    step = _first_step(asked.figures, place.figures)
    for share in SHARES:  # what is read off the figures may lead to where too few stripes are found
        theta = within(place.theta + share * step)
        seen = emulate(theta)
        if _count(seen) >= points:
            return _Place.of(theta, seen)
    return place


def _clipped(every: Sequence[ImageSeen]) -> bool:
    """Whether most of the points found have saturated pixels."""
    return sum(s.clipped for s in every) > MAX_CLIPPED * sum(s.found for s in every)


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


def _count(seen: Sequence[ImageSeen]) -> int:
    """Points of stripes that extraction finds."""
    return sum(len(s.profile) for s in seen)


def _seen_at_all(theta: Array, emulate: _Emulation, points: float) -> tuple[Array, tuple[ImageSeen, ...]]:
    """The start with power by which extraction finds most of the emulated stripes, neither lost nor clipped unless
    the recorded ones are, and what it sees there.
    """
    power = [k.name for k in KEYS].index("power_mw")
    for factor in POWERS:
        trial = theta.copy()
        trial[power] += np.log(factor)
        seen = emulate(trial)
        if _count(seen) >= points and (_clipped(seen) or not emulate.look.clipped_too):
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
    step[at["blur_px"]] = off[figure["width" if np.isnan(target[figure["flank"]]) else "flank"]]
    step[at["read_noise_e"]] = off[figure["dark_noise"]] / 2
    room, own = (f[figure["room"]] - f[figure["black"]] for f in (target, figures))
    if room > 0 and own > 0:
        step[at["irradiance_mw_m2_nm"]] = np.log(room / own)
    return step


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


def _first(keys: Array, figures: Array) -> Array:
    """The start with the black level as the images show it."""
    out = keys.copy()
    black = figures[NAMES.index("black")]
    index = [k.name for k in KEYS].index("black_level")
    if np.isfinite(black):
        out[index] = max(black, 0.0)
    return out
