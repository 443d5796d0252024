"""Targets found in profiles whose points are made here, by angles and lengths; not proven: real sensors' noise."""

from dataclasses import replace

import numpy as np
import pytest

from extraction import Circle, Line, Profile, StripePeaks, find_target_points
from extraction.features.shapes import Circles, Lines
from geometry import InputError
from tests.pinned import pinned

SIGMA_MM = 0.03
ATOL_MM = 0.05  # of a centre or corner from some hundred points with that noise
PITCH_MM = 0.2


def profile(yz, sigma_mm=0.0):
    n = len(yz)
    zero, two = np.zeros(n), np.zeros((n, 2))
    peaks = StripePeaks(
        np.arange(n, dtype=np.int32), two, two, zero, zero, zero, zero, zero, np.zeros(n, dtype=np.uint8)
    )
    return Profile(peaks, np.asarray(yz, float), np.broadcast_to(sigma_mm**2 * np.eye(2), (n, 2, 2)))


def ball(centre, radius, rng, half_deg=60.0):
    """The side of a circle that faces z = 0, one point a pitch of y."""
    reach = radius * np.sin(np.deg2rad(half_deg))
    y = np.arange(-reach, reach, PITCH_MM)
    yz = np.column_stack([y, -np.sqrt(radius**2 - y**2)]) + centre
    return yz + rng.normal(size=yz.shape) * [0.0, SIGMA_MM]


def flat(start, end, rng):
    n = int(np.hypot(*np.subtract(end, start)) / PITCH_MM)
    t = np.linspace(0.0, 1.0, n)[:, None]
    return start + t * np.subtract(end, start) + rng.normal(size=(n, 2)) * [0.0, SIGMA_MM]


@pytest.mark.parametrize("seed", range(5))
def test_the_ball_is_found_and_stem_table_and_strays_are_not(seed):
    rng = np.random.default_rng(seed)
    arc = ball((5.0, 220.0), 17.0, rng)
    stem = ball((5.0, 245.0), 5.0, rng, 80.0)
    table = np.concatenate([flat((-60.0, 250.0), (-12.0, 250.0), rng), flat((22.0, 250.0), (60.0, 250.0), rng)])
    strays = rng.uniform([-60, 150], [60, 260], (25, 2))
    found = find_target_points(profile(np.concatenate([arc, stem, table, strays])), "sphere", (40.0,))
    pinned(found)
    assert found.reason is None
    circle = found.curves[0]
    assert np.allclose(circle.centre_mm, (5.0, 220.0), rtol=0, atol=ATOL_MM)
    assert abs(circle.radius_mm - 17.0) < ATOL_MM
    assert np.count_nonzero(found.index < len(arc)) >= 0.98 * len(arc)
    assert np.count_nonzero(found.index >= len(arc)) <= 3
    assert found.n_points == len(arc) + len(stem) + len(table) + len(strays)
    assert found.bulges_towards_z == -1
    assert abs(found.scatter_mm - SIGMA_MM) < 0.4 * SIGMA_MM


def test_a_profile_without_the_ball_is_said():
    rng = np.random.default_rng(1)
    found = find_target_points(profile(flat((-50.0, 200.0), (50.0, 204.0), rng)), "sphere", (40.0,))
    pinned(found)
    assert found.reason == "no_target"
    assert "arc" in found.text
    assert len(found) == 0
    assert find_target_points(profile(np.zeros((0, 2))), "sphere", (40.0,)).reason == "no_profile"


def test_a_stated_diameter_ten_per_cent_too_small_still_finds_the_arc():
    """What is wrong with the diameter must be told by all frames together, not by an empty profile."""
    found = find_target_points(profile(ball((0.0, 200.0), 20.0, np.random.default_rng(2))), "sphere", (36.0,))
    pinned(found)
    assert found.reason is None
    assert abs(found.curves[0].radius_mm - 20.0) < ATOL_MM


