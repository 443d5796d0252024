"""The fit: emulation keys whose emulated images show extraction the figures that the recorded ones show.

The method of simulated moments (McFadden 1989; Gourieroux, Monfort & Renault 1993): the figures s of the recorded
images are compared with those of images emulated under the same rng; Gauss-Newton steps on the keys θ, each key under a
wide prior about its value in the sensor's file. The last steps are taken on the mean of several draws: of one draw's
cost its own noise is the least. Cov θ = G Σ Gᵀ, Σ the covariance of the figures' differences over parts of stripes, G
the step's own gain.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from extraction import StripeConfig
from geometry import InputError, Sensor
from perceptron_emu import EmulatorConfig
from workbench.twin.differences import FigureDifference, change, difference, figures
from workbench.twin.emulation import Emulation, Progress, seen_level
from workbench.twin.keys import (
    KEYS,
    LARGEST,
    TO_KEYS,
    Fitted,
    fitted,
    rounded_keys,
    sensor_with,
    significant,
    start_values,
    within,
)
from workbench.twin.seen import NAMES, Image, ImageSeen, Look, see, usual_width_px

Array = NDArray[np.float64]

ITERATIONS = 8
DAMPING = (0.0, 0.1, 1.0, 10.0)  # of a step, of the normal matrix's diagonal, until the figures come nearer
SETTLED, WITHIN = 0.2, 1.0  # σ: a step below is the last one of one draw, of several
# for derivatives: of a logarithm, of a linear key, of one whose change is small beside another pattern's chance
STEP, LINEAR_STEP, PATTERN_STEP = 0.4, 0.5, 0.6
# so far from where they were taken derivatives hold
RENEWED = np.array([5.0 if k.linear else STEP / 2 if k.pattern else STEP for k in KEYS])
DRAWS, LAST_STEPS = 4, 5  # of emulated images that the last steps are taken on
DRAWN = ((0,), (0, 1, 2))  # draws that a derivative is taken of, where patterns stay the same and where they do not
# σ² that no figure is taken to be better than: the surface that stands for the recorded one is not it, darkness is
FLOOR = np.diag([1e-3**2 if n in ("black", "dark_noise", "room_noise") else 0.01**2 for n in NAMES])
CHANCE = 2.0  # σ of a change, below which it is none
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
    image, told of the black level that the recorded ones show. chi2_per_dof: of the figures. clipped: whether most
    points have saturated pixels, so that width and flanks tell the light, not height.
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
    recorded, seen_by, look = _recorded([image for _, image in images], sensor)
    if not recorded:
        raise InputError(
            f"none of the {len(images)} images shows a laser stripe of some length: a twin wants stripe images taken "
            f"with the laser on, of a smooth surface"
        )
    _check_fan(recorded, sensor)
    total = ITERATIONS * (len(KEYS) + 6) + DRAWS * (LAST_STEPS + 1) + 1
    emulate = Emulation(sensor, config, seen_by, recorded, look, seed, progress, total)
    start = np.array([v if k.linear else np.log(v) for k, v in zip(KEYS, start_values(sensor, config), strict=True)])
    asked = _Asked(
        recorded, TO_KEYS.T @ np.diag([k.prior**-2 for k in KEYS]) @ TO_KEYS, np.linalg.solve(TO_KEYS, start)
    )
    start[[k.name for k in KEYS].index("black_level")] = seen_by.require_camera().black_level
    slopes = _Slopes(emulate)
    place = _descended(_begun(np.linalg.solve(TO_KEYS, start), emulate, asked), slopes, emulate, asked)
    place, step, converged = _settled(place, slopes, emulate, asked)
    twin_sensor, twin_config = sensor_with(place.theta, sensor, config)
    freedom = int(np.isfinite(place.apart.mean).sum()) - step.told
    chi2_per_dof = significant(place.misfit / max(freedom, 1.0))
    # figures that differ by more than their scatter say how far the emulator is off: σ hold it too (Birge's ratio)
    keys = fitted(place.theta, step.by_images * max(1.0, chi2_per_dof) + step.by_prior)
    return Twin(twin_sensor, twin_config, keys, recorded, place.seen, chi2_per_dof, converged, look.clipped_too)


def _recorded(images: Sequence[Image], sensor: Sensor) -> tuple[tuple[ImageSeen, ...], Sensor, Look]:
    """The images with a stripe as extraction sees them, told of the black level that they show, and how it looks."""
    every = [see(image, sensor, StripeConfig(), Look()) for image in images]
    look = Look(clipped_too=_clipped(every))
    if look.clipped_too:
        every = [see(image, sensor, StripeConfig(), look) for image in images]
    look = replace(look, width_px=usual_width_px(every))
    seen_by = sensor.with_camera(black_level=seen_level(every))
    every = [see(image, seen_by, StripeConfig(), look) for image in images]
    return tuple(s for s in every if len(s.parts))[:MAX_IMAGES], seen_by, look


@dataclass(frozen=True, eq=False)
class _Asked:
    """What is asked for: the recorded images' figures, under the prior of the fit's own coordinates."""

    recorded: tuple[ImageSeen, ...]
    precision: Array
    before: Array

    def place(self, theta: Array, *draws: tuple[ImageSeen, ...]) -> _Place:
        """A place whose emulated images are seen."""
        return _Place(theta, draws[0], difference(self.recorded, draws))

    def enough(self, seen: Sequence[ImageSeen]) -> bool:
        """Whether extraction finds most of the recorded stripes' points in the emulated images."""
        return _count(seen) >= MIN_POINTS * _count(self.recorded)

    def cost(self, place: _Place, variance: Array) -> float:
        """The misfit by variances of the figures (K,), and the prior's share."""
        off = place.theta - self.before
        return float(np.sum(np.nan_to_num(place.apart.mean) ** 2 / variance) + off @ self.precision @ off)


