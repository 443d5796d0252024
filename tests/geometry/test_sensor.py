"""The sensor's checks, its field of view and lens model against OpenCV, points and lines."""

from dataclasses import replace

import cv2
import numpy as np
import pytest
from hypothesis import given, settings

from geometry import (
    AxisPoints,
    InputError,
    Pose,
    Sensor,
    Sheet,
    SurfacePoints,
    cross_plane_x0,
    did_you_mean,
    distance_to_line,
    field_of_view,
    inside_polygon,
)
from geometry.sensor import Optics, ProfileOutput, SensorUncertainty, project
from geometry.sensor.field_of_view import MAX_DISTANCE_MM
from tests.geometry.strategies import SEEDS, line_sensor
from tests.pinned import pinned

LENSES = {
    "none": (),
    "four": (-0.2, 0.12, 8e-4, -6e-4),
    "five": (-0.25, 0.14, 1e-3, -5e-4, -0.03),
    "rational": (0.8, -0.3, 5e-4, 2e-4, 0.05, 0.95, -0.2, 0.02),
    "prism": (-0.2, 0.1, 1e-4, 2e-4, 0.0, 0.0, 0.0, 0.0, 2e-3, -1e-3, 1e-3, 5e-4),
    "tilted": (-0.2, 0.15, 1e-3, -2e-3, 0.05, 0.01, -0.02, 0.01, 1e-3, -1e-3, 2e-3, 1e-3, 0.12, -0.15),
}


def by_opencv(sensor, yz_mm: np.ndarray) -> np.ndarray:  # type: ignore[no-untyped-def]
    """Pixels (N, 2) of points of the sheet, by cv2.projectPoints."""
    T_camera_sensor = sensor.camera.T_sensor_camera.inverse()
    xyz = np.column_stack([np.zeros(len(yz_mm)), yz_mm])
    rvec = cv2.Rodrigues(T_camera_sensor.R)[0]
    uv, _ = cv2.projectPoints(xyz, rvec, T_camera_sensor.t, sensor.camera.matrix, sensor.camera.distortion14)
    return np.asarray(uv[:, 0])


@pytest.mark.parametrize("lens", LENSES)
@given(seed=SEEDS)
@settings(max_examples=10)
def test_field_of_view_is_what_opencv_projects_into_the_image(lens: str, seed: int) -> None:
    """Random points of the lit fan: inside the polygon exactly where OpenCV puts them into the image, 0.5 px apart."""
    sensor = line_sensor(distortion=LENSES[lens])
    polygon = field_of_view(sensor)
    low, high = polygon.min(0) - 30, np.minimum(polygon.max(0) + 30, 900)
    points = np.random.default_rng(seed).uniform(low, high, (400, 2))
    u, v = by_opencv(sensor, points).T
    border = np.minimum.reduce([u + 0.5, sensor.camera.width_px - 0.5 - u, v + 0.5, sensor.camera.height_px - 0.5 - v])
    half = sensor.sheet.fan_rad / 2
    fan = points[:, 1] * np.sin(half) - np.abs(points[:, 0]) * np.cos(half)
    clear = (np.abs(border) > 0.5) & (np.abs(fan) > 0.5)
    expected = (border > 0) & (fan > 0)
    np.testing.assert_array_equal(inside_polygon(points, polygon)[clear], expected[clear])


@pytest.mark.parametrize("lens", LENSES)
def test_the_corners_of_the_field_are_the_corners_of_the_image(lens: str) -> None:
    sensor = line_sensor(distortion=LENSES[lens], fan_rad=np.deg2rad(120))
    u, v = by_opencv(sensor, field_of_view(sensor)).T
    on_border = np.minimum.reduce([np.abs(u + 0.5), np.abs(u - 1279.5), np.abs(v + 0.5), np.abs(v - 1023.5)])
    assert on_border.max() < 1e-8


def test_a_margin_takes_its_strip_off() -> None:
    u, v = by_opencv(sensor := line_sensor(fan_rad=2.0), field_of_view(sensor, margin_px=20.0)).T
    np.testing.assert_allclose([u.min(), u.max(), v.min(), v.max()], [19.5, 1259.5, 19.5, 1003.5], rtol=0, atol=1e-8)
    with pytest.raises(InputError, match="margin_px") as refused:
        field_of_view(sensor, margin_px=600.0)
    pinned(str(refused.value))


