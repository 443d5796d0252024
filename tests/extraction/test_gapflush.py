"""Gap and flush on analytic panel profiles with truth: bias, calibrated σ, frames, outliers, honest refusals."""

import numpy as np
import pytest

from extraction import GapFlushConfig, measure_gap_flush
from extraction.stripe import Profile, StripePeaks
from geometry import InputError, NoAnswerError
from tests.pinned import pinned

SIGMA_MM = 0.01
ATOL_EXACT_MM = 1e-6


def as_profile(yz, sigma=SIGMA_MM):
    n, cov = len(yz), np.zeros((len(yz), 2, 2))
    cov[:, 1, 1] = sigma**2
    zero = np.zeros(n)
    peaks = StripePeaks(
        np.arange(n, dtype=np.int32),
        np.zeros((n, 2)),
        np.tile([0.0, 1.0], (n, 1)),
        *(zero,) * 5,
        flag=np.zeros(n, np.uint8),
    )
    return Profile(peaks, yz, cov)


def panels(
    gap=3.0,
    flush=0.5,
    radii=(1.5, 2.0),
    arc_deg=75.0,
    turn=0.0,
    pitch=0.08,
    floor=None,
    face=15.0,
    rng=None,
    noise=SIGMA_MM,
):
    """Two panels seen from above: left face at z = 0, edge at y = 0; the right one stands ``flush`` nearer."""
    y = np.arange(-face, face + gap, pitch)
    z = np.full(len(y), np.nan)
    for s, radius, top in ((y, radii[0], 0.0), (gap - y, radii[1], -flush)):
        z[s <= -radius] = top
        bend = (s > -radius) & (s <= -radius + radius * np.sin(np.deg2rad(arc_deg)))
        z[bend] = top + radius - np.sqrt(radius**2 - (s[bend] + radius) ** 2)
    if floor is not None:
        z[np.isnan(z)] = floor
    yz = np.column_stack([y, z])[np.isfinite(z)]
    c, s = np.cos(turn), np.sin(turn)
    yz = yz @ np.array([[c, s], [-s, c]]) + [5.0, 200.0]
    return yz if rng is None else yz + np.column_stack([np.zeros(len(yz)), rng.normal(0, noise, len(yz))])


CASES = {
    "plain": {},
    "turned": {"turn": 0.3},
    "turned back": {"turn": -0.4},
    "with a floor": {"floor": 10.0},
    "narrow": {"gap": 0.8},
    "other panel deeper": {"flush": -2.0},
    "fine radii": {"radii": (0.6, 0.7), "pitch": 0.05},
    "coarse radii": {"radii": (4.0, 4.0), "gap": 6.0},
}


def truth(case):
    return np.array([case.get("gap", 3.0), case.get("flush", 0.5), *case.get("radii", (1.5, 2.0))])


@pytest.mark.parametrize("name", CASES)
def test_exact_profiles_give_the_truth(name):
    case = CASES[name]
    g = measure_gap_flush(as_profile(panels(**case)))
    pinned(g)
    np.testing.assert_allclose([g.gap_mm, g.flush_mm, *g.radius_mm], truth(case), atol=ATOL_EXACT_MM)
    assert g.flag == ""


@pytest.mark.parametrize("name", ["plain", "turned", "with a floor"])
def test_noise_moves_the_answer_by_its_sigma(name):
    """Monte Carlo over 25 profiles: no bias, scatter 0.4 … 1.25 σ; σ allows for blur, the gap's above all."""
    case, rng, z = CASES[name], np.random.default_rng(1), []
    for _ in range(25):
        g = measure_gap_flush(as_profile(panels(rng=rng, **case)))
        pinned(g)
        z.append((np.array([g.gap_mm, g.flush_mm]) - truth(case)[:2]) / [g.sigma_gap_mm, g.sigma_flush_mm])
    assert np.all(np.abs(np.mean(z, axis=0)) < 0.2 + 3 / np.sqrt(25))
    assert np.all(np.std(z, axis=0) < 1.25)
    assert np.std(z, axis=0)[1] > 0.4
    assert np.std(z, axis=0)[0] > 0.25


