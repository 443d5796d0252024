"""What a twin's fit compares: noise before rounding, darkness part by part, differences and their covariance.

What it does not prove: that the fit finds the keys (test_twin.py; over many sensors benchmarks/twin_recovery.py).
"""

from __future__ import annotations

import numpy as np
import pytest

from extraction import StripeConfig
from extraction.stripe import AMBIGUOUS, SATURATED
from perceptron_emu import EmulatorConfig
from tests.workbench.test_twin import small_sensor, stripes
from workbench.twin import emulation, fit
from workbench.twin.differences import difference
from workbench.twin.emulation import Emulation
from workbench.twin.rounding import unrounded
from workbench.twin.seen import NAMES, ImageSeen, Look, see

ATOL_DN = 0.02
PATTERN = np.random.default_rng(3)


@pytest.mark.parametrize(("mean", "sigma"), [(4.0, 0.2), (4.5, 0.3), (9.97, 0.5), (0.3, 1.0), (20.0, 3.0), (0.0, 0.6)])
def test_noise_is_known_from_rounded_levels(mean: float, sigma: float) -> None:
    levels = np.maximum(np.floor(np.random.default_rng(1).normal(mean, sigma, 200_000) + 0.5), 0)
    found = unrounded(float(levels.mean()), float(levels.var()))
    assert found == pytest.approx((mean, sigma), abs=ATOL_DN)


def test_one_level_alone_tells_no_noise() -> None:
    assert unrounded(7.0, 0.0) == pytest.approx((7.0, 0.1), abs=ATOL_DN)


def test_every_part_has_dark_blocks_of_its_own() -> None:
    """Σ of the black level's mean is that of all its pixels, not of one set counted four times."""
    config = EmulatorConfig.model_validate({"noise": {"read_noise_e": 60.0}})
    ((_, image),) = stripes(small_sensor(), config, 1)
    seen = see(image, small_sensor(), StripeConfig(), Look())
    black = seen.parts[:, NAMES.index("black")]
    assert len(np.unique(black)) == len(black) > 2
    assert black.mean() == pytest.approx(9.0, abs=0.3)


def test_emulated_stripes_are_seen_with_the_recorded_ones_black_level(monkeypatch: pytest.MonkeyPatch) -> None:
    sensor = small_sensor()
    images = [image for _, image in stripes(sensor, EmulatorConfig(), 1)]
    recorded, seen_by, look = fit._recorded(images, small_sensor(0.0))
    assert seen_by.require_camera().black_level == pytest.approx(9.0, abs=0.1)
    levels = []
    monkeypatch.setattr(
        emulation,
        "see",
        lambda image, told, *rest: levels.append(told.require_camera().black_level) or see(image, told, *rest),
    )
    emulate = Emulation(small_sensor(0.0), EmulatorConfig(), seen_by, recorded, look, 0, lambda *_: None, 1)
    start = [
        v if k.linear else np.log(v) for k, v in zip(fit.KEYS, fit.start_values(sensor, EmulatorConfig()), strict=True)
    ]
    (emulated,) = emulate(np.linalg.solve(fit.TO_KEYS, start))
    assert levels == [seen_by.require_camera().black_level]
    assert np.array_equal(emulated.bounds, recorded[0].bounds)
    assert emulated.parts.shape == recorded[0].parts.shape


def test_what_a_surface_does_to_both_is_in_no_difference() -> None:
    slope = np.linspace(0, 5, 4)[:, None] * np.ones(len(NAMES))
    recorded = [_seen(slope + 0.01 * PATTERN.normal(size=slope.shape) + 0.3) for _ in range(3)]
    found = difference(recorded, [[_seen(slope)] * 3])
    assert found.mean == pytest.approx(np.full(len(NAMES), 0.3), abs=0.02)
    sigma = np.sqrt(np.diag(found.covariance))
    assert np.all(sigma < 0.01)
    assert sigma.mean() == pytest.approx(0.01 / np.sqrt(12), rel=0.3)


def test_images_of_their_own_light_say_less() -> None:
    """The variance of the mean is that of three images' own levels, not of twelve parts'."""
    levels = (0.0, 1.0, 2.0)
    recorded = [_seen(k + 0.01 * PATTERN.normal(size=(4, len(NAMES)))) for k in levels]
    found = difference(recorded, [[_seen(np.zeros((4, len(NAMES))))] * 3])
    assert np.sqrt(np.diag(found.covariance)) == pytest.approx(
        np.full(len(NAMES), np.std(levels, ddof=1) / np.sqrt(3)), rel=0.02
    )


def test_draws_are_meant_and_figures_that_none_tells_are_none() -> None:
    recorded = [_seen(np.ones((4, len(NAMES))))]
    recorded[0].parts[:, 2] = np.nan
    found = difference(recorded, [[_seen(np.zeros((4, len(NAMES))))], [_seen(np.ones((4, len(NAMES))))]])
    assert np.isnan(found.mean[2])
    assert found.mean[0] == 0.5
    assert np.all(np.isfinite(found.covariance))


def test_points_in_doubt_are_left_out_but_for_those_whose_ridge_is_known() -> None:
    assert Look().wrong() & AMBIGUOUS
    assert not Look(doubted_too=True).wrong() & AMBIGUOUS
    assert Look(doubted_too=True).wrong() & SATURATED
    assert not Look(clipped_too=True).wrong() & SATURATED


def _seen(parts: np.ndarray) -> ImageSeen:
    return ImageSeen(np.zeros((1, 1), np.uint8), None, np.zeros(0), np.arange(len(parts) + 1), np.array(parts), 0, 0)  # type: ignore[arg-type]
