"""Recorded stripes emulated: their surfaces under the sensor of a place of the fit, as extraction sees them."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from extraction import StripeConfig
from geometry import Pose, Sensor
from perceptron_emu import EmulatorConfig, Material, Scene, Solid, profile_strip, render
from workbench.twin.keys import rounded_keys, sensor_with
from workbench.twin.seen import NAMES, ImageSeen, Look, see, smooth

Array = NDArray[np.float64]
Progress = Callable[[int, int], None]

REFLECTANCE = 0.6  # of the matte surface that stands for the recorded ones: power and reflectance can not be told apart
HALF_LENGTH_MM = 25.0  # of that surface to either side of the sheet: room light shows it beside the stripe
EVERY = 6  # sections between corners of the emulated surface
JUMP_MM = 1.0  # between neighbours: the surface ends there


class Emulation:
    """The recorded surfaces under the sensor of a place, as extraction sees them.

    Extraction weighs by the black level that it is told: recorded and emulated images are seen with one,
    ``seen_by``'s, whatever the place's is.

    Parameters
    ----------
    sensor, config
        What the keys of a place are put into.
    seen_by
        The sensor that extraction is told of.
    recorded
        Images whose profiles are emulated.
    look
        Which points are taken.
    seed
        Of the emulated images.
    progress, total
        Told the emulations done, of so many in all.
    """

    def __init__(
        self,
        sensor: Sensor,
        config: EmulatorConfig,
        seen_by: Sensor,
        recorded: Sequence[ImageSeen],
        look: Look,
        seed: int,
        progress: Progress,
        total: int,
    ) -> None:
        self._sensor, self._config, self._seen_by = sensor, config, seen_by
        self.look = replace(look, doubted_too=True)  # of an emulated ridge it is known whose it is
        self._surfaces = [(_surface(s), s.bounds) for s in recorded]
        self._seed, self._progress = seed, progress
        self._done, self._total = 0, total

    def __call__(self, theta: Array, draw: int = 0) -> tuple[ImageSeen, ...]:
        """One image a surface, each under its own rng, the same at every place; another draw has others."""
        sensor, config = sensor_with(theta, self._sensor, self._config)
        out = []
        for k, (solids, bounds) in enumerate(self._surfaces):
            rng = np.random.default_rng([self._seed, k, draw])
            image = render(Scene(sensor, solids=solids), config, rng).image
            out.append(see(image, self._seen_by, StripeConfig(), self.look, bounds))
        self._done += 1
        self._progress(min(self._done, self._total), self._total)
        return tuple(out)


def seen_level(recorded: Sequence[ImageSeen]) -> float:
    """The black level that the recorded images show; 0 where no block of them is dark."""
    levels = np.concatenate([s.parts[:, NAMES.index("black")] for s in recorded])
    levels = levels[np.isfinite(levels)]
    return float(rounded_keys(max(float(levels.mean()), 0.0))) if len(levels) else 0.0


def _surface(seen: ImageSeen) -> tuple[Solid, ...]:
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
            strip = profile_strip(corners, HALF_LENGTH_MM)
            out.append(Solid(strip, Material(REFLECTANCE), Pose.identity(), f"surface {len(out)}"))
    return tuple(out)
