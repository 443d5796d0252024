"""Targets found in profiles whose points are made here, by angles and lengths; not proven: real sensors' noise."""

from dataclasses import replace

import numpy as np
import pytest

from extraction import Circle, FeatureConfig, Line, Profile, StripePeaks, find_target_points
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


def exact(*parts):
    """A profile of exact points: limits are met to the micrometre."""
    return profile(np.concatenate([np.asarray(part, float) for part in parts]))


def bow(centre, radius, half_deg, step_deg=0.5):
    """An arc towards z = 0."""
    t = np.deg2rad(np.arange(-half_deg, half_deg + step_deg / 2, step_deg))
    return np.column_stack([centre[0] + radius * np.sin(t), centre[1] - radius * np.cos(t)])


def stretch(start, end, pitch=PITCH_MM):
    n = round(float(np.hypot(*np.subtract(end, start))) / pitch) + 1
    return np.linspace(0.0, 1.0, n)[:, None] * np.subtract(end, start) + start


@pytest.mark.parametrize(
    ("radius", "half_deg", "diameters", "found"),
    [
        (20.0, 15.2, (40.0,), True), (20.0, 14.8, (40.0,), False),  # an arc of 30° at least
        (4.1, 60.0, (40.0,), True), (3.9, 60.0, (40.0,), False),  # a fifth of the radius
        (25.9, 60.0, (40.0,), True), (26.1, 60.0, (40.0,), False),  # 1.3 times
        (499.0, 16.0, (None,), True), (501.0, 16.0, (None,), False),
        (4.1, 60.0, (30.0, 40.0), True), (3.1, 60.0, (30.0, 40.0), True), (2.9, 60.0, (30.0, 40.0), False),
        (25.9, 60.0, (30.0, 40.0), True), (26.1, 60.0, (30.0, 40.0), False),
    ],
)  # fmt: skip
def test_an_arc_at_both_sides_of_each_limit(radius, half_deg, diameters, found):
    kind = "sphere" if len(diameters) == 1 else "balls"
    assert len(find_target_points(exact(bow((3.0, 700.0), radius, half_deg)), kind, diameters)) > 0 or not found
    assert (find_target_points(exact(bow((3.0, 700.0), radius, half_deg)), kind, diameters).reason is None) == found


@pytest.mark.parametrize(("radius", "share", "rival"), [(20.0, 0.45, True), (20.0, 0.35, False), (5.9, 0.6, False)])
def test_a_second_arc_is_a_rival_by_its_points_and_its_width(radius, share, rival):
    """Two fifths of the first's points, three tenths of the ball's radius."""
    first = bow((0.0, 200.0), 20.0, 60.0)
    step = 120.0 / (share * len(first))
    second = bow((70.0, 200.0), radius, 60.0, step)
    found = find_target_points(exact(first, second), "sphere", (40.0,))
    assert (found.reason is not None) == rival
    if rival:
        assert "two balls are in view, at (y, z) = (0.0, 200.0) and (70.0, 200.0) mm" in found.text
        assert found.rivals == 1
        near = find_target_points(
            exact(first, second), "sphere", (40.0,), expected_mm=np.array([[75.9, 208.0]]), within_mm=10.0
        )
        assert near.curves[0].centre_mm[0] == pytest.approx(70.0, abs=1e-6)
        far = find_target_points(
            exact(first, second), "sphere", (40.0,), expected_mm=np.array([[76.1, 208.0]]), within_mm=10.0
        )
        assert "within 10 mm of where it is expected" in far.text


def test_what_is_said_of_a_radius_stated_for_a_diameter():
    found = find_target_points(exact(bow((0.0, 200.0), 20.0, 60.0)), "sphere", (20.0,))
    assert found.text == (
        "none of the 241 points lie on an arc of radius 2 … 10 mm, but 241 on one of 20 mm: is the diameter stated "
        "right?"
    )