def test_points_noisier_than_they_claim_widen_sigma():
    rng = np.random.default_rng(2)
    honest = measure_gap_flush(as_profile(panels(rng=rng, noise=0.03), sigma=0.03))
    pinned(honest)
    claimed = measure_gap_flush(as_profile(panels(rng=rng, noise=0.03), sigma=0.005))
    pinned(claimed)
    assert claimed.sigma_gap_mm > 0.5 * honest.sigma_gap_mm


def test_stray_points_do_not_matter():
    rng, off = np.random.default_rng(3), []
    for _ in range(10):
        yz = panels(rng=rng, floor=8.0)
        stray = rng.random(len(yz)) < 0.04
        yz[stray, 1] += rng.uniform(-8, 8, int(stray.sum()))
        g = measure_gap_flush(as_profile(yz))
        pinned(g)
        off.append([g.gap_mm - 3.0, g.flush_mm - 0.5])
    assert np.median(np.abs(off), axis=0).max() < 0.02
    assert np.abs(off).max() < 0.15


def test_reference_panel_decides_the_directions():
    """Right panel turned by 10° about its edge: the gap along either face differs as geometry says."""
    yz = panels(flush=0.0, radii=(1.5, 1.5))
    right = yz[:, 0] > 5 + 1.5
    a, pivot = np.deg2rad(10.0), np.array([5.0 + 3.0 + 1.5, 200.0 + 1.5])  # the bend's centre: the bend stays
    turn = np.array([[np.cos(a), -np.sin(a)], [np.sin(a), np.cos(a)]])
    yz[right] = (yz[right] - pivot) @ turn.T + pivot
    left = measure_gap_flush(as_profile(yz))
    pinned(left)
    other = measure_gap_flush(as_profile(yz), GapFlushConfig(reference="right"))
    pinned(other)
    centres = np.array([4.5 + 3.0 - 1.5, 0.0])  # from the left bend's centre to the right one's
    np.testing.assert_allclose(left.gap_mm, centres @ [1, 0] - 3.0, atol=2e-3)
    np.testing.assert_allclose(other.gap_mm, centres @ [np.cos(a), np.sin(a)] - 3.0, atol=2e-3)
    np.testing.assert_allclose(left.radius_mm, 1.5, atol=5e-3)


def test_mirrored_profile_swaps_the_sides_and_the_sign():
    yz = panels(rng=np.random.default_rng(4))
    a = measure_gap_flush(as_profile(yz))
    pinned(a)
    b = measure_gap_flush(as_profile(yz * [-1, 1]), GapFlushConfig(reference="right"))
    pinned(b)
    np.testing.assert_allclose([a.gap_mm, a.flush_mm], [b.gap_mm, b.flush_mm], atol=1e-4)
    np.testing.assert_allclose(a.radius_mm, b.radius_mm[::-1], atol=1e-4)
    c = measure_gap_flush(as_profile(yz), GapFlushConfig(reference="right"))
    pinned(c)
    assert c.flush_mm == pytest.approx(-a.flush_mm, abs=0.01), "parallel faces: the other way round, the other sign"


def test_order_of_points_does_not_matter():
    yz = panels(rng=np.random.default_rng(5))
    shuffled = np.random.default_rng(6).permutation(len(yz))
    a, b = measure_gap_flush(as_profile(yz)), measure_gap_flush(as_profile(yz[shuffled]))
    pinned((a, b))
    assert a.gap_mm == b.gap_mm


def test_sharp_edges_are_told():
    yz = panels(radii=(1e-3, 1e-3), flush=0.3, rng=np.random.default_rng(7))
    g = measure_gap_flush(as_profile(yz))
    pinned(g)
    assert g.flag == "sharp_left+sharp_right"
    assert np.isnan(g.radius_mm).all()
    assert abs(g.gap_mm - 3.0) < 3 * g.sigma_gap_mm
    assert g.sigma_gap_mm < 0.1


