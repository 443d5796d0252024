"""What the stripe's compiled stages stand on: order statistics, the exponential, fits side by side, gappy stripes."""

import numpy as np
import pytest

from extraction import detect_stripe
from extraction.noise import PixelNoise
from extraction.order import kth_smallest, kth_smallest_level, median
from extraction.stripe.sections.climb import exponential
from extraction.stripe.sections.faint import _say_enough_alone
from extraction.stripe.sections.fit import SECTION, SectionPlaces, fit_sections
from extraction.stripe.sections.ground import level_ground
from extraction.stripe.sections.model import FitLimits
from extraction.stripe.view import Pixels
from tests.pinned import pinned

RELATIVE = 1e-11


@pytest.mark.parametrize("kind", ["spread", "equal", "two", "sorted"])
def test_order_statistics_are_those_of_sorting(kind: str) -> None:
    rng = np.random.default_rng(4)
    for n in (1, 2, 3, 8, 101, 500):
        values = {
            "spread": rng.normal(size=n),
            "equal": np.full(n, 2.5),
            "two": rng.integers(0, 2, n).astype(float),
            "sorted": np.arange(n, dtype=float),
        }[kind]
        k = int(rng.integers(0, n))
        assert kth_smallest(values.copy(), k) == np.sort(values)[k]
        assert median(values.copy()) == np.median(values)
        levels = values.astype(np.float32)
        assert kth_smallest_level(levels, k) == np.sort(levels)[k]
    assert kth_smallest(np.empty(0), 0) == 0.0
    assert kth_smallest_level(np.empty(0, np.float32), 0) == 0.0
    assert median(np.empty(0)) == 0.0


def test_the_exponential_needs_no_library() -> None:
    x = np.linspace(-60, 60, 4001)
    own = np.array([exponential(v) for v in x])
    np.testing.assert_allclose(own, np.exp(x), rtol=RELATIVE, atol=0)


def test_a_fit_does_not_depend_on_those_beside_it() -> None:
    """Sections fitted all together, in turn and one by one: the same bits, as each keeps its order of sums."""
    rng = np.random.default_rng(0)
    rows, n = np.arange(90.0)[:, None], 150
    centre, width = rng.uniform(20, 70, n), rng.uniform(0.8, 6.0, n)
    mean = 8 + rng.uniform(20, 150, n) * np.exp(-0.5 * ((rows - centre) / width) ** 2)
    grey = rng.normal(mean, 1.0).round().clip(0, 255).astype(np.uint8)
    pixels = Pixels(grey, np.zeros((0, 0), bool))

    def fits(chosen: np.ndarray) -> np.ndarray:
        whole = np.zeros(len(chosen), np.int32)
        places = SectionPlaces(
            chosen.astype(np.int32), centre[chosen], whole, whole + 90, np.full(len(chosen), 2.0), level_ground()
        )
        table = np.zeros(len(chosen), SECTION)
        fit_sections(pixels, places, np.inf, FitLimits(255.0, 0.45, 14.0), PixelNoise(1.0, 0.0, 0.0, 0.0), table)
        return table

    together, turned = fits(np.arange(n)), fits(np.arange(n)[::-1])[::-1]
    alone = np.concatenate([fits(np.array([i])) for i in range(n)])
    assert np.all(together["converged"])
    for name in ("centre", "width", "amplitude", "variance", "chi2"):
        np.testing.assert_array_equal(together[name], turned[name])
        np.testing.assert_array_equal(together[name], alone[name])
    pull = (together["centre"] - centre) / np.sqrt(together["variance"])
    assert abs(np.std(pull) - 1) < 0.25


def test_a_stripe_without_a_peak_in_many_sections_is_doubted() -> None:
    """A band of light whose sections have no common peak: what is given of it is flagged; a laser's line is not."""
    rng = np.random.default_rng(2)
    row, u = np.arange(220)[:, None], np.arange(600)
    line = 100 + 0.03 * u
    laser = 90 * np.exp(-0.5 * ((row - line) / 2.0) ** 2)
    ragged = line + rng.normal(0, 12, 600)
    lamp = 90 * np.exp(-0.5 * ((row - ragged) / 2.0) ** 2)

    def seen(light: np.ndarray) -> np.ndarray:
        return rng.normal(12 + light, 1.2).round().clip(0, 255).astype(np.uint8)

    clear, rough = detect_stripe(seen(laser)), detect_stripe(seen(lamp))
    pinned((clear, rough))
    assert len(clear) == 600
    assert not np.any(clear.flag)
    assert np.count_nonzero(rough.flag == 0) == 0


@pytest.mark.parametrize(("claimed", "seen", "alone"), [(0.18, 1.0, True), (0.05, 1.0, False), (0.18, 0.8, False)])
def test_sections_stay_alone_where_neighbours_add_nothing(claimed, seen, alone):
    """0.2 px each: nine together claim as much, or a quarter of it; or a fifth of the sections shows no peak."""
    rng, one, nine = np.random.default_rng(3), np.zeros(400, SECTION), np.zeros(400, SECTION)
    one["centre"], nine["variance"] = 50 + rng.normal(0, 0.2, 400), claimed**2
    nine["centre"], nine["converged"] = 50, True
    one["converged"] = np.arange(400) < 400 * seen
    assert _say_enough_alone(one, nine, 2.0) == alone