@dataclass(frozen=True, eq=False)
class _Place:
    """A place of the fit's own coordinates, what extraction sees there, and what the recorded images differ by."""

    theta: Array
    seen: tuple[ImageSeen, ...]
    apart: FigureDifference

    @property
    def variance(self) -> Array:
        """Of the figures' differences, (K,)."""
        return np.diag(self.apart.covariance + FLOOR)

    @property
    def misfit(self) -> float:
        """χ² of the figures that both show."""
        return float(np.sum(np.nan_to_num(self.apart.mean) ** 2 / self.variance))


@dataclass(frozen=True, eq=False)
class _Step:
    """Normal equations of a Gauss-Newton step; the images' and the prior's share of the covariance by its gain; of how
    many coordinates the images tell.
    """

    normal: Array
    right: Array
    by_images: Array
    by_prior: Array
    told: float

    @classmethod
    def at(cls, place: _Place, slope: Array, asked: _Asked) -> _Step:
        weight = np.where(np.isfinite(place.apart.mean), 1 / place.variance, 0.0)
        normal = slope.T @ (weight[:, None] * slope) + asked.precision
        right = slope.T @ (weight * np.nan_to_num(place.apart.mean)) + asked.precision @ (asked.before - place.theta)
        gain = np.linalg.solve(normal, slope.T * weight)
        rest = np.linalg.solve(normal, asked.precision)
        own = gain @ (place.apart.covariance + FLOOR) @ gain.T
        return cls(normal, right, own, rest @ np.linalg.inv(asked.precision) @ rest.T, float(np.trace(gain @ slope)))

    def damped(self, damping: float) -> Array:
        """The step, as far as derivatives may be believed."""
        step = np.linalg.solve(self.normal + damping * np.diag(np.diag(self.normal)), self.right)
        return np.asarray(step * min(1.0, float(np.min(LARGEST / np.maximum(np.abs(step), 1e-12)))))

    def in_sigmas(self, step: Array) -> float:
        """The largest of a step's coordinates."""
        return float(np.max(np.abs(step) / np.sqrt(np.diag(self.by_images + self.by_prior))))


class _Slopes:
    """Derivatives of the figures, taken anew where those that there are hold no more."""

    def __init__(self, emulate: Emulation) -> None:
        self._emulate = emulate
        self._at, self._slope = np.full(len(KEYS), np.inf), np.zeros((len(NAMES), len(KEYS)))

    def hold(self, place: _Place) -> bool:
        """Whether a place is near where they were taken."""
        return bool(np.all(np.abs(place.theta - self._at) <= RENEWED))

    def at(self, place: _Place) -> Array:
        """Derivatives (figures, keys) about a place."""
        if not self.hold(place):
            self._at, self._slope = place.theta, _slope(place, self._emulate)
        return self._slope


def _descended(place: _Place, slopes: _Slopes, emulate: Emulation, asked: _Asked) -> _Place:
    """Down the cost of one draw, as far as it goes."""
    for _ in range(ITERATIONS):
        step = _Step.at(place, slopes.at(place), asked)
        moved, last = _nearer(place, step, emulate, asked)
        place = moved or place
        if moved is None or (slopes.hold(place) and step.in_sigmas(last) < SETTLED):
            break
    return place