def test_short_arc_is_told_and_its_sigma_is_wide():
    g = measure_gap_flush(as_profile(panels(arc_deg=25.0, rng=np.random.default_rng(8))))
    pinned(g)
    assert "arc" in g.flag or "sharp" in g.flag
    assert g.sigma_gap_mm > 0.1


@pytest.mark.parametrize(
    ("yz", "message"),
    [
        (panels()[:20], "20 connected points"),
        (np.column_stack([np.linspace(0, 30, 400), np.full(400, 200.0)]), "panel|edges"),
        (panels()[panels()[:, 0] < 5.0], "only one panel"),
        (np.random.default_rng(9).uniform(0, 50, (400, 2)), "no panel"),
        (np.column_stack([np.linspace(0, 30, 400), 200 - np.abs(np.linspace(-15, 15, 400))]), "edges|panel"),
        (panels(gap=60.0, face=15.0), "edges"),
    ],
)
def test_no_gap_is_refused_in_a_sentence(yz, message):
    with pytest.raises(NoAnswerError, match=message) as refused:
        measure_gap_flush(as_profile(yz))
    pinned(str(refused.value))


def test_nan_is_refused():
    yz = panels()
    yz[5, 1] = np.nan
    with pytest.raises(InputError, match="not finite") as refused:
        measure_gap_flush(as_profile(yz))
    pinned(str(refused.value))


def test_random_profiles_raise_nothing_but_our_errors():
    """A small fuzz; rougher profiles than these are left to the long one of the whole pipeline."""
    rng = np.random.default_rng(10)
    for _ in range(40):
        n = int(rng.integers(0, 300))
        yz = np.column_stack([rng.uniform(0, 40, n), rng.choice([0, 1e-3, 1, 100.0]) * rng.normal(size=n)])
        if rng.random() < 0.5:
            yz[:, 1] = np.round(yz[:, 1])
        try:
            measure_gap_flush(as_profile(yz))
        except NoAnswerError:
            continue


GAUGE = {"gauge_depth_mm": 1.0, "gauge_offset_mm": 1.2}
RADII, GAP, FLUSH = (1.5, 2.0), 3.0, 0.5


def by_hand(tangent_deg=30.0, depth=1.0, offset=1.2):
    """Gap and flush of `panels()` by every definition, from its outline: z = 0 and −FLUSH, extreme points GAP apart."""
    (r, s), a = RADII, np.deg2rad(tangent_deg)
    turned = GAP + r * (1 - np.sin(a)) + s * (1 - np.sin(a)), FLUSH - s * (1 - np.cos(a))
    left = r - np.sqrt(r**2 - (r - depth) ** 2)  # how far a feeler of that depth stays from the extreme point
    right = s - np.sqrt(s**2 - (s - depth - FLUSH) ** 2)
    pin = s - np.sqrt(s**2 - (s - offset) ** 2)
    return {
        "extreme": (GAP, FLUSH),
        "tangent": turned,
        "edge": (GAP, FLUSH),
        "fixed_radius": (GAP, FLUSH),
        "gauge": (GAP + left + right, FLUSH - pin),
    }


@pytest.mark.parametrize("turn", [0.0, 0.3])
def test_every_definition_is_that_of_the_outline(turn):
    config = GapFlushConfig(tangent_deg=30.0, fixed_radius_mm=RADII, **GAUGE)
    found = measure_gap_flush(as_profile(panels(turn=turn)), config).definitions
    pinned(found)
    assert set(found) == set(by_hand())
    for name, (gap, flush) in by_hand().items():
        np.testing.assert_allclose([found[name].gap_mm, found[name].flush_mm], [gap, flush], atol=1e-5, err_msg=name)
        apart = found[name].gap_points[1] - found[name].gap_points[0]
        x = np.array([np.cos(turn), np.sin(turn)])
        assert apart @ x == pytest.approx(gap, abs=1e-5)
    straight = GapFlushConfig(tangent_deg=30.0, axis="distance", **GAUGE)
    distance = measure_gap_flush(as_profile(panels(turn=turn)), straight).definitions["tangent"].gap_mm
    pinned(distance)
    sunk = FLUSH - (RADII[1] - RADII[0]) * (1 - np.cos(np.deg2rad(30.0)))
    assert distance == pytest.approx(np.hypot(by_hand()["tangent"][0], sunk), abs=1e-5)