def test_two_balls_are_refused_unless_it_is_known_which():
    rng = np.random.default_rng(3)
    both = profile(np.concatenate([ball((-25.0, 220.0), 17.0, rng), ball((25.0, 225.0), 19.0, rng)]))
    found = find_target_points(both, "sphere", (40.0,))
    pinned(found)
    assert found.reason == "no_target"
    assert found.rivals == 1
    assert "two balls" in found.text
    chosen = find_target_points(both, "sphere", (40.0,), expected_mm=np.array([[-23.0, 221.0]]))
    pinned(chosen)
    assert np.allclose(chosen.curves[0].centre_mm, (-25.0, 220.0), rtol=0, atol=ATOL_MM)
    pair = find_target_points(both, "balls", (40.0, 40.0))
    pinned(pair)
    assert [round(c.centre_mm[0]) for c in pair.curves] == [-25, 25]
    assert set(pair.feature.tolist()) == {0, 1}


@pytest.mark.parametrize("seed", range(8))
def test_a_second_ball_is_seen_among_clutter(seed):
    """Of somewhat more than the share of points that makes a rival, which is what the search ends at."""
    rng = np.random.default_rng(seed)
    first, second = ball((-25.0, 220.0), 17.0, rng), ball((25.0, 225.0), 15.0, rng, 32.0)
    assert 0.45 < len(second) / len(first) < 0.6
    clutter = rng.uniform([-60, 150], [60, 300], (150, 2))
    found = find_target_points(profile(np.concatenate([first, second, clutter])), "sphere", (40.0,))
    pinned(found)
    assert found.rivals == 1