@pytest.mark.parametrize(
    ("length", "pitch", "found"), [(8.01, 0.2, True), (7.79, 0.2, False), (12.0, 1.0, True), (10.0, 1.0, False)]
)
def test_a_straight_stretch_has_a_least_length_and_points_enough(length, pitch, found):
    """8 mm, and twelve points."""
    points = exact(stretch((0.0, 200.0), (length, 200.0), pitch))
    assert (find_target_points(points, "plane").reason is None) == found
    if not found and pitch < 1:
        assert "make a straight stretch of 8 mm or more" in find_target_points(points, "plane").text


@pytest.mark.parametrize(("bend", "found"), [(0.0149, True), (0.0151, False)])
def test_a_straight_stretch_bends_by_so_much_of_its_length(bend, found):
    s = np.linspace(-20.0, 20.0, 201)
    bent = np.column_stack([s, 200.0 + bend * 40.0 * (1 - (s / 20.0) ** 2)])
    config = FeatureConfig(min_tolerance_mm=1.0)
    got = find_target_points(exact(bent), "plane", config=config)
    assert (got.reason is None) == found
    if found:
        assert abs(got.bend_mm) == pytest.approx(bend * 40.0, rel=1e-6)


def test_two_straight_stretches_of_like_length_are_said():
    long = stretch((-50.0, 200.0), (0.0, 200.0))
    for length, rivals in ((22.0, 1), (18.0, 0)):
        found = find_target_points(exact(long, stretch((5.0, 215.0), (5.0 + length, 220.0))), "plane")
        assert found.rivals == rivals
        assert ("two straight stretches are in view" in found.text) == bool(rivals)
        assert found.reason is None


@pytest.mark.parametrize(
    ("turn_deg", "gap_mm", "found"),
    [(10.2, 0.0, True), (9.8, 0.0, False), (60.0, 2.9, True), (60.0, 3.1, False)],
)
def test_two_faces_are_a_wedge_where_they_turn_enough_and_meet(turn_deg, gap_mm, found):
    way = np.array([np.cos(np.deg2rad(turn_deg)), np.sin(np.deg2rad(turn_deg))])
    ridge = np.array([0.0, 200.0])
    left = stretch((-30.0, 200.0), (-gap_mm, 200.0))
    right = stretch(ridge + gap_mm * way, ridge + 30.0 * way)
    got = find_target_points(exact(left, right[gap_mm == 0 :]), "wedge")
    assert (got.reason is None) == found
    if found:
        assert set(got.feature) == {0, 1}
        assert got.yz_mm[got.feature == 0, 0].max() < 0 < got.yz_mm[got.feature == 1, 0].min()
    else:
        assert got.text == "2 straight stretches in view, and no two of them meet in a ridge" or turn_deg < 10


def test_an_edge_lies_half_a_pitch_beyond_its_last_point():
    """A plate 20 mm before a table: both ends jump; where it is expected one is taken, half a pitch outwards."""
    plate = stretch((-25.0, 200.0), (25.0, 200.0), 0.5)
    table = [stretch((-60.0, 220.0), (-25.5, 220.0), 0.5), stretch((25.5, 220.0), (60.0, 220.0), 0.5)]
    both = find_target_points(exact(table[0], plate, table[1]), "edge")
    np.testing.assert_allclose(both.yz_mm, [[-25.25, 200.0], [25.25, 200.0]], rtol=0, atol=1e-6)
    assert "both ends of the straight stretch can be the edge, and where the field of view ends is not" in both.text
    assert both.rivals == 1
    one = find_target_points(exact(table[0], plate, table[1]), "edge", expected_mm=np.array([[20.0, 203.0]]))
    np.testing.assert_allclose(one.yz_mm, [[25.25, 200.0]], rtol=0, atol=1e-6)
    assert one.cov_yz_mm2[0, 0, 0] == pytest.approx(0.5**2 / 12, rel=1e-3)
    assert (one.text, one.rivals) == ("", 0)
    none = find_target_points(exact(table[0], plate, table[1]), "edge", expected_mm=np.array([[10.0, 203.0]]))
    assert none.reason is not None