def test_chosen_definition_is_the_answer_and_the_rest_stand_beside_it():
    config = GapFlushConfig(definition="tangent")
    g = measure_gap_flush(as_profile(panels()), config)
    pinned(g)
    assert g.definition == "tangent"
    assert g.gap_mm == g.definitions["tangent"].gap_mm == pytest.approx(GAP + sum(RADII), abs=1e-5)
    assert set(g.definitions) == {"extreme", "tangent", "edge"}


def test_sigma_of_every_definition_is_that_of_the_scatter():
    """Monte Carlo: no bias, errors no larger than σ says; it allows for blur on the bends, which is not in here."""
    rng = np.random.default_rng(31)
    config = GapFlushConfig(tangent_deg=30.0, fixed_radius_mm=RADII, **GAUGE)
    pulls = {name: [] for name in by_hand()}
    widths = {name: [] for name in by_hand()}
    for _ in range(25):
        found = measure_gap_flush(as_profile(panels(rng=rng)), config).definitions
        pinned(found)
        for name, truth_ in by_hand().items():
            by = found[name]
            pulls[name].append((np.array([by.gap_mm, by.flush_mm]) - truth_) / [by.sigma_gap_mm, by.sigma_flush_mm])
            widths[name].append(by.sigma_gap_mm)
    for name, z in pulls.items():
        assert np.all(np.abs(np.mean(z, axis=0)) < 0.2 + 3 / np.sqrt(25)), name
        assert np.all(np.std(z, axis=0) < 1.3), name
        assert np.all(np.std(z, axis=0) > 0.2), name
    assert np.median(widths["fixed_radius"]) < 0.5 * np.median(widths["extreme"])


def test_a_feeler_that_reaches_no_bend_has_no_gap():
    config = GapFlushConfig(definition="gauge", gauge_depth_mm=0.5, gauge_offset_mm=2.0)
    with pytest.raises(NoAnswerError, match="feeler does not reach") as refused:
        measure_gap_flush(as_profile(panels(flush=-2.0)), config)
    pinned(str(refused.value))


def test_a_master_takes_out_what_both_share():
    g, master = (measure_gap_flush(as_profile(panels(gap=x))) for x in (3.0, 4.0))
    found = g.against(master, (4.1, 0.4), uncertainty_mm=0.02)
    assert found.gap_mm == pytest.approx(3.1, abs=1e-5)
    assert found.flush_mm == pytest.approx(0.4, abs=1e-5)
    together = np.sqrt(g.sigma_gap_mm**2 + master.sigma_gap_mm**2 + 0.01**2)
    assert found.sigma_gap_mm == pytest.approx(together, rel=1e-9)
    other = measure_gap_flush(as_profile(panels()), GapFlushConfig(definition="edge"))
    pinned(other)
    with pytest.raises(InputError, match='measured by "edge"') as refused:
        g.against(other, (3, 0))
    pinned(str(refused.value))


@pytest.mark.parametrize(
    "wrong", [{"definition": "gauge"}, {"definition": "fixed_radius"}, {"fixed_radius_mm": (0, 1)}]
)
def test_definitions_that_are_not_told_are_refused(wrong):
    with pytest.raises(ValueError, match=r"fixed_radius_mm|gauge_depth_mm") as refused:
        GapFlushConfig(**wrong)
    pinned(str(refused.value))
