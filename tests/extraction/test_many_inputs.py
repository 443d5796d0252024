"""Many small inputs drawn at random about what is decided, their answers kept: a limit that moves changes some of them.

What makes the answers right is for the other tests to say.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from extraction import FeatureConfig, extract, find_target_points, measure_gap_flush
from extraction.spots import TrueSpot
from geometry import NoAnswerError
from tests.extraction.spots import camera, make_sensor, mean_frame
from tests.extraction.test_features import ball, flat, profile
from tests.extraction.test_gapflush import as_profile, panels
from tests.pinned import pinned

SIZE = (200, 160)


def _spots(rng: np.random.Generator) -> list[TrueSpot]:
    """Of every size, shape and brightness, also near one another and at the border."""
    count = int(rng.integers(1, 7))
    places = rng.uniform([2, 2], [SIZE[0] - 2, SIZE[1] - 2], (count, 2))
    if count > 1 and rng.random() < 0.5:
        places[1] = places[0] + rng.uniform(-9, 9, 2)
    return [
        TrueSpot(u, v, rng.uniform(20, 3500), rng.uniform(0.6, 6.0), rng.uniform(0.6, 2.0), rng.uniform(-1.5, 1.5))
        for u, v in places
    ]


def _frame(rng: np.random.Generator) -> np.ndarray:
    """Spots in a picture with, at times, a lamp's slope, a bright blob, hot pixels and a scratch."""
    mean = mean_frame(_spots(rng), *SIZE, background=float(rng.uniform(2, 40)))
    v, u = np.mgrid[: SIZE[1], : SIZE[0]]
    if rng.random() < 0.4:
        mean = mean + rng.uniform(0, 30) * u / SIZE[0]
    if rng.random() < 0.3:
        mean = mean + 80 * np.exp(-0.5 * ((u - rng.uniform(0, 200)) ** 2 + (v - rng.uniform(0, 160)) ** 2) / 12.0**2)
    if rng.random() < 0.3:
        mean[int(rng.integers(0, SIZE[1])), 10:150] += rng.uniform(10, 60)
    image = camera(mean, rng, read=float(rng.uniform(0.3, 2.0)))
    if rng.random() < 0.3:
        image.ravel()[rng.integers(0, image.size, 5)] = 255
    return image


@pytest.mark.parametrize("block", range(4))
def test_spots_of_many_pictures(block: int) -> None:
    sensor = make_sensor(*SIZE)
    found = {str(k): extract(_frame(np.random.default_rng([block, k])), sensor) for k in range(12)}
    pinned(found)


def _course(rng: np.random.Generator) -> np.ndarray:
    """Arcs, stretches and strays, which may be what is sought, too short, too small or too much bent."""
    parts = []
    for _ in range(int(rng.integers(1, 4))):
        at = rng.uniform([-50, 190], [50, 230])
        if rng.random() < 0.5:
            parts.append(ball(at, rng.uniform(2, 30), rng, rng.uniform(8, 80)))
        else:
            end = at + rng.uniform([3, -6], [45, 6])
            part = flat(at, end, rng)
            t = np.linspace(-1, 1, len(part))
            part[:, 1] += (rng.random() < 0.5) * rng.uniform(0, 0.03) * np.ptp(part[:, 0]) * (1 - t**2)
            parts.append(part)
    if rng.random() < 0.5:
        parts.append(rng.uniform([-60, 150], [60, 260], (int(rng.integers(1, 30)), 2)))
    return np.concatenate(parts)


@pytest.mark.parametrize("kind", ["sphere", "balls", "plane", "edge", "wedge"])
def test_targets_in_many_profiles(kind: str) -> None:
    given: dict[str, Any] = {"sphere": {"diameters_mm": (30.0,)}, "balls": {"diameters_mm": (30.0, 40.0)}}.get(kind, {})
    found = {}
    for k in range(24):
        rng = np.random.default_rng([k, len(kind)])
        yz = _course(rng)
        where = {"expected_mm": yz[len(yz) // 3 : len(yz) // 3 + 1] + 3.0} if k % 3 == 0 else {}
        config = FeatureConfig(ransac_trials=600)
        found[str(k)] = find_target_points(profile(yz, 0.02 * (k % 2)), kind, config=config, **given, **where)
    pinned(found)


def test_gap_and_flush_of_many_panels() -> None:
    found: dict[str, object] = {}
    for k in range(24):
        rng = np.random.default_rng([k, 7])
        yz = panels(
            gap=rng.uniform(0.3, 9.0), flush=rng.uniform(-2, 2), radii=tuple(rng.uniform(0.2, 4.0, 2)),
            arc_deg=rng.uniform(40, 88), turn=rng.uniform(-0.5, 0.5), pitch=rng.uniform(0.04, 0.2),
            floor=rng.choice([None, 6.0, 12.0]), face=rng.uniform(3, 15), rng=rng, noise=rng.uniform(0.003, 0.05),
        )  # fmt: skip
        kept = rng.random(len(yz)) > rng.choice([0.0, 0.1, 0.4])
        yz[rng.integers(0, len(yz), int(rng.choice([0, 5])))] += rng.uniform(-2, 2)
        try:
            found[str(k)] = measure_gap_flush(as_profile(yz[kept]))
        except NoAnswerError as error:
            found[str(k)] = str(error)
    pinned(found)