def test_a_view_open_to_the_horizon_is_closed() -> None:
    """A camera that looks along the sheet sees it to infinity; the polygon ends and stays finite."""
    rotation = Pose.from_fixed_xyz_deg([0, 0, 90], [0, 0, 0]).R  # optical axis parallel to the sheet
    polygon = field_of_view(line_sensor(T_sensor_camera=Pose(rotation, np.array([120.0, 0, 0]))))
    assert np.all(np.isfinite(polygon))
    assert 0.9 * MAX_DISTANCE_MM < polygon[:, 1].max() < 1.1 * MAX_DISTANCE_MM


def test_a_lens_that_folds_back_ends_the_view_at_the_fold() -> None:
    """With k1 = -2 the radius comes to rest at r = 1/√6 and no pixel beyond 0.27 f has a ray."""
    sensor = line_sensor(fx_px=1500.0, fy_px=1500.0, distortion=(-2.0, 0, 0, 0, 0), fan_rad=2.5)
    polygon = field_of_view(sensor)
    T_camera_sensor = sensor.camera.T_sensor_camera.inverse()
    ray = T_camera_sensor @ np.column_stack([np.zeros(len(polygon)), polygon])
    radius = np.hypot(*(ray[:, :2] / ray[:, 2:]).T)
    assert radius.max() <= 1 / np.sqrt(6)
    assert radius.max() > 0.4


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"width_px": 0}, "image size"),
        ({"bit_depth": 9}, "bit_depth 9"),
        ({"black_level": 255.0}, "black_level"),
        ({"black_level": -1.0}, "black_level"),
        ({"fx_px": -1.0}, "must be positive"),
        ({"cx_px": np.nan}, "not finite"),
        ({"distortion": (0.1, 0.2, 0.3)}, "3 terms"),
        ({"distortion": (0.0,) * 12 + (8.0, 0.0)}, "tilt τx = 8 rad is 458°"),
        ({"distortion": (1e4, 0, 0, 0, 0)}, "no lens does"),
        ({"distortion": (1e300, 0, 0, 0, 0)}, "no lens does"),
        ({"fx_px": 1e9}, "so wide or so narrow"),
        ({"cx_px": -1e9}, "far off the image"),
        ({"T_sensor_camera": Pose(np.diag([1.0, 1, -1]), np.array([120.0, 0, 0]))}, "reflection"),
        ({"T_sensor_camera": Pose(np.eye(3), np.zeros(3))}, "edge-on"),
        ({"origin_mm": np.array([1.0, 0, 0])}, "x must be 0"),
        ({"origin_mm": np.zeros(2)}, "three finite"),
        ({"fan_rad": 4.0}, "between 0 and 180"),
    ],
)
def test_numbers_that_are_no_sensor_are_refused(change: dict[str, object], message: str) -> None:
    with pytest.raises(InputError, match=message) as refused:
        line_sensor(**change)
    pinned(str(refused.value))


@pytest.mark.parametrize("angle_deg", [0.0, 20.0, 60.0])
def test_a_camera_that_looks_away_from_the_sheet_is_refused(angle_deg: float) -> None:
    good = line_sensor()
    away = Pose.from_fixed_xyz_deg([0, 40 + angle_deg, 0], [0, 0, 0]).R @ good.camera.T_sensor_camera.R
    with pytest.raises(InputError, match=r"turn \[camera\.pose\]") as refused:
        good.with_camera(T_sensor_camera=Pose(away, good.camera.T_sensor_camera.t))
    pinned(str(refused.value))


def test_a_fan_that_the_camera_does_not_see_is_refused() -> None:
    with pytest.raises(InputError, match="sees nothing") as refused:
        field_of_view(line_sensor(origin_mm=np.array([0.0, 2000.0, 0.0]), fan_rad=0.1))
    pinned(str(refused.value))


FIELD = np.array([[-40.0, 150.0], [40.0, 150.0], [60.0, 300.0], [-60.0, 300.0]])


def test_a_profile_sensor_has_a_field_of_view_and_no_camera() -> None:
    """The polygon stands as its maker gives it, whatever margin of an image is asked for."""
    sensor = Sensor(Sheet(), profile=ProfileOutput(field_of_view_mm=FIELD), name="profiler")
    np.testing.assert_array_equal(field_of_view(sensor, margin_px=20.0), FIELD)
    for ask in (sensor.require_camera, lambda: sensor.with_camera(bit_depth=8)):
        with pytest.raises(InputError, match='"profiler" has no camera') as refused:
            ask()
        pinned(str(refused.value))
    with pytest.raises(InputError, match="field_of_view_mm") as refused:
        field_of_view(Sensor(Sheet(), profile=ProfileOutput()))
    pinned(str(refused.value))
    with pytest.raises(InputError, match="no camera") as refused:
        field_of_view(Sensor(Sheet()))
    pinned(str(refused.value))