def test_clutter_too_small_for_a_second_ball_is_not_searched():
    class Counted:
        def __init__(self):
            self.drawn, self.rng = 0, np.random.default_rng(0)

        def integers(self, low, high, count):
            self.drawn += count
            return self.rng.integers(low, high, count)

    rng = np.random.default_rng(1)
    arc = ball((0.0, 220.0), 17.0, rng)
    clutter = rng.uniform([-60, 150], [60, 300], (len(arc) // 3, 2))
    counted = Counted()
    found = find_target_points(profile(np.concatenate([arc, clutter])), "sphere", (40.0,), rng=counted)
    pinned(found)
    assert found.reason is None
    assert counted.drawn < 300  # of three numbers each; 12,000 where the search ended by itself


def test_many_curves_are_as_each_alone():
    rng = np.random.default_rng(2)
    triples, yz = rng.normal(size=(20, 3, 2)), rng.normal(size=(50, 2))
    triples[3, 2] = triples[3, 0] + 3 * (triples[3, 1] - triples[3, 0])
    for many, points in ((Circles, triples), (Lines, triples[:, :2])):
        curves = many.through(points)
        for k in range(len(curves)):
            assert np.array_equal(curves.near(yz, 0.3)[k], np.abs(curves[k].residuals(yz)) < 0.3)
    circles = Circles.through(triples)
    others = [c for c in (Circle.fit(t, np.ones(3)) for t in np.delete(triples, 3, axis=0)) if c is not None]
    assert len(others) >= 17
    for other in others:
        assert np.min(np.hypot(*(circles.centre_mm - other.centre_mm).T)) < 1e-6 * other.radius_mm


@pytest.mark.parametrize("bend_mm", [0.0, 0.4])
def test_a_plate_is_a_straight_stretch_and_its_bend_is_told(bend_mm):
    rng = np.random.default_rng(4)
    plate = flat((-40.0, 210.0), (45.0, 230.0), rng)
    plate[:, 1] += bend_mm * (1 - np.linspace(-1, 1, len(plate)) ** 2)
    clamp = flat((46.0, 200.0), (56.0, 200.0), rng)
    found = find_target_points(profile(np.concatenate([plate, clamp])), "plane")
    pinned(found)
    assert found.reason is None
    assert np.count_nonzero(found.index < len(plate)) >= 0.98 * len(plate)
    assert np.count_nonzero(found.index >= len(plate)) == 0
    assert abs(found.bend_mm - bend_mm * np.cos(np.arctan2(20, 85))) < 4 * found.sigma_bend_mm
    assert found.sigma_bend_mm < 0.02


def test_the_sections_beside_a_stripes_ends_are_left_out_where_its_width_is_known():
    """Twice its σ of 2 px at either end, where half of the light is missing; of points without an image none."""
    y = np.arange(200) * 0.1
    plain = profile(np.column_stack([y, np.full(200, 200.0)]), 0.02)
    wide = replace(plain, peaks=replace(plain.peaks, width_px=np.full(200, 2.0)))
    assert find_target_points(plain, "plane").n_found == 200
    found = find_target_points(wide, "plane")
    pinned(found)
    np.testing.assert_array_equal(np.sort(found.index), np.arange(4, 196))
    assert len(found.yz_mm) == len(found.cov_yz_mm2) == len(found.feature) == 192


def test_a_ball_is_no_plane():
    found = find_target_points(profile(ball((0.0, 200.0), 20.0, np.random.default_rng(5))), "plane")
    pinned(found)
    assert found.reason == "no_target"


def test_the_corner_of_a_plate_has_no_bias_and_a_true_sigma():
    """The border falls anywhere within a pitch; the corner's mean error over many borders is none."""
    errors, sigmas = [], []
    for seed in range(100):
        rng = np.random.default_rng(seed)
        border = rng.uniform(0.0, PITCH_MM)
        y = np.arange(-30.0, 60.0, PITCH_MM)
        z = np.where(y < border, 200.0 + 0.3 * y, 230.0) + rng.normal(size=len(y)) * SIGMA_MM
        field = np.array([[-30.0, 100.0], [61.0, 100.0], [61.0, 300.0], [-30.0, 300.0]])
        found = find_target_points(
            profile(np.column_stack([y, z])[y < 25]), "edge", expected_mm=np.array([[0.0, 200.0]]),
            field_of_view_mm=field,
        )  # fmt: skip
        pinned(found)
        assert len(found) == 1
        errors.append(found.yz_mm[0] - [border, 200.0 + 0.3 * border])
        sigmas.append(np.sqrt(found.cov_yz_mm2[0, 0, 0]))
    errors = np.array(errors)
    assert abs(errors[:, 0].mean()) < 0.02
    assert 0.8 < errors[:, 0].std() / np.mean(sigmas) < 1.25
    assert abs(errors[:, 1].mean()) < 0.02


def test_an_end_at_the_fields_border_is_no_edge():
    rng = np.random.default_rng(6)
    plate = profile(flat((-40.0, 210.0), (40.0, 210.0), rng))
    left = np.array([[-60.0, 100.0], [40.1, 100.0], [40.1, 300.0], [-60.0, 300.0]])
    found = find_target_points(plate, "edge", field_of_view_mm=left)
    pinned(found)
    assert np.allclose(found.yz_mm, [[-40.0, 210.0]], rtol=0, atol=PITCH_MM)
    both = find_target_points(plate, "edge")
    pinned(both)
    assert both.rivals == 1
    assert "both ends" in both.text
    tight = np.array([[-40.1, 100.0], [40.1, 100.0], [40.1, 300.0], [-40.1, 300.0]])
    assert find_target_points(plate, "edge", field_of_view_mm=tight).reason == "no_target"


@pytest.mark.parametrize("towards_sensor", [False, True])
@pytest.mark.parametrize("plate_mm", [25.0, 60.0])
def test_a_plate_before_a_table_ends_where_the_profile_jumps(plate_mm, towards_sensor):
    """Whichever of both is longer: the table's end is the plate's shadow, and no field of view need be known."""
    rng = np.random.default_rng(8)
    table = flat((-40.0, 230.0), (-0.1, 230.0), rng)
    yz = np.concatenate([table, flat((0.1, 210.0), (plate_mm, 205.0), rng)])
    yz[:, 1] = 300.0 - yz[:, 1] if towards_sensor else yz[:, 1]
    found = find_target_points(profile(yz), "edge", towards_sensor=towards_sensor)
    assert found.reason is None
    assert found.rivals == 0
    corner = 90.0 if towards_sensor else 210.0
    assert np.allclose(found.yz_mm, [[0.0, corner]], rtol=0, atol=PITCH_MM)


def test_a_plate_whose_other_surroundings_are_nearer_has_no_edge_there():
    """A clamp before the plate hides its border."""
    rng = np.random.default_rng(9)
    yz = np.concatenate([flat((-40.0, 210.0), (0.0, 210.0), rng), flat((0.2, 180.0), (7.0, 180.0), rng)])
    field = np.array([[-40.1, 100.0], [60.0, 100.0], [60.0, 300.0], [-40.1, 300.0]])
    assert find_target_points(profile(yz), "edge", field_of_view_mm=field).reason == "no_target"


def test_the_faces_of_a_wedge_are_told_apart():
    rng = np.random.default_rng(7)
    faces = np.concatenate([flat((-30.0, 230.0), (2.0, 205.0), rng), flat((2.0, 205.0), (35.0, 222.0), rng)])
    table = flat((50.0, 260.0), (90.0, 260.0), rng)
    found = find_target_points(profile(np.concatenate([faces, table])), "wedge")
    pinned(found)
    assert found.reason is None
    assert all(isinstance(c, Line) for c in found.curves)
    ridge = found.curves[0].meets(found.curves[1])
    assert np.allclose(ridge, (2.0, 205.0), rtol=0, atol=ATOL_MM)
    assert np.all(found.yz_mm[found.feature == 0, 0] < 2.0)
    assert np.all(found.yz_mm[found.feature == 1, 0] > 2.0)
    assert find_target_points(profile(table), "wedge").reason == "no_target"


def test_the_stated_covariance_is_scaled_to_what_points_scatter_by():
    rng = np.random.default_rng(8)
    found = find_target_points(profile(ball((0.0, 200.0), 18.0, rng), sigma_mm=0.01), "sphere", (40.0,))
    pinned(found)
    n = found.curves[0].normals(found.yz_mm)
    sigma = np.sqrt(np.einsum("ni,nij,nj->n", n, found.cov_yz_mm2, n))
    assert abs(np.median(sigma) / found.scatter_mm - 1) < 0.05


def test_circles_and_lines_are_exact_through_their_fewest_points():
    circle = Circle.through(np.array([[3.0, 4.0], [-5.0, 0.0], [0.0, -5.0]]))
    assert np.allclose(circle.centre_mm, 0.0, rtol=0, atol=1e-12)
    assert abs(circle.radius_mm - 5.0) < 1e-12
    assert Circle.through(np.array([[0.0, 0.0], [1.0, 1.0], [2.0, 2.0]])) is None
    line = Line.through(np.array([[1.0, 1.0], [-1.0, 3.0]]))
    assert line.direction[0] > 0
    assert np.allclose(line.residuals(np.array([[0.0, 2.0]])), 0.0, rtol=0, atol=1e-12)


def test_unknown_kinds_and_impossible_diameters_are_refused():
    some = profile(np.zeros((20, 2)))
    with pytest.raises(InputError, match="sphere") as refused:
        find_target_points(some, "spher")
    pinned(str(refused.value))
    with pytest.raises(InputError, match="diameter") as refused:
        find_target_points(some, "sphere", (-1.0,))
    pinned(str(refused.value))
    assert find_target_points(some, "sphere", (40.0,)).reason == "no_target"


def test_a_radius_stated_for_a_diameter_is_told_by_the_larger_arc():
    rng = np.random.default_rng(11)
    found = find_target_points(profile(ball((2.0, 240.0), 19.0, rng)), "sphere", (20.0,))
    assert found.reason == "no_target"
    assert "on one of 19 mm: is the diameter stated right?" in found.text
    table = profile(flat((-40.0, 240.0), (40.0, 240.0), rng))
    assert "stated right" not in find_target_points(table, "sphere", (20.0,)).text