def _settled(place: _Place, slopes: _Slopes, emulate: Emulation, asked: _Asked) -> tuple[_Place, _Step, bool]:
    """The last steps, on the mean of draws: by chance another pattern is dearer, cost only ends what strays."""
    place = asked.place(place.theta, *(emulate(place.theta, k) for k in range(DRAWS)))
    step, settled = _Step.at(place, slopes.at(place), asked), False
    for _ in range(LAST_STEPS):
        theta = within(place.theta + step.damped(0.0))
        trial = asked.place(theta, *(emulate(theta, k) for k in range(DRAWS)))
        before, after = (asked.cost(p, place.variance) for p in (place, trial))
        if not asked.enough(trial.seen) or after > 2 * max(before, len(NAMES)):
            break
        settled = slopes.hold(trial) and step.in_sigmas(theta - place.theta) < WITHIN
        place, step = trial, _Step.at(trial, slopes.at(trial), asked)
        if settled:
            break
    return place, step, settled


def _slope(place: _Place, emulate: Emulation) -> Array:
    """Derivative of the figures by the coordinates, (figures, keys), by an emulation each, of the grain by several.

    Another grain is another pattern of speckle: of a change what its own scatter from part to part explains is left
    out (the positive part of James & Stein's estimator), or chance would pass for what the images tell.
    """
    slope, here = np.zeros((len(NAMES), len(KEYS))), emulate(place.theta)
    for k, key in enumerate(KEYS):
        step = np.zeros(len(KEYS))
        step[k] = LINEAR_STEP if key.linear else PATTERN_STEP if key.pattern else STEP
        if not np.allclose(within(place.theta + step), place.theta + step):
            step = -step
        both = key.pattern and bool(np.allclose(within(place.theta - step), place.theta - step))
        moved, variance = change(
            [s for d in DRAWN[both] for s in (emulate(place.theta - step, d) if both else here)],
            [s for d in DRAWN[both] for s in emulate(place.theta + step, d)],
        )
        sure = np.clip(1 - CHANCE**2 * variance / np.maximum(moved**2, 1e-300), 0, 1)
        slope[:, k] = sure * moved / (step[k] * (2 if both else 1))
    slope[NAMES.index("fan"), [k.name != "edge_fraction" for k in KEYS]] = 0.0
    return slope


def _nearer(place: _Place, step: _Step, emulate: Emulation, asked: _Asked) -> tuple[_Place | None, Array]:
    """The first damped step that brings the figures nearer and where it leads, or none and the shortest one tried."""
    cost, last = asked.cost(place, place.variance), np.zeros(len(KEYS))
    for damping in DAMPING:
        last = step.damped(damping)
        theta = within(place.theta + last)
        trial = asked.place(theta, emulate(theta))
        if asked.enough(trial.seen) and asked.cost(trial, place.variance) < cost:
            return trial, last
    return None, last


def _begun(start: ArrayLike, emulate: Emulation, asked: _Asked) -> _Place:
    """Where the fit starts: with light that extraction sees, and what the first figures say outright."""
    place = asked.place(*_seen_at_all(rounded_keys(start), emulate, asked))
    step = _first_step(figures(asked.recorded), figures(place.seen))
    for share in SHARES:  # what is read off the figures may lead to where too few stripes are found
        theta = within(place.theta + share * step)
        seen = emulate(theta)
        if asked.enough(seen):
            return asked.place(theta, seen)
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


def _count(seen: Sequence[ImageSeen]) -> int:
    """Points of stripes that extraction finds."""
    return sum(len(s.profile) for s in seen)


def _seen_at_all(theta: Array, emulate: Emulation, asked: _Asked) -> tuple[Array, tuple[ImageSeen, ...]]:
    """The start with power by which extraction finds most of the emulated stripes, neither lost nor clipped unless
    the recorded ones are, and what it sees there.
    """
    power = [k.name for k in KEYS].index("power_mw")
    for factor in POWERS:
        trial = theta.copy()
        trial[power] += np.log(factor)
        seen = emulate(trial)
        if asked.enough(seen) and (_clipped(seen) or not emulate.look.clipped_too):
            return trial, seen
    raise InputError(
        f"extraction finds no stripe in the emulated images of this sensor, at {POWERS[-2]:g} to {POWERS[-1]:g} times "
        f"its power: [laser], [optics] and [noise] of the sensor's file are far from the recorded images"
    )


def _first_step(target: Array, own: Array) -> Array:
    """What the first emulation's figures say outright: light, room light, fluctuations, width, noise in the dark."""
    step, at, figure = np.zeros(len(KEYS)), {k.name: i for i, k in enumerate(KEYS)}, {n: i for i, n in enumerate(NAMES)}
    off = np.nan_to_num(target - own)
    step[at["power_mw"]] = off[figure["height"]]
    step[at["contrast"]] = off[figure["line_rms"]]
    step[at["blur_px"]] = off[figure["width" if np.isnan(target[figure["flank"]]) else "flank"]]
    step[at["read_noise_e"]] = off[figure["dark_noise"]]
    room, there = (f[figure["room"]] - f[figure["black"]] for f in (target, own))
    if room > 0 and there > 0:
        step[at["irradiance_mw_m2_nm"]] = np.log(room / there)
    return step