def test_points_must_lie_open_to_emitter_and_camera() -> None:
    sensor = line_sensor(origin_mm=np.array([0.0, 0.0, -10.0]))
    np.testing.assert_array_equal(sensor.viewpoints_mm, [[0, 0, -10], sensor.require_camera().centre_mm])
    np.testing.assert_array_equal(Sensor(Sheet(), profile=ProfileOutput()).viewpoints_mm, [[0, 0, 0]])


def test_a_profile_sensor_states_its_noise() -> None:
    stated = ProfileOutput(sigma_y_mm=0.02, sigma_z_mm=0.01)
    np.testing.assert_allclose(stated.require_covariance(), np.diag([4e-4, 1e-4]), rtol=0, atol=1e-18)
    with pytest.raises(InputError, match="sigma_z_mm") as refused:
        ProfileOutput(sigma_y_mm=0.02).require_covariance()
    pinned(str(refused.value))


def test_a_sensor_gives_images_or_profiles() -> None:
    with pytest.raises(InputError, match="not both") as refused:
        replace(line_sensor(), profile=ProfileOutput())
    pinned(str(refused.value))


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ({"format": "gocatr"}, 'did you mean "gocator"'),
        ({"sigma_y_mm": 0.0}, "sigma_y_mm"),
        ({"sigma_z_mm": np.nan}, "sigma_z_mm"),
        ({"pitch_mm": -0.1}, "pitch_mm"),
        ({"start_mm": np.inf}, "start_mm"),
        ({"unit": 0}, "unit = 0: must be 1"),
        ({"width": 10**6}, "width = 1000000: must be 1"),
        ({"field_of_view_mm": FIELD[:2]}, "three or more"),
        ({"field_of_view_mm": FIELD * np.nan}, "finite"),
        ({"field_of_view_mm": np.column_stack([FIELD[:, 0], FIELD[:, 0]])}, "no area"),
    ],
)
def test_numbers_that_are_no_profile_sensor_are_refused(values: dict[str, object], message: str) -> None:
    with pytest.raises(InputError, match=message) as refused:
        ProfileOutput(**values)  # type: ignore[arg-type]
    pinned(str(refused.value))


def test_counts_of_a_profile_sensor_are_taken_to_their_ends() -> None:
    assert (ProfileOutput(unit=1, width=999_999).unit, ProfileOutput(width=999_999).width) == (1, 999_999)


def test_standard_deviations_by_name_are_a_diagonal_covariance() -> None:
    uncertainty = SensorUncertainty.from_sigma({"fx_px": 2.0, "scale_y": 1e-3}, "drawing")
    np.testing.assert_allclose(uncertainty.covariance, np.diag([4.0, 1e-6]), rtol=0, atol=1e-18)
    assert uncertainty.sigma == pytest.approx({"fx_px": 2.0, "scale_y": 1e-3}, rel=1e-12)
    assert SensorUncertainty.from_sigma({}, "data sheet").covariance.shape == (0, 0)
    with pytest.raises(InputError, match="fx_px is a camera's") as refused:
        Sensor(Sheet(), profile=ProfileOutput(), uncertainty=uncertainty)
    pinned(str(refused.value))


@pytest.mark.parametrize(
    ("parameters", "covariance", "message"),
    [
        (("fz_px",), [[1.0]], "did you mean"),
        (("fx_px", "fx_px"), np.eye(2), "2 times"),
        (("fx_px",), np.eye(2), "1 × 1"),
        (("fx_px",), [[np.nan]], "not finite"),
        (("fx_px",), [[-1.0]], "negative"),
        (("fx_px", "fy_px"), [[1.0, 0.5], [0.4, 1.0]], "not symmetric"),
        (("fx_px", "fy_px"), [[1.0, 1.1], [1.1, 1.0]], "negative eigenvalue"),
    ],
)
def test_what_is_no_covariance_is_refused(parameters: tuple[str, ...], covariance: object, message: str) -> None:
    with pytest.raises(InputError, match=message) as refused:
        SensorUncertainty(parameters, np.array(covariance))
    pinned(str(refused.value))
    with pytest.raises(InputError, match="source") as refused:
        SensorUncertainty((), np.zeros((0, 0)), "hearsay")
    pinned(str(refused.value))
    with pytest.raises(InputError, match="fx_px = -1") as refused:
        SensorUncertainty.from_sigma({"fx_px": -1.0})
    pinned(str(refused.value))


def test_optics_that_are_no_numbers_are_refused() -> None:
    with pytest.raises(InputError, match="f_number") as refused:
        Optics(f_number=np.inf)
    pinned(str(refused.value))
    with pytest.raises(InputError, match="wavelength_nm") as refused:
        Optics(wavelength_nm=-660.0)
    pinned(str(refused.value))


def test_saturation_is_the_full_scale_unless_stated() -> None:
    assert line_sensor(bit_depth=12).require_camera().saturation_dn == 4095
    assert line_sensor(bit_depth=12, stated_saturation_dn=4000).require_camera().saturation_dn == 4000
    for change in ({"stated_saturation_dn": 256}, {"stated_saturation_dn": 9, "black_level": 10.0}):
        with pytest.raises(InputError, match="saturation_dn") as refused:
            line_sensor(**change)
        pinned(str(refused.value))
    with pytest.raises(InputError, match="channel") as refused:
        line_sensor(channel="rot")
    pinned(str(refused.value))


@pytest.mark.parametrize("lens", LENSES)
@given(seed=SEEDS)
@settings(max_examples=10)
def test_projection_is_opencvs(lens: str, seed: int) -> None:
    """Points of the view; points behind the camera have no pixel."""
    sensor = line_sensor(distortion=LENSES[lens])
    camera = sensor.require_camera()
    yz = np.random.default_rng(seed).uniform([-80, 200], [80, 450], (2, 50, 2))
    xyz = np.concatenate([np.zeros((2, 50, 1)), yz], axis=-1)
    expected = np.stack([by_opencv(sensor, one) for one in yz])
    np.testing.assert_allclose(project(camera, xyz), expected, rtol=0, atol=1e-8)
    assert np.all(np.isnan(project(camera, camera.centre_mm - 10 * camera.T_sensor_camera.R[:, 2])))


@given(SEEDS)
def test_crossings_lie_on_the_line_and_in_the_plane(seed: int) -> None:
    rng = np.random.default_rng(seed)
    points, directions = rng.normal(size=(2, 5, 3)) * 100
    crossing, s = cross_plane_x0(points, directions)
    steep = np.abs(directions[:, 0]) > 1.0
    np.testing.assert_allclose(crossing[steep, 0], 0, rtol=0, atol=1e-9)
    np.testing.assert_allclose(crossing, points + s[:, None] * directions, rtol=0, atol=1e-9)
    unit = directions / np.linalg.norm(directions, axis=-1, keepdims=True)
    np.testing.assert_allclose(distance_to_line(crossing, points, unit)[steep], 0, rtol=0, atol=1e-7)


def test_lines_parallel_to_the_plane_do_not_cross_it() -> None:
    crossing, s = cross_plane_x0([[1.0, 2, 3], [1.0, 2, 3]], [[0.0, 1, 1], [0.0, 0, 0]])
    assert np.all(np.isnan(crossing))
    assert np.all(np.isnan(s))


def test_points_of_unequal_columns_are_refused() -> None:
    assert len(SurfacePoints.empty()) == len(AxisPoints.empty()) == 0
    with pytest.raises(InputError, match="2 points need") as refused:
        replace(SurfacePoints.empty(), score=np.ones(2))
    pinned(str(refused.value))
    for flag in ((), ("", "")):
        with pytest.raises(InputError, match=f"{len(flag)} flags for 1 points") as refused:
            AxisPoints(("A",), np.zeros(1, dtype=np.intp), np.zeros((1, 2)), np.zeros((1, 2, 2)), flag)
        pinned(str(refused.value))


def test_suggestions_come_only_where_something_is_near() -> None:
    assert did_you_mean("heigth_mm", ["side_mm", "height_mm"]) == ': did you mean "height_mm"?'
    assert did_you_mean("zebra", ["side_mm", "height_mm"]) == ""


@pytest.mark.parametrize("name", ["unit", "width"])
def test_counts_of_a_profile_end_where_six_digits_do(name: str) -> None:
    for value in (1, 999_999):
        assert getattr(ProfileOutput(**{name: value}), name) == value
    for value in (-1, 0, 1_000_000, 5_000_000):
        with pytest.raises(InputError, match=rf"\[profile\] {name} = {value}: must be 1 … 999999") as refused:
            ProfileOutput(**{name: value})
        pinned(str(refused.value))
